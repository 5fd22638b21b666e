"""The simulated pose at every source, and the effect of its delay on estimates."""

import socket
import time
from collections.abc import Iterator
from contextlib import closing
from math import isfinite
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from control.records import BodyPose
from drivers.pose.natnet_client import NatNetClient
from drivers.pose.natnet_port import NatNetPort
from drivers.pose.natnet_sockets import AXES, NatNetParameters, parse_axis
from drivers.pose.pose_port import OpenedPose
from drivers.pose.rail_encoder import RailEncoderParameters
from firmware_host.configuration.configuration import PoseParameters
from firmware_host.pose_sources import open_pose
from simulation.devices.motion_capture import CameraFrame
from simulation.devices.natnet_server import LOOPBACK
from simulation.devices.pose_broadcast import PoseBroadcast
from tests.waiting import LONGEST_S

STEP_S = 0.002


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind((LOOPBACK, 0))
        return int(free.getsockname()[1])


def made_plant(now_s: float) -> Any:
    """Return the part of a plant that the broadcast reads, for a body that moves at 0.1 m/s."""
    return SimpleNamespace(body_m=0.1 * now_s, body_m_s=0.1)


def poses_of(folder: Path) -> Iterator[PoseParameters]:
    yield PoseParameters(socket=str(folder / "pose"))
    natnet = NatNetParameters(server=LOOPBACK, group="", command_port=free_port(), body="crawler")
    yield PoseParameters("natnet", axis="-z", origin_m=0.3, natnet=natnet)
    natnet = NatNetParameters(version="3.1", interface="lo", port=free_port(), command_port=free_port())
    yield PoseParameters("natnet", axis=[0.6, 0.0, 0.8], natnet=natnet)


def open_in_this_process(pose: PoseParameters) -> OpenedPose:
    """Open the source so that it follows the time of the test; motion capture has a process of its own otherwise."""
    if pose.chosen != "natnet":
        return open_pose(pose)
    return NatNetPort(NatNetClient(pose.natnet, parse_axis(pose.axis) or AXES["x"]), pose.origin_m)


@pytest.mark.parametrize("which", range(3), ids=["socket", "unicast", "multicast"])
def test_poses_arrive_at_the_configured_source(short_folder: Path, which: int) -> None:
    pose = list(poses_of(short_folder))[which]
    broadcast = PoseBroadcast(pose, 1)
    received: list[BodyPose] = []
    with closing(broadcast), closing(open_in_this_process(pose)) as port:
        for step in range(600):
            now_s = step * STEP_S
            broadcast.step(now_s, made_plant(now_s))
            received.append(port.read(now_s))
    known = [(step * STEP_S, body) for step, body in enumerate(received) if isfinite(body.x_m)]
    assert len({body.stamp_s for _, body in known}) > 100  # of 144 frames in 1.2 s
    assert all(abs(body.x_m - 0.1 * now_s) < 0.003 for now_s, body in known)


def test_counts_arrive_from_the_device_of_the_configuration(short_folder: Path) -> None:
    pytest.importorskip("serial", reason="pyserial is not installed")
    encoder = RailEncoderParameters(device=str(short_folder / "encoder"), metres_per_count=-1e-5, label="n")
    pose = PoseParameters("rail_encoder", origin_m=-0.2, rail_encoder=encoder)
    with closing(PoseBroadcast(pose, 1)) as broadcast, closing(open_pose(pose)) as port:
        broadcast.line.send(CameraFrame(0.0, 0.0))  # the robot ignores the first line, which may be cut
        for step in range(1, 20):
            broadcast.line.send(CameraFrame(0.01 * step, 0.001 * step))
            deadline_s = time.monotonic() + LONGEST_S
            while port.report().poses < step and time.monotonic() < deadline_s:
                body = port.read(0.01 * step)
            assert body.x_m == pytest.approx(0.001 * step)


def test_a_pose_source_that_cannot_be_provided_raises_an_os_error(short_folder: Path) -> None:
    elsewhere = NatNetParameters(server="192.0.2.1", group="")
    with pytest.raises(OSError, match="Cannot assign"):
        PoseBroadcast(PoseParameters("natnet", natnet=elsewhere), 1)
    (short_folder / "real").touch()
    encoder = RailEncoderParameters(device=str(short_folder / "real"), metres_per_count=1e-5)
    with pytest.raises(FileExistsError):
        PoseBroadcast(PoseParameters("rail_encoder", rail_encoder=encoder), 1)
