"""Receives the body's position from OptiTrack's motion capture: NatNet frames over UDP, multicast or unicast.

A multicast server sends its frames to a group that this client joins on one interface. A unicast server sends them to
each client that has asked to connect and keeps sending requests. The server reports which version of the protocol it
speaks; the configuration states it where requests do not reach the server. Nothing here waits: `receive` itself sends
requests once a second, and all of them where no position arrives: a server that was started later, or again, may speak
another version and have other bodies. It runs in the bridge's process (natnet_bridge.py), where a malformed or a large
packet cannot delay the loop.

A position is stamped with the time of its exposure as far as it is known. From version 3.0 on, frames contain the time
from the exposure to the sending, and the least recent delay gives the difference of the clocks (pose_timing.py). The
remaining constant delay, between sending and arriving or in a program that reports no times, is `latency_s`. A frame
brings no new position if its body is not tracked, or equals the previous one in every digit.
"""

from collections.abc import Iterator
from errno import EAFNOSUPPORT

from control.records import NEVER_S
from drivers.pose.natnet_codec import (
    CONNECT,
    FRAME,
    KEEP_ALIVE,
    MODEL,
    NEWEST,
    OLDEST,
    REQUEST_MODEL,
    SERVER_INFO,
    FrameLayout,
    MalformedPacketError,
    RigidBody,
    decode_bodies,
    decode_server_info,
    message_of,
)
from drivers.pose.natnet_sockets import Direction, NatNetParameters, NatNetSockets, parse_version
from drivers.pose.pose_port import STALE_S, PoseReport, PoseSourceError
from drivers.pose.pose_timing import LeastDelay

REQUEST_S = 1.0  # between requests; Motive forgets a client that is silent for several seconds
NO_NETWORK = "the service may use no network: add AF_INET to RestrictAddressFamilies= in its unit"


class NatNetClient:
    """Implements PositionStream. Owns the sockets, the server's reports, and what was seen last."""

    def __init__(self, parameters: NatNetParameters, direction: Direction) -> None:
        """Open the sockets; raises PoseSourceError. `direction` is that of x, a unit vector in the cameras' frame."""
        self.parameters = parameters
        self._direction = direction
        self.malformed = self.lost = 0
        self._unreadable = self._unseen = ""  # why frames cannot be decoded; why the last one brought no position
        try:
            self.sockets = NatNetSockets(parameters)
        except OSError as problem:
            why = NO_NETWORK if problem.errno == EAFNOSUPPORT else problem.strerror
            raise PoseSourceError(f"NatNet cannot be received {_source_text(parameters)}: {why}") from None
        configured = parse_version(parameters.version)
        self._layout = FrameLayout(configured) if configured else None
        self._version = configured
        self._ticks_per_s: int | None = None  # until the server has answered
        self._identity = parameters.body_id
        self._id_known = not parameters.body
        self._models_changed = False
        self._now_s = self._asked_s = self._heard_s = self._seen_s = NEVER_S
        self._other_s, self._other_sender = NEVER_S, ""  # the last packet of another sender than the server
        self._body: RigidBody | None = None
        self._delay = LeastDelay()

    def receive(self, now_s: float) -> Iterator[tuple[float, float]]:
        """Yield the positions that have arrived, oldest first: the time of exposure, and metres along the direction.

        Requests are sent where they are due.
        """
        self._now_s = now_s
        if self.parameters.server and now_s - self._asked_s >= REQUEST_S:
            self._asked_s = now_s
            unanswered = self._ticks_per_s is None or now_s - self._seen_s > REQUEST_S
            self.sockets.request(CONNECT if unanswered else KEEP_ALIVE)
            if self.parameters.body and (self._models_changed or unanswered):
                self._models_changed = False
                self.sockets.request(REQUEST_MODEL)
        for packet, sender in self.sockets.packets():
            if self.parameters.server and sender != self.parameters.server:
                self.malformed += 1
                self._other_s, self._other_sender = now_s, sender
                continue
            try:
                yield from self._on_message(packet, now_s)
            except MalformedPacketError:
                self.malformed += 1

    def _on_message(self, packet: bytes, now_s: float) -> Iterator[tuple[float, float]]:
        """Handle a packet of the server; raises MalformedPacketError."""
        message = message_of(packet)
        if message == FRAME:
            self._heard_s = now_s
            if self._layout is not None and self._id_known:
                yield from self._on_frame(packet, now_s, self._layout)
        elif message == SERVER_INFO:
            self._on_server_info(packet)
        elif message == MODEL and self._version is not None:
            bodies = decode_bodies(packet, self._version)
            self._id_known = not self.parameters.body or self.parameters.body in bodies
            self._identity = bodies.get(self.parameters.body, self.parameters.body_id)

    def _on_server_info(self, packet: bytes) -> None:
        reported = decode_server_info(packet)
        self._ticks_per_s = reported.ticks_per_s
        if self.parameters.version:
            return
        readable = OLDEST <= reported.version <= NEWEST
        self._unreadable = "" if readable else f"{reported.name or 'the server'} speaks NatNet {reported.version}"
        if reported.version != self._version:
            self._version = reported.version
            self._layout = FrameLayout(reported.version) if readable else None
            self._delay.reset()

    def _on_frame(self, packet: bytes, now_s: float, layout: FrameLayout) -> Iterator[tuple[float, float]]:
        frame = layout.decode_frame(packet, self._identity)
        self._models_changed = self._models_changed or frame.models_changed
        body = frame.body
        if body is None or not body.tracked:
            self._unseen = "motion capture does not see the body."
        elif self._body is not None and body[1:3] == self._body[1:3]:
            self._unseen = "motion capture sends the same pose again and again: it is frozen."
        else:
            self._unseen = ""
        if body is None or self._unseen:
            self.lost += 1
            return
        self._body, self._seen_s = body, now_s
        exposed_s = sent_s = frame.software_s
        if frame.sent_ticks and self._ticks_per_s:
            exposed_s, sent_s = frame.exposed_ticks / self._ticks_per_s, frame.sent_ticks / self._ticks_per_s
        (x_m, y_m, z_m), (a, b, c) = body.position_m, self._direction
        stamp_s = exposed_s + self._delay.update(now_s, sent_s) - self.parameters.latency_s
        yield min(stamp_s, now_s), a * x_m + b * y_m + c * z_m

    def report(self) -> PoseReport:
        version = f" {self._version}" if self._version else ""
        trouble, what_to_do = ("", "") if self._now_s - self._seen_s <= STALE_S else self._trouble()
        return PoseReport(
            source=f"NatNet{version} {_source_text(self.parameters)}",
            malformed=self.malformed,
            lost=self.lost,
            trouble=trouble,
            what_to_do=what_to_do,
        )

    def _trouble(self) -> tuple[str, str]:
        """Return why no position arrives, and what to do about it."""
        parameters = self.parameters
        if self._unreadable:
            return (
                f"{self._unreadable}; 2.6 to 4 are supported.",
                "choose an older version in its streaming settings, and set pose.natnet.version to that",
            )
        if self._now_s - self._heard_s > STALE_S:
            if self._now_s - self._other_s <= STALE_S:
                return (
                    f"packets arrive from {self._other_sender}, and none from {parameters.server}.",
                    "set pose.natnet.server to the address that motion capture sends from (its local interface)",
                )
            return (
                f"no NatNet frame arrives {_source_text(parameters)}.",
                "check that motion capture streams to this computer, and that no firewall or IPAddressDeny= blocks it",
            )
        if self._layout is None:
            return (
                f"frames arrive, but {parameters.server} does not report their version.",
                "check pose.natnet.server and command_port, or set pose.natnet.version",
            )
        if not self._id_known:
            return f"there is no rigid body named {parameters.body!r}.", "check pose.natnet.body against its name there"
        if self._unseen:
            return self._unseen, "check its markers, the cameras' view, and pose.natnet.body or body_id"
        return "all NatNet frames are malformed.", "check pose.natnet.version against the version that is streamed"

    def close(self) -> None:
        self.sockets.close()


def _source_text(parameters: NatNetParameters) -> str:
    """Name where the frames come from, for people."""
    by = f"in group {parameters.group}, port {parameters.port}" if parameters.group else f"from {parameters.server}"
    return f"{by} on {parameters.interface}" if parameters.interface else by
