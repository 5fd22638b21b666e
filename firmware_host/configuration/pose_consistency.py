"""Checks the choice of a pose source: keys that contradict each other, malformed addresses."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator

from drivers.pose.natnet_sockets import is_address, parse_version
from drivers.pose.track_axis import parse_axis
from firmware_host.configuration.configuration import PoseParameters
from firmware_host.configuration.toml_records import shown

LONGEST_INTERFACE = 15  # IFNAMSIZ with its final zero


def pose_problems(pose: PoseParameters) -> Iterator[str]:
    """Yields a message with key, value and bound for each problem."""
    if pose.chosen == "socket" and not pose.socket:
        yield "pose.socket = '': must name a socket where pose.source = 'socket'"
    if pose.chosen in ("natnet", "rail_encoder") and pose.socket:
        yield f"pose.socket = {pose.socket!r}: must be left out where pose.source = {pose.chosen!r}"
    if parse_axis(pose.axis) is None:
        yield f"pose.axis = {shown(pose.axis)}: must be x, y or z, with or without a minus, or three numbers, not all 0"
    if pose.chosen == "natnet":
        yield from _natnet_problems(pose)
    if pose.chosen == "rail_encoder":
        yield from _encoder_problems(pose)


def _natnet_problems(pose: PoseParameters) -> Iterator[str]:
    natnet = pose.natnet
    if natnet.server and not is_address(natnet.server):
        yield f"pose.natnet.server = {natnet.server!r}: must be an address of four numbers, such as 192.168.1.10"
    if natnet.group and not (is_address(natnet.group) and ipaddress.IPv4Address(natnet.group).is_multicast):
        yield f"pose.natnet.group = {natnet.group!r}: must be from 224.0.0.0 to 239.255.255.255, or empty"
    if not is_address(natnet.interface) and not _is_interface(natnet.interface):
        longest = f"a name of at most {LONGEST_INTERFACE} letters, such as eth0, or an address of this computer"
        yield f"pose.natnet.interface = {natnet.interface!r}: must be {longest}"
    if natnet.version and parse_version(natnet.version) is None:
        yield f"pose.natnet.version = {natnet.version!r}: must be from 2.6 to 4.255, such as 4.1"
    if natnet.body and natnet.body_id:
        yield f"pose.natnet.body_id = {natnet.body_id}: must be left out where pose.natnet.body names the body"
    if natnet.server:
        return
    if not natnet.group:
        yield "pose.natnet.server = '': must be given where pose.natnet.group is empty"
    if not natnet.version:
        yield "pose.natnet.version = '': must be given where no pose.natnet.server can be asked for it"
    if natnet.body:
        yield f"pose.natnet.body = {natnet.body!r}: needs a pose.natnet.server to ask; or give pose.natnet.body_id"


def _is_interface(name: str) -> bool:
    return len(name.encode()) <= LONGEST_INTERFACE and name.isprintable() and not set(name) & set("/ ")


def _encoder_problems(pose: PoseParameters) -> Iterator[str]:
    encoder = pose.rail_encoder
    if not encoder.device or "\0" in encoder.device:
        yield f"pose.rail_encoder.device = {encoder.device!r}: must name a serial port, such as /dev/ttyACM0"
    if encoder.metres_per_count == 0.0:
        yield "pose.rail_encoder.metres_per_count = 0.0: must be given, and not 0"
