"""A motion-capture program with a NatNet server: it answers on its command port and plays recorded poses.

Frames have the layout that drivers/pose/natnet_codec.py describes; only the message kinds and the version record come
from there. Around the rigid body a frame may hold other tracked objects, as in a laboratory. A client that asks to
connect receives the version and the rate of the server's clock, and the frames from then on; a fixed address, such as
a multicast group, receives frames from the start. The owner of a server calls `step` with the time, so a recording
plays at any speed.
"""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from struct import pack
from typing import NamedTuple

from drivers.pose.natnet_codec import CONNECT, FRAME, MODEL, MODELS_CHANGED, REQUEST_MODEL, SERVER_INFO, NatNetVersion

TICKS_PER_S = 10_000_000  # of Windows's performance counter
CLOCK_AHEAD_S = 1000.0  # the server's own clock minus the time given to `step`
NEWEST_VERSION = NatNetVersion(4, 1)
LOOPBACK = "127.0.0.1"
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
Address = tuple[str, int]


class RecordedPose(NamedTuple):
    time_s: float  # of the exposure
    position_m: tuple[float, float, float]
    quaternion: tuple[float, float, float, float] = UPRIGHT  # x, y, z, w
    tracked: bool = True


class FrameTimes(NamedTuple):
    software_s: float
    exposed_ticks: int
    received_ticks: int
    sent_ticks: int


def encode_message(kind: int, payload: bytes) -> bytes:
    return pack("<HH", kind, len(payload)) + payload


def encode_server_info(version: NatNetVersion) -> bytes:
    payload = b"Motive".ljust(256, b"\0") + pack("<4B4B", 3, 1, 0, 0, version.major, version.minor, 0, 0)
    if version >= (3, 0):
        payload += pack("<QHB4s", TICKS_PER_S, 1511, False, bytes(4))  # not to a multicast group
    return encode_message(SERVER_INFO, payload)


def encode_rigid_body(version: NatNetVersion, identity: int, pose: RecordedPose) -> bytes:
    markers = (
        b"" if version >= (3, 0) else pack("<I", 2) + pack("<6f", *[0.5] * 6) + pack("<2I", 1, 2) + pack("<2f", 1, 1)
    )
    return pack("<i7f", identity, *pose.position_m, *pose.quaternion) + markers + pack("<fH", 2e-4, int(pose.tracked))


def encode_frame(
    version: NatNetVersion,
    number: int,
    bodies: Iterable[bytes],
    times: FrameTimes,
    crowded: bool = False,
    models_changed: bool = False,
) -> bytes:
    """`bodies`: from encode_rigid_body; `crowded`: adds a skeleton, markers, force plates and devices."""
    payload = pack("<i", number)
    for elements in _sections(version, list(bodies), crowded):
        content = b"".join(elements)
        payload += pack("<i", len(elements)) + (pack("<i", len(content)) if version >= (4, 1) else b"") + content
    return encode_message(FRAME, payload + _frame_end(version, times, models_changed))


def _sections(version: NatNetVersion, bodies: list[bytes], crowded: bool) -> list[list[bytes]]:
    """Return the sections that frames of this version have."""
    bone = encode_rigid_body(version, 65537, RecordedPose(0.0, (9.0, 9.0, 9.0)))
    labelled = pack("<i4f", 7, 1.0, 2.0, 3.0, 0.01) + pack("<H", 2) + (pack("<f", 1e-4) if version >= (3, 0) else b"")
    asset = (
        pack("<ii", 1, 1)
        + pack("<i7ffH", 5, *[0.0] * 7, 0.0, 1)
        + pack("<i", 1)
        + pack("<i3ffHf", 1, *[0.0] * 4, 0, 0.0)
    )
    channels = pack("<ii", 3, 2) + pack("<i3f", 3, 0.1, 0.2, 0.3) + pack("<i", 0)
    sections: list[tuple[bool, list[bytes]]] = [
        (True, [b"all\0" + pack("<i6f", 2, *[0.25] * 6), b"robot\0" + pack("<i", 0)] if crowded else []),
        (True, [pack("<3f", 1.0, 2.0, 3.0)] * 3 if crowded else []),
        (True, bodies),
        (True, [pack("<ii", 1, 2) + 2 * bone] if crowded else []),
        (version >= (4, 1), [asset] if crowded else []),
        (True, [labelled] * 4 if crowded else []),
        (version >= (2, 9), [channels] * 2 if crowded else []),
        (version >= (2, 11), [channels] if crowded else []),
    ]
    return [elements for is_there, elements in sections if is_there]


def _frame_end(version: NatNetVersion, times: FrameTimes, models_changed: bool) -> bytes:
    end = pack("<II", 0, 0) + pack("<d" if version >= (2, 7) else "<f", times.software_s)
    if version >= (3, 0):
        end += pack("<QQQ", times.exposed_ticks, times.received_ticks, times.sent_ticks)
    if version >= (4, 1):
        end += pack("<II", 0, 0)
    return end + pack("<Hi", MODELS_CHANGED if models_changed else 0, 0)


def encode_models(version: NatNetVersion, bodies: Iterable[tuple[str, int]]) -> bytes:
    """Encode a marker set, then rigid bodies by name and streaming id, each with one marker."""
    described = [(0, b"all\0" + pack("<i", 1) + b"Marker 1\0")]
    for name, identity in bodies:
        body = name.encode() + b"\0" + pack("<ii3f", identity, -1, 0.0, 0.0, 0.0)
        body += pack("<4f", *UPRIGHT) if version >= (4, 2) else b""
        body += pack("<i3fi", 1, 0.1, 0.1, 0.1, 0) if version >= (3, 0) else b""
        described.append((1, body + (b"Marker 1\0" if version >= (4, 0) else b"")))
    payload = pack("<i", len(described))
    for kind, description in described:
        payload += pack("<i", kind) + (pack("<i", len(description)) if version >= (4, 1) else b"") + description
    return encode_message(MODEL, payload)


class NatNetServer:
    """Owns the command port, the connected clients, and the poses to send."""

    def __init__(
        self,
        poses: Iterable[RecordedPose] = (),
        version: NatNetVersion = NEWEST_VERSION,
        latency_s: float = 0.0,  # from an exposure until its frame is sent
        target: Address | None = None,  # gets all frames, without asking
        address: Address = (LOOPBACK, 0),
        identity: int = 1,
        name: str = "mudskipper",
        crowded: bool = False,
    ) -> None:
        self.version, self.latency_s, self.crowded = version, latency_s, crowded
        self.identity, self.name = identity, name
        self.answers = True  # a network may let nothing but frames through
        self._poses = deque(poses)
        self._has_target = target is not None
        self._clients: list[Address] = [target] if target else []
        self._number = 0
        self._models_changed = False
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(address[0]))
        self._socket.bind(address)
        self.address: Address = self._socket.getsockname()

    def add(self, pose: RecordedPose) -> None:
        """Queue a pose, to be sent when it is due."""
        self._poses.append(pose)

    def change_model(self, identity: int) -> None:
        """Give the body another streaming id, which the next frame announces."""
        self.identity, self._models_changed = identity, True

    def step(self, now_s: float) -> int:
        """Answer requests and send the frames that are due; return the number of frames."""
        self._answer()
        sent = 0
        while self._poses and self._poses[0].time_s + self.latency_s <= now_s:
            self._send(self._poses.popleft())
            sent += 1
        return sent

    def _send(self, pose: RecordedPose) -> None:
        self._number += 1
        exposed_s = pose.time_s + CLOCK_AHEAD_S
        sent_ticks = round((exposed_s + self.latency_s) * TICKS_PER_S)
        times = FrameTimes(exposed_s, round(exposed_s * TICKS_PER_S), sent_ticks, sent_ticks)
        body = encode_rigid_body(self.version, self.identity, pose)
        changed, self._models_changed = self._models_changed, False
        self.send_packet(encode_frame(self.version, self._number, [body], times, self.crowded, changed))

    def send_packet(self, packet: bytes) -> None:
        """Send to all clients. A packet that a client does not take is lost, as on any network."""
        for client in self._clients:
            with suppress(ConnectionRefusedError, BlockingIOError):
                self._socket.sendto(packet, client)

    def _answer(self) -> None:
        while True:
            try:
                request, client = self._socket.recvfrom(2048)
            except BlockingIOError:
                return
            except ConnectionRefusedError:  # a client that is gone
                continue
            if self.answers:
                self._answer_one(int.from_bytes(request[:2], "little"), client)

    def _answer_one(self, message: int, client: Address) -> None:
        if message == CONNECT:
            if client not in self._clients and not self._has_target:
                self._clients.append(client)
            self._socket.sendto(encode_server_info(self.version), client)
        elif message == REQUEST_MODEL:
            self._socket.sendto(encode_models(self.version, [("other", 99), (self.name, self.identity)]), client)

    def close(self) -> None:
        self._socket.close()

    def __enter__(self) -> NatNetServer:
        return self

    def __exit__(self, *problem: object) -> None:
        self.close()
