"""A CAN port that fails on purpose, around one that does not.

What a drive tells may be lost, late, repeated or garbled here. What is sent to it may only be lost or late: a frame
that leaves is one that was sent, and those to one drive leave in their order, so no failure ever commands more than
the loop did, nor arms what it has disarmed. Drives are told apart by their node ids. Without a failure under way, a
frame costs one look at a dictionary.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Mapping, Sequence
from math import inf
from random import Random
from struct import Struct

from drivers.can.can_port import BusState, CanPort
from drivers.can.frames import DATA_MAX_BYTES, STANDARD_MASK, Frame
from drivers.drive import DriveParameters, DriveType
from drivers.drive_types import type_of
from drivers.fault_injection.delay_line import DelayLine
from drivers.fault_injection.failures import NO_NUMBERS, Failure, FailureKind, Failures

FAR_TURNS = 2.0  # garbage that might be true
MOST_STRANGERS = 3  # frames out of nowhere in one read of a bus full of garbage
SILENT = (FailureKind.OFF, FailureKind.BUS_OFF)
REFUSING = {
    FailureKind.OFF: os.strerror(errno.ENETDOWN),
    FailureKind.BUS_OFF: os.strerror(errno.ENETDOWN),
    FailureKind.STUCK: os.strerror(errno.ENOBUFS),
}
STATES = {
    FailureKind.WARNING: BusState.WARNING,
    FailureKind.PASSIVE: BusState.PASSIVE,
    FailureKind.BUS_OFF: BusState.OFF,
}
ONE_FLOAT = Struct("<f")


class FailingPort:
    """A CanPort. Owns what is late on its way, and the payloads that stand still."""

    def __init__(self, name: str, port: CanPort, drives: Mapping[str, DriveParameters], failures: Failures) -> None:
        self._bus = f"bus.{name}"
        self._port = port
        self._failures = failures
        self._drive_type: DriveType = type_of(drives.values())
        joints = {drive.node_id: joint for joint, drive in drives.items() if drive.bus == name}
        self._joints = joints
        self._listeners = {node_id: (self._bus, joint, f"{joint}.command") for node_id, joint in joints.items()}
        self._incoming, self._outgoing = DelayLine(_arbitration_id), DelayLine(self._node_id)
        self._frozen: dict[tuple[str, int], tuple[Failure, bytes]] = {}
        self._refused_sends = self._forged_error_frames = 0
        self.last_send_error = ""
        self._count()

    def _count(self) -> None:
        port, failure = self._port, self._failures.of(self._bus)
        self.failed_sends = port.failed_sends + self._refused_sends
        self.error_frames = port.error_frames + self._forged_error_frames
        self.lost_frames = port.lost_frames
        self.last_error = port.last_error if failure is None else f"failing on purpose, {failure.kind}"
        self.state = port.state if failure is None else max(port.state, STATES.get(failure.kind, BusState.ACTIVE))

    @property
    def _untouched(self) -> bool:
        return not (self._failures.failing or self._incoming.waiting or self._outgoing.waiting)

    def listen_to(self, ids: Iterable[int]) -> None:
        self._port.listen_to(ids)

    def receive(self) -> Sequence[Frame]:
        frames = self._port.receive()  # drained whatever fails: what comes meanwhile is lost, not kept
        if not self._untouched:
            self._deliver()
            frames = self._arrived(frames)
        self._count()
        return frames

    def _arrived(self, frames: Sequence[Frame]) -> list[Frame]:
        failures, failure = self._failures, self._failures.of(self._bus)
        arrived = [frame._replace(stamp_s=failures.now_s) for frame in self._incoming.take(self._due_s)]
        for frame in frames:
            spoiled = self._spoiled(frame)
            if spoiled is None:
                continue
            if not self._delays(spoiled, self._senders_of(spoiled), self._incoming):
                arrived.append(spoiled)
        if failure and failure.kind is FailureKind.GARBAGE:
            arrived += _strangers(failures.random)
        if failure and failure.kind in STATES:
            self._forged_error_frames += 1
        return arrived

    def _delays(self, frame: Frame, components: Sequence[str], line: DelayLine) -> bool:
        """Whether the frame is on its way now, as a late one or behind a late one."""
        failures = self._failures
        failing = (failures.of(component) for component in components)
        late = any(failure is not None and failure.kind is FailureKind.SLOW for failure in failing)
        if late or line.holds_back(frame):
            line.put(frame, failures.arrival_s() if late else failures.now_s)
            return True
        return False

    def _senders_of(self, frame: Frame) -> tuple[str, ...]:
        """Whose failures a frame from the bus suffers, in this order."""
        content = self._drive_type.read_frame(frame)
        joint = None if frame.is_extended else self._joints.get(content.node_id)
        if joint is None:
            return (self._bus,)
        return (self._bus, joint, *(f"{joint}.{signal}" for signal in content.signals))

    @property
    def _due_s(self) -> float:
        """Once nothing fails any more, what is still under way arrives at once."""
        return self._failures.now_s if self._failures.failing else inf

    def _spoiled(self, frame: Frame) -> Frame | None:
        """What is left of a frame from the bus."""
        for component in self._senders_of(frame):
            failure = self._failures.of(component)
            if failure is None:
                continue
            if component == self._bus:
                data = self._spoiled_by_bus(frame.data, failure)
            elif component.endswith(".error"):
                data = self._with_error(frame, failure)
            else:
                data = self._spoiled_by_drive(frame, failure)
            if data is None:
                return None
            frame = frame if data is frame.data else frame._replace(data=data)
        return frame

    def _spoiled_by_bus(self, data: bytes, failure: Failure) -> bytes | None:
        if failure.kind in SILENT or failure.kind is FailureKind.INTERMITTENT and self._failures.loses():
            return None
        if failure.kind is FailureKind.GARBAGE and self._failures.loses():
            return garbled(data, self._failures.random)
        return data

    def _spoiled_by_drive(self, frame: Frame, failure: Failure) -> bytes | None:
        if failure.kind is FailureKind.OFF or failure.kind is FailureKind.INTERMITTENT and self._failures.loses():
            return None
        if failure.kind is FailureKind.GARBAGE:
            return garbled(frame.data, self._failures.random)
        if failure.kind is FailureKind.STUCK:
            return self._first_since(failure, frame)
        return frame.data

    def _first_since(self, failure: Failure, frame: Frame) -> bytes:
        place = failure.component, frame.arbitration_id
        since, data = self._frozen.get(place, (None, b""))
        if since is not failure:
            data = frame.data
            self._frozen[place] = failure, data
        return data

    def _with_error(self, frame: Frame, failure: Failure) -> bytes:
        """A heartbeat or an error report that tells of trouble. One that is garbled already stays as it is."""
        kind = failure.kind
        if kind is FailureKind.INTERMITTENT and self._failures.loses():
            return frame.data
        flags = 0 if kind is FailureKind.OFF else self._drive_type.example_error
        if kind is FailureKind.GARBAGE:
            flags = self._failures.random.getrandbits(32) | 1
        return self._drive_type.with_error(frame, flags, idle=kind is not FailureKind.GARBAGE)

    def _node_id(self, frame: Frame) -> int:
        return self._drive_type.read_frame(frame).node_id

    def send(self, frame: Frame) -> None:
        if self._untouched:
            self._pass(frame)
        else:
            self._deliver()
            self._send_failing(frame)

    def _send_failing(self, frame: Frame) -> None:
        components = self._listeners.get(self._node_id(frame), (self._bus,))
        for component in components:
            failure = self._failures.of(component)
            if failure is None:
                continue
            if component == self._bus and failure.kind in REFUSING:
                return self._refuse(f"{REFUSING[failure.kind]} (on purpose)")
            if failure.kind is FailureKind.OFF or failure.kind is FailureKind.INTERMITTENT and self._failures.loses():
                return None
        return None if self._delays(frame, components, self._outgoing) else self._pass(frame)

    def _refuse(self, why: str) -> None:
        self._refused_sends += 1
        self.last_send_error = why
        self._count()

    def _deliver(self) -> None:
        for frame in self._outgoing.take(self._due_s):
            self._pass(frame)

    def _pass(self, frame: Frame) -> None:
        failed_before = self._port.failed_sends
        self._port.send(frame)
        if self._port.failed_sends != failed_before:
            self.last_send_error = self._port.last_send_error
            self._count()

    def close(self) -> None:
        self._port.close()


def failing_ports(
    ports: Mapping[str, CanPort], drives: Mapping[str, DriveParameters], failures: Failures | None
) -> Mapping[str, CanPort]:
    """The ports as they are, where nothing may fail."""
    if failures is None:
        return ports
    return {name: FailingPort(name, port, drives, failures) for name, port in ports.items()}


def garbled(data: bytes, random: Random) -> bytes:
    """Any bytes, numbers that might be true, numbers that are none or huge, or another length."""
    what = random.randrange(4)
    if what == 0:
        return random.randbytes(random.choice([size for size in range(DATA_MAX_BYTES + 1) if size != len(data)]))
    if what == 1:
        return random.randbytes(len(data))
    number = random.choice(NO_NUMBERS) if what == 2 else random.uniform(-FAR_TURNS, FAR_TURNS)
    return (2 * ONE_FLOAT.pack(number))[: len(data)]


def _strangers(random: Random) -> list[Frame]:
    return [
        Frame(random.randint(0, STANDARD_MASK), random.randbytes(random.randint(0, DATA_MAX_BYTES)))
        for _ in range(random.randint(0, MOST_STRANGERS))
    ]


def _arbitration_id(frame: Frame) -> int:
    return frame.arbitration_id
