"""`mudskipper check` examines the source of the pose when no daemon runs."""

import threading
import time
from dataclasses import replace

import pytest

from command_line.doctor import doctor
from command_line.doctor.doctor import examine_pose
from command_line.doctor.findings import Level
from drivers.pose.natnet_sockets import NatNetParameters
from drivers.pose.rail_encoder import RailEncoderParameters
from firmware_host.configuration.configuration import Configuration, PoseParameters
from simulation.devices.natnet_server import LOOPBACK, NatNetServer, RecordedPose
from tests.waiting import LONGEST_S


def test_a_source_that_does_not_open_fails_and_a_robot_without_one_has_no_line_for_it(
    configuration: Configuration,
) -> None:
    assert examine_pose(configuration) == []
    pytest.importorskip("serial", reason="pyserial is not installed")
    encoder = RailEncoderParameters(device="/dev/nothing", metres_per_count=1e-5)
    (item,) = examine_pose(replace(configuration, pose=PoseParameters("rail_encoder", rail_encoder=encoder)))
    assert item.level is Level.FAIL and "/dev/nothing" in item.text and item.fix


def test_motion_capture_is_received(configuration: Configuration, monkeypatch: pytest.MonkeyPatch) -> None:
    with NatNetServer() as server:
        natnet = NatNetParameters(server=LOOPBACK, group="", command_port=server.address[1])
        looked_at = replace(configuration, pose=PoseParameters("natnet", natnet=natnet))
        (item,) = examine_pose(looked_at)
        assert item.level is Level.WARN and item.fix
        ended = threading.Event()

        def stream() -> None:
            while not ended.is_set():
                server.add(RecordedPose(time.monotonic(), (time.monotonic() % 1000.0 * 1e-3, 0.0, 0.0)))
                server.step(time.monotonic())
                time.sleep(0.005)

        streaming = threading.Thread(target=stream)
        streaming.start()
        monkeypatch.setattr(doctor, "LISTENING_S", LONGEST_S)  # a pose ends it
        (item,) = examine_pose(looked_at)
        ended.set()
        streaming.join()
    assert item.level is Level.OK and item.text.startswith("NatNet 4.1 from 127.0.0.1: ")
