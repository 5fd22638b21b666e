"""The body's pose from OptiTrack's motion capture: NatNet frames over UDP, multicast or to this computer alone.

A server that multicasts sends its frames to a group that this port joins on one interface; one that does not sends
them to whoever asked to connect and keeps saying that it is there. Which version of the protocol it speaks is asked
from it, or configured where requests do not get through. Nothing here waits: requests are sent once a second by the
reading itself, until they are answered.

A place is stamped with the moment of its exposure, as far as that can be known: from version 3.0 on the frames tell how
long ago their cameras' shutters were open when they were sent, and the quickest frame of late tells the difference
of the clocks. What always passes on top of it, between sending and arriving or in a program that tells nothing, is
`latency_s`. A frame in which the body is not tracked, or holds every digit of the one before, is no new pose; and after
a long gap or a leap the first is not believed before a second one follows: capture that is lost shows old places.
"""

from __future__ import annotations

import ipaddress
import os
import socket
from dataclasses import dataclass
from errno import EAFNOSUPPORT
from struct import pack
from typing import Annotated

from control.bounds import Bounds
from control.records import NEVER_S, BodyPose
from drivers.natnet_codec import (
    CONNECT,
    FRAME,
    KEEP_ALIVE,
    LONGEST_PACKET,
    MODEL,
    NEWEST,
    OLDEST,
    REQUEST_MODEL,
    SERVER_INFO,
    FrameLayout,
    GarbledPacketError,
    NatNetVersion,
    RigidBody,
    decode_server_info,
    encode_request,
    message_of,
)
from drivers.natnet_models import decode_bodies
from drivers.pose_port import STALE_S, PoseReport, PoseSourceError
from drivers.pose_timing import LeastDelay, PoseForecast
from drivers.track_axis import Direction

MOST_PACKETS_PER_READ = 16  # of each socket: a hundred bodies at 240 Hz are one in two ticks
DOUBTED_S = 0.5  # a pose after so long a gap is believed when a second one follows
REQUEST_S = 1.0  # between requests; Motive forgets a client that is silent for several seconds
NO_NETWORK = "the service may use no network: add AF_INET to RestrictAddressFamilies= in its unit"
ANY_ADDRESS = "0.0.0.0"


@dataclass(frozen=True)
class NatNetParameters:
    server: str = ""  # address of the computer that runs the motion capture; empty: nothing is asked from it
    interface: str = ""  # on which frames arrive, by name or address; empty: any
    group: str = "239.255.42.99"  # that the server multicasts to; empty: it sends to this computer alone
    port: Annotated[int, Bounds(1, 65535)] = 1511  # of the multicast frames
    command_port: Annotated[int, Bounds(1, 65535)] = 1510  # at which the server takes requests
    version: str = ""  # of the protocol, such as "4.1"; empty: the server tells it
    body: str = ""  # name of the rigid body; empty: by its id
    body_id: Annotated[int, Bounds(0, 2**31 - 1)] = 0  # its streaming id; 0: the first one
    latency_s: Annotated[float, Bounds(0.0, 0.2)] = 0.0  # of every frame, besides what it tells itself


def parse_version(text: str) -> NatNetVersion | None:
    """None for what is no version that is read here."""
    major, dot, minor = text.partition(".")
    if not (dot and major.isdecimal() and minor.isdecimal() and len(text) < 8):
        return None
    version = NatNetVersion(int(major), int(minor))
    return version if OLDEST <= version <= NEWEST else None


class NatNetPort:
    """A PoseSource. Owns the sockets, what the server has told, and the places of late."""

    def __init__(self, parameters: NatNetParameters, direction: Direction, origin_m: float = 0.0) -> None:
        """x is the position along `direction`, a unit vector in the cameras' frame. Raises PoseSourceError."""
        self.parameters = parameters
        self._direction, self._origin_m = direction, origin_m
        self._sockets: list[socket.socket] = []
        self.poses = self.garbled = self.lost = 0
        self._told = self._unseen = ""  # why the server's frames cannot be read; why the last one brought no pose
        self.reset()
        try:
            self._open()
        except OSError as problem:
            self.close()
            why = NO_NETWORK if problem.errno == EAFNOSUPPORT else problem.strerror
            raise PoseSourceError(f"NatNet cannot be received {_place(parameters)}: {why}") from None

    def reset(self) -> None:
        configured = parse_version(self.parameters.version)
        self._layout = FrameLayout(configured) if configured else None
        self._version = configured
        self._ticks_per_s = 0
        self._identity = self.parameters.body_id
        self._named = not self.parameters.body  # whether the id is known
        self._models_changed = False
        self._now_s = self._asked_s = self._heard_s = self._seen_s = self._taken_s = NEVER_S
        self._strangers_s, self._stranger = NEVER_S, ""  # who sends and is not the server
        self._body: RigidBody | None = None
        self._delay, self._forecast = LeastDelay(), PoseForecast()
        self._stamp_s = NEVER_S

    def _open(self) -> None:
        parameters = self.parameters
        if parameters.group:
            self._sockets.append(_join(parameters))
        if parameters.server:
            asking = _udp_socket(parameters.interface)
            self._sockets.append(asking)
            asking.bind((_address_of(parameters.interface), 0))

    def read(self, now_s: float) -> BodyPose:
        self._now_s = now_s
        if self.parameters.server and now_s - self._asked_s >= REQUEST_S:
            self._asked_s = now_s
            self._ask(now_s)
        for each in self._sockets:
            self._drain(each, now_s)
        if now_s - self._taken_s > STALE_S:
            return BodyPose()
        return BodyPose(self._stamp_s, self._forecast.at(now_s) - self._origin_m)

    def _ask(self, now_s: float) -> None:
        silent = now_s - self._heard_s > REQUEST_S
        self._request(CONNECT if self._version is None or silent else KEEP_ALIVE)
        if self.parameters.body and (self._models_changed or not self._named):
            self._models_changed = False
            self._request(REQUEST_MODEL)

    def _request(self, message: int) -> None:
        try:
            self._sockets[-1].sendto(encode_request(message), (self.parameters.server, self.parameters.command_port))
        except OSError:  # no network for the moment: it is asked again
            return

    def _drain(self, arriving: socket.socket, now_s: float) -> None:
        for _ in range(MOST_PACKETS_PER_READ):
            try:
                packet, sender = arriving.recvfrom(LONGEST_PACKET)
            except OSError:  # there is no more, or the network went down
                return
            if self.parameters.server and sender[0] != self.parameters.server:
                self.garbled += 1
                self._strangers_s, self._stranger = now_s, str(sender[0])
                continue
            try:
                self._take(packet, now_s)
            except GarbledPacketError:
                self.garbled += 1

    def _take(self, packet: bytes, now_s: float) -> None:
        """Raises GarbledPacketError."""
        message = message_of(packet)
        if message == FRAME:
            self._heard_s = now_s
            if self._layout is not None and self._named:
                self._take_frame(packet, now_s, self._layout)
        elif message == SERVER_INFO:
            self._take_server_info(packet)
        elif message == MODEL and self._version is not None:
            bodies = decode_bodies(packet, self._version)
            self._named = not self.parameters.body or self.parameters.body in bodies
            self._identity = bodies.get(self.parameters.body, self.parameters.body_id)

    def _take_server_info(self, packet: bytes) -> None:
        told = decode_server_info(packet)
        self._ticks_per_s = told.ticks_per_s
        if self.parameters.version:
            return
        readable = OLDEST <= told.version <= NEWEST
        self._told = "" if readable else f"{told.name or 'the server'} speaks NatNet {told.version}"
        if told.version != self._version:
            self._version = told.version
            self._layout = FrameLayout(told.version) if readable else None
            self._delay.reset()

    def _take_frame(self, packet: bytes, now_s: float, layout: FrameLayout) -> None:
        frame = layout.decode_frame(packet, self._identity)
        self._models_changed = self._models_changed or frame.models_changed
        body = frame.body
        if body is None or not body.tracked:
            self.lost += 1
            self._unseen = "motion capture does not see the body."
        elif self._body is not None and body[1:3] == self._body[1:3]:
            self.lost += 1
            self._unseen = "motion capture sends the same pose again and again: it is frozen."
        else:
            self._body = body
            exposed_s = sent_s = frame.software_s
            if frame.sent_ticks and self._ticks_per_s:
                exposed_s, sent_s = frame.exposed_ticks / self._ticks_per_s, frame.sent_ticks / self._ticks_per_s
            self._take_pose(body, exposed_s, sent_s, now_s)

    def _take_pose(self, body: RigidBody, exposed_s: float, sent_s: float, now_s: float) -> None:
        (x_m, y_m, z_m), (a, b, c) = body.position_m, self._direction
        place_m = a * x_m + b * y_m + c * z_m
        self._stamp_s = min(exposed_s + self._delay.update(now_s, sent_s) - self.parameters.latency_s, now_s)
        follows = self._forecast.add(self._stamp_s, place_m) and now_s - self._seen_s <= DOUBTED_S
        self._seen_s = now_s
        self._taken_s = now_s if follows else NEVER_S
        self.poses += follows
        if not follows:
            self.lost += 1
            self._unseen = "motion capture's poses leap, or come seconds apart."

    def report(self) -> PoseReport:
        version = f" {self._version}" if self._version else ""
        report = PoseReport(f"NatNet{version} {_place(self.parameters)}", self.poses, self.garbled, self.lost)
        if self._now_s - self._taken_s <= STALE_S:
            return report
        trouble, what_to_do = self._trouble()
        return report._replace(trouble=trouble, what_to_do=what_to_do)

    def _trouble(self) -> tuple[str, str]:
        """Why no pose comes, and what to do about it."""
        parameters = self.parameters
        if self._told:
            return (
                f"{self._told}; 2.6 to 4 are read here.",
                "choose an older version in its streaming settings, and set pose.natnet.version to that",
            )
        if self._now_s - self._heard_s > STALE_S:
            if self._now_s - self._strangers_s <= STALE_S:
                return (
                    f"packets come from {self._stranger}, and none from {parameters.server}.",
                    "set pose.natnet.server to the address that motion capture sends from (its local interface)",
                )
            return (
                f"no NatNet frame comes {_place(parameters)}.",
                "check that motion capture streams to here, and no firewall or IPAddressDeny= is between",
            )
        if self._layout is None:
            return (
                f"frames come, but {parameters.server} does not tell their version.",
                "check pose.natnet.server and command_port, or set pose.natnet.version",
            )
        if not self._named:
            return f"there is no rigid body named {parameters.body!r}.", "check pose.natnet.body against its name there"
        if self._unseen:
            return self._unseen, "check its markers, the cameras' view, and pose.natnet.body or body_id"
        return "all NatNet frames are garbled.", "check pose.natnet.version against the version that is streamed"

    def reopen(self, now_s: float) -> bool:
        return False  # a socket lives on without its network

    def close(self) -> None:
        for each in self._sockets:
            each.close()


def _place(parameters: NatNetParameters) -> str:
    by = f"in group {parameters.group}, port {parameters.port}" if parameters.group else f"from {parameters.server}"
    return f"{by} on {parameters.interface}" if parameters.interface else by


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
