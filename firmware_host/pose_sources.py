"""Opens the source of the body's pose that the configuration names."""

from pathlib import Path

from drivers.pose.natnet_bridge import NatNetBridge
from drivers.pose.natnet_port import NatNetPort
from drivers.pose.natnet_sockets import AXES, parse_axis
from drivers.pose.pose_port import NoPose, OpenedPose, PosePort
from drivers.pose.rail_encoder import RailEncoder
from firmware_host.configuration.configuration import PoseParameters


def open_pose(pose: PoseParameters) -> OpenedPose:
    """Open the chosen source; raises PoseSourceError."""
    match pose.chosen:
        case "socket":
            return PosePort(Path(pose.socket))
        case "natnet":
            return NatNetPort(NatNetBridge(pose.natnet, parse_axis(pose.axis) or AXES["x"]), pose.origin_m)
        case "rail_encoder":
            return RailEncoder(pose.rail_encoder, pose.origin_m)
    return NoPose()
