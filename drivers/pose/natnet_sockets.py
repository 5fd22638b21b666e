"""The configuration of a NatNet client, and its UDP sockets: one joins the multicast group, one sends requests.

A server that does not multicast sends its frames to the socket that sent the requests. Nothing here waits.
"""

import ipaddress
import os
import socket
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from math import hypot
from struct import pack
from typing import Annotated

from control.bounds import Bounds, Meaning
from drivers.pose.natnet_codec import LONGEST_PACKET, NEWEST, OLDEST, NatNetVersion, encode_request

MOST_PACKETS_PER_READ = 16  # of each socket; frames at 240 Hz are fewer than one in a tick
ANY_ADDRESS = "0.0.0.0"
Direction = tuple[float, float, float]  # a unit vector along the track, in the frame of the cameras
AXES: dict[str, Direction] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class NatNetParameters:
    server: Annotated[str, Meaning("address of the motion-capture computer; empty: no request is sent to it")] = ""
    interface: Annotated[str, Meaning("where frames arrive, by name or address; empty: any")] = ""
    group: Annotated[str, Meaning("multicast address of the frames; empty: unicast to this computer")] = "239.255.42.99"
    port: Annotated[int, Bounds(1, 65535), Meaning("of the multicast frames", "UDP port")] = 1511
    command_port: Annotated[int, Bounds(1, 65535), Meaning("at which the server takes requests", "UDP port")] = 1510
    version: Annotated[str, Meaning("of the protocol, such as 4.1; empty: the server reports it")] = ""
    body: Annotated[str, Meaning("name of the rigid body; empty: chosen by body_id")] = ""
    body_id: Annotated[int, Bounds(0, 2**31 - 1), Meaning("streaming id of the rigid body; 0: the first one", "id")] = 0
    latency_s: Annotated[float, Bounds(0.0, 0.2), Meaning("of every frame, in addition to what the frame reports")] = (
        0.0
    )


def parse_axis(axis: object) -> Direction | None:
    """Return a unit vector from "x", "-z" or three numbers; None for anything else."""
    if isinstance(axis, str):
        direction = AXES.get(axis.removeprefix("-"))
        if direction is None or not axis.startswith("-"):
            return direction
        x, y, z = direction
        return -x, -y, -z
    if not isinstance(axis, list | tuple) or len(axis) != 3:
        return None
    if not all(isinstance(each, int | float) and not isinstance(each, bool) and abs(each) < 1e100 for each in axis):
        return None
    x, y, z = axis
    length = hypot(x, y, z)
    return (x / length, y / length, z / length) if length > 0.0 else None


def parse_version(text: str) -> NatNetVersion | None:
    """Return None for a text that is no version, and for unsupported versions."""
    major, dot, minor = text.partition(".")
    if not (dot and major.isdecimal() and minor.isdecimal() and len(text) < 8):
        return None
    version = NatNetVersion(int(major), int(minor))
    return version if OLDEST <= version <= NEWEST else None


class NatNetSockets:
    """Exchanges packets with the server. Owns the sockets of one client."""

    def __init__(self, parameters: NatNetParameters) -> None:
        """Open the sockets; raises OSError."""
        self._server = (parameters.server, parameters.command_port)
        self.opened: list[socket.socket] = []
        address = parameters.interface if is_address(parameters.interface) else ANY_ADDRESS
        try:
            if parameters.group:
                self.opened.append(_udp_socket(parameters.interface))
                _join(self.opened[0], parameters, address)
            if parameters.server:
                self.opened.append(_udp_socket(parameters.interface))
                self.opened[-1].bind((address, 0))
        except OSError:
            self.close()
            raise

    def packets(self) -> Iterator[tuple[bytes, str]]:
        """Yield the packets that have arrived, and the address of each sender."""
        for arriving in self.opened:
            for _ in range(MOST_PACKETS_PER_READ):
                try:
                    packet, sender = arriving.recvfrom(LONGEST_PACKET)
                except OSError:  # no more packets, or the network is down
                    break
                yield packet, str(sender[0])

    def request(self, message: int) -> None:
        """Send a request to the server. Without a network it is lost, and the caller repeats it later."""
        with suppress(OSError):
            self.opened[-1].sendto(encode_request(message), self._server)

    def close(self) -> None:
        for each in self.opened:
            each.close()


def _udp_socket(interface: str) -> socket.socket:
    """Open a socket that never waits, on the named interface; raises OSError."""
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.setblocking(False)
    if interface and not is_address(interface):
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, os.fsencode(interface))
    return opened


def _join(opened: socket.socket, parameters: NatNetParameters, address: str) -> None:
    """Bind a socket to the group's address, so it receives nothing else. Raises OSError."""
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # other programs of this computer may receive as well
    opened.bind((parameters.group, parameters.port))
    named = parameters.interface and not is_address(parameters.interface)
    index = socket.if_nametoindex(parameters.interface) if named else 0
    membership = pack("4s4si", socket.inet_aton(parameters.group), socket.inet_aton(address), index)
    opened.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)


def is_address(text: str) -> bool:
    """Return whether a text is an IPv4 address."""
    try:
        ipaddress.IPv4Address(text)
    except ValueError:
        return False
    return True
