"""Sends the simulated body's pose to the source that the robot's configuration names.

Motion capture's frames leave through the pose socket, as NatNet packets from the address at which the robot looks for
its server, or as counts of a rail encoder that appears where the robot looks for its device.
"""

from pathlib import Path

from drivers.pose.natnet_sockets import AXES, parse_axis, parse_version
from drivers.pose.pose_port import PoseSender
from firmware_host.configuration.configuration import PoseParameters
from simulation.body.plant import Plant
from simulation.devices.motion_capture import CameraFrame, MotionCapture
from simulation.devices.motion_capture_parameters import OF_THE_PAPER
from simulation.devices.natnet_server import LOOPBACK, NEWEST_VERSION, NatNetServer, RecordedPose
from simulation.devices.rail_encoder_emulator import EmulatedRailEncoder


class PoseLine:
    """One connection to a robot; this one sends nothing."""

    def send(self, frame: CameraFrame) -> None:
        return

    def step(self, now_s: float) -> None:
        return

    def close(self) -> None:
        return


class SocketLine(PoseLine):
    def __init__(self, path: Path) -> None:
        self._sender = PoseSender(path)

    def send(self, frame: CameraFrame) -> None:
        self._sender.send(*frame)

    def close(self) -> None:
        self._sender.close()


class NatNetLine(PoseLine):
    """A NatNet server on this computer."""

    def __init__(self, pose: PoseParameters) -> None:
        """Raise OSError for an address that this computer does not have."""
        natnet = pose.natnet
        self._direction = parse_axis(pose.axis) or AXES["x"]
        self._origin_m = pose.origin_m
        self.server = NatNetServer(
            version=parse_version(natnet.version) or NEWEST_VERSION,
            target=(natnet.group, natnet.port) if natnet.group else None,
            address=(natnet.server or LOOPBACK, natnet.command_port),
            identity=natnet.body_id or 1,
            name=natnet.body or "mudskipper",
        )

    def send(self, frame: CameraFrame) -> None:
        a, b, c = self._direction
        position_m = frame.x_m + self._origin_m
        self.server.add(RecordedPose(frame.exposed_s, (a * position_m, b * position_m, c * position_m)))

    def step(self, now_s: float) -> None:
        self.server.step(now_s)

    def close(self) -> None:
        self.server.close()


class RailEncoderLine(PoseLine):
    """A rail encoder on a pseudo-terminal, under the device's name."""

    def __init__(self, pose: PoseParameters) -> None:
        """Raise OSError where the name is taken."""
        encoder = pose.rail_encoder
        self._origin_m = pose.origin_m
        self.counter = EmulatedRailEncoder(Path(encoder.device), encoder.metres_per_count, encoder.label)

    def send(self, frame: CameraFrame) -> None:
        self.counter.send(frame.x_m + self._origin_m)

    def close(self) -> None:
        self.counter.unplug()


class PoseBroadcast:
    """Sends the body's position as motion capture measures it."""

    def __init__(self, pose: PoseParameters, seed: int) -> None:
        """Raise OSError where this computer cannot provide that source."""
        self.line = _line(pose)
        self._capture = MotionCapture(OF_THE_PAPER, seed)

    def step(self, now_s: float, plant: Plant) -> None:
        for frame in self._capture.step(now_s, plant):
            self.line.send(frame)
        self.line.step(now_s)

    def close(self) -> None:
        self.line.close()


def _line(pose: PoseParameters) -> PoseLine:
    match pose.chosen:
        case "socket":
            return SocketLine(Path(pose.socket))
        case "natnet":
            return NatNetLine(pose)
        case "rail_encoder":
            return RailEncoderLine(pose)
    return PoseLine()
