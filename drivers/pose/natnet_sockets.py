"""The UDP sockets of a NatNet client: one that joins the group, where there is one, and one that asks the server.

Where the server does not multicast, it sends its frames to the one that asks. Nothing here waits.
"""

from __future__ import annotations

import ipaddress
import os
import socket
from collections.abc import Iterator
from contextlib import suppress
from struct import pack

from drivers.pose.natnet_codec import LONGEST_PACKET, encode_request
from drivers.pose.natnet_parameters import NatNetParameters

MOST_PACKETS_PER_READ = 16  # of each socket: a hundred bodies at 240 Hz are one in two ticks
ANY_ADDRESS = "0.0.0.0"


class NatNetSockets:
    """Owns the sockets."""

    def __init__(self, parameters: NatNetParameters) -> None:
        """Raises OSError."""
        self._server = (parameters.server, parameters.command_port)
        self._sockets: list[socket.socket] = []
        try:
            self._open(parameters)
        except OSError:
            self.close()
            raise

    def _open(self, parameters: NatNetParameters) -> None:
        if parameters.group:
            self._sockets.append(_join(parameters))
        if parameters.server:
            asking = _udp_socket(parameters.interface)
            self._sockets.append(asking)
            asking.bind((_address_of(parameters.interface), 0))

    def packets(self) -> Iterator[tuple[bytes, str]]:
        """What has arrived, and from which address."""
        for arriving in self._sockets:
            for _ in range(MOST_PACKETS_PER_READ):
                try:
                    packet, sender = arriving.recvfrom(LONGEST_PACKET)
                except OSError:  # there is no more, or the network went down
                    break
                yield packet, str(sender[0])

    def request(self, message: int) -> None:
        """From the server. Where there is no network for the moment it is asked again later."""
        with suppress(OSError):
            self._sockets[-1].sendto(encode_request(message), self._server)

    def close(self) -> None:
        for each in self._sockets:
            each.close()


def _udp_socket(interface: str) -> socket.socket:
    """Raises OSError."""
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.setblocking(False)
    if interface and not is_address(interface):
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, os.fsencode(interface))
    return opened


def _join(parameters: NatNetParameters) -> socket.socket:
    """Bound to the group's own address, so that nothing else is heard. Raises OSError."""
    opened = _udp_socket(parameters.interface)
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # others on this computer may listen as well
        opened.bind((parameters.group, parameters.port))
        address = socket.inet_aton(_address_of(parameters.interface))
        named = parameters.interface and not is_address(parameters.interface)
        index = socket.if_nametoindex(parameters.interface) if named else 0
        membership = pack("4s4si", socket.inet_aton(parameters.group), address, index)
        opened.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
    except OSError:
        opened.close()
        raise
    return opened


def _address_of(interface: str) -> str:
    return interface if is_address(interface) else ANY_ADDRESS


def is_address(text: str) -> bool:
    """Of four numbers."""
    try:
        ipaddress.IPv4Address(text)
    except ValueError:
        return False
    return True
