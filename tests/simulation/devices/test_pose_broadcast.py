"""The simulated pose at every source, and the effect of its delay on estimates."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from math import isfinite
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from control.controller import WalkOrder
from control.modes import Mode
from control.records import BodyPose, StrideEstimate
from drivers.pose.natnet_client import NatNetClient
from drivers.pose.natnet_port import NatNetPort
from drivers.pose.natnet_sockets import AXES, NatNetParameters, parse_axis
from drivers.pose.pose_port import OpenedPose, PoseReport
from drivers.pose.rail_encoder import RailEncoderParameters
from firmware_host.configuration.configuration import Configuration, PoseParameters
from firmware_host.pose_sources import open_pose
from simulation.body.plant import Plant
from simulation.devices.motion_capture import CameraFrame, MotionCapture
from simulation.devices.motion_capture_parameters import MotionCaptureParameters
from simulation.devices.natnet_server import LOOPBACK, NatNetServer, RecordedPose
from simulation.devices.pose_broadcast import PoseBroadcast
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import Clay
from simulation.mud.track import Track
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


class StreamedPose:
    """A PoseSource that captures the plant's body and sends it by NatNet over the loopback interface."""

    def __init__(self, plant: Plant, latency_s: float) -> None:
        self._plant, self._capture = plant, MotionCapture(MotionCaptureParameters(rate_hz=120.0), 1)
        self.server = NatNetServer(latency_s=latency_s)
        address = NatNetParameters(server=LOOPBACK, group="", command_port=self.server.address[1])
        self.port = NatNetPort(NatNetClient(address, AXES["x"]))

    def read(self, now_s: float) -> BodyPose:
        for frame in self._capture.step(now_s, self._plant):
            self.server.add(RecordedPose(frame.exposed_s, (frame.x_m, 0.0, 0.0)))
        self.server.step(now_s)
        return self.port.read(now_s)

    def report(self) -> PoseReport:
        return self.port.report()

    def close(self) -> None:
        self.server.close()
        self.port.close()


def strides_of(robot: Lockstep) -> list[StrideEstimate]:
    robot.arm()
    robot.walk(WalkOrder(0.03, adaptive=False, strides=1))
    robot.run_until(lambda: robot.loop.mode is not Mode.WALKING, 10.0)
    return [closed.estimate for closed in robot.loop.learning.strides]


def test_a_late_camera_that_reports_its_latency_biases_no_bound(configuration: Configuration) -> None:
    """In firm mud the plates do not slip while the body moves.

    If 20 ms of latency are not reported the plates seem to slip, so a lower bound of k_s becomes a value below it.
    """
    strong = {joint: replace(drive, current_limit_a=20.0) for joint, drive in configuration.drive.items()}
    limits = replace(configuration.limits, torque_nm=1.65)
    adaptation = replace(configuration.adaptation, motor_force_n=10.0)
    robot_of = replace(configuration, drive=strong, limits=limits, adaptation=adaptation)
    track = Track([(100.0, Clay("firm", 3000.0))])
    exact = strides_of(Lockstep(robot_of, track))
    late = strides_of(Lockstep(robot_of, track, motion_capture=MotionCaptureParameters(120.0, latency_s=0.02)))
    robot = Lockstep(robot_of, track)
    with closing(StreamedPose(robot.robot.plant, 0.02)) as robot.loop.pose:
        reported = strides_of(robot)
    assert len(exact) == len(late) == len(reported) == 2
    assert all(stride.k_s.at_least for stride in exact)
    assert not any(stride.k_s.at_least for stride in late)
    assert any(one.k_s.value < 0.95 * true.k_s.value for one, true in zip(late, exact, strict=True))
    for one, true in zip(reported, exact, strict=True):
        assert one.k_s.at_least and one.k_s.value == pytest.approx(true.k_s.value, rel=0.01)
