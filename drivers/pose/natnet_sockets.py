"""The UDP sockets of a NatNet client: one joins the multicast group, if there is one, and one sends requests.

A server that does not multicast sends its frames to the socket that sent the requests. Nothing here waits.
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

MOST_PACKETS_PER_READ = 16  # of each socket; frames at 240 Hz are fewer than one in a tick
ANY_ADDRESS = "0.0.0.0"


class NatNetSockets:
    """Owns the sockets of one client."""

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
        """Yields the packets that have arrived, and the address of each sender."""
        for arriving in self._sockets:
            for _ in range(MOST_PACKETS_PER_READ):
                try:
                    packet, sender = arriving.recvfrom(LONGEST_PACKET)
                except OSError:  # no more packets, or the network is down
                    break
                yield packet, str(sender[0])

    def request(self, message: int) -> None:
        """Sends a request to the server. Without a network it is lost, and the caller repeats it later."""
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
    """Opens a socket bound to the group's address, so it receives nothing else. Raises OSError."""
    opened = _udp_socket(parameters.interface)
    try:
        # Other programs on this computer may receive as well.
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
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
    """Whether a text is an IPv4 address."""
    try:
        ipaddress.IPv4Address(text)
    except ValueError:
        return False
    return True
