"""A CAN port that injects failures into another one.

It may lose, delay, repeat or corrupt the frames of a drive. It may only lose or delay commands: every frame that leaves
was sent, and the frames to one drive leave in their order. So no failure commands more than the loop did, or arms a
drive that the loop has disarmed. Node ids distinguish the drives. Without an active failure a frame costs one check of
a dictionary.
"""

import errno
import os
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from math import inf
from random import Random
from struct import Struct

from drivers.can.can_port import CanPort
from drivers.can.frames import DATA_MAX_BYTES, STANDARD_MASK, Frame
from drivers.can.port_health import BusState
from drivers.drive import DriveParameters
from drivers.drive_type import FrameContent, Span
from drivers.drive_types import read_frame, type_of
from drivers.fault_injection.failure_table import FailureKind
from drivers.fault_injection.failures import NO_NUMBERS, Failure, Failures

NO_NODE = -1
SUPPLY = "supply"  # of all drives
FAR_TURNS = 2.0  # random values that look plausible
MOST_RANDOM_FRAMES = 3  # in one read of a bus full of garbage
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


class DelayLine:
    """Delays frames. A frame never overtakes another one with the same key."""

    def __init__(self, key: Callable[[Frame], Hashable]) -> None:
        self._key = key
        self.waiting: dict[Hashable, deque[tuple[float, Frame]]] = {}

    def put(self, frame: Frame, arrival_s: float) -> None:
        line = self.waiting.setdefault(self._key(frame), deque())
        line.append((max(arrival_s, line[-1][0]) if line else arrival_s, frame))

    def holds_back(self, frame: Frame) -> bool:
        return self._key(frame) in self.waiting

    def pop_arrived(self, now_s: float) -> list[Frame]:
        """Remove and return the frames that have arrived by now."""
        arrived: list[Frame] = []
        for key, line in list(self.waiting.items()):
            while line and line[0][0] <= now_s:
                arrived.append(line.popleft()[1])
            if not line:
                del self.waiting[key]
        return arrived


class FailingPort:
    """Wraps a CanPort. Owns the delayed frames and the frozen payloads."""

    def __init__(self, name: str, port: CanPort, drives: Mapping[str, DriveParameters], failures: Failures) -> None:
        self._bus = f"bus.{name}"
        self._port = port
        self._failures = failures
        self._drives = {joint: drive for joint, drive in drives.items() if drive.bus == name}
        joints = {drive.node_id: joint for joint, drive in self._drives.items()}
        self._joints = joints
        self._listeners = {node_id: (self._bus, joint, f"{joint}.command") for node_id, joint in joints.items()}
        self._incoming, self._outgoing = DelayLine(self._report), DelayLine(self._node_id)
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
        frames = self._port.receive()  # drained during any failure, so that frames of that time are lost and not kept
        if not self._untouched:
            self._deliver()
            frames = self._arrived(frames)
        self._count()
        return frames

    def _arrived(self, frames: Sequence[Frame]) -> list[Frame]:
        failures, failure = self._failures, self._failures.of(self._bus)
        random = failures.random
        arrived = [frame._replace(stamp_s=failures.now_s) for frame in self._incoming.pop_arrived(self._due_s)]
        for frame in frames:
            changed = self._after_failures(frame)
            if changed is None:
                continue
            if not self._delays(changed, self._senders_of(changed)[0], self._incoming):
                arrived.append(changed)
        if failure and failure.kind is FailureKind.GARBAGE:
            arrived += [
                Frame(random.randint(0, STANDARD_MASK), random.randbytes(random.randint(0, DATA_MAX_BYTES)))
                for _ in range(random.randint(0, MOST_RANDOM_FRAMES))
            ]
        if failure and failure.kind in STATES:
            self._forged_error_frames += 1
        return arrived

    def _delays(self, frame: Frame, components: Sequence[str], line: DelayLine) -> bool:
        """Delay the frame where its component is slow or an earlier frame waits; return whether it did."""
        failures = self._failures
        failing = (failures.of(component) for component in components)
        late = any(failure is not None and failure.kind is FailureKind.SLOW for failure in failing)
        if late or line.holds_back(frame):
            line.put(frame, failures.arrival_s() if late else failures.now_s)
            return True
        return False

    def _senders_of(self, frame: Frame) -> tuple[tuple[str, ...], FrameContent | None]:
        """Return the components whose failures change a frame from the bus, in this order, and its content."""
        content = self._content(frame)
        joint = self._joints.get(content.node_id) if content else None
        if content is None or joint is None:
            return (self._bus,), None
        return (self._bus, SUPPLY, joint, *(f"{joint}.{signal}" for signal in content.signals)), content

    def _report(self, frame: Frame) -> Hashable:
        """Return the id and what a drive reports under it: a Damiao's answers and registers have the same id."""
        content = self._content(frame)
        return frame.arbitration_id, content and content.signals

    def _content(self, frame: Frame) -> FrameContent | None:
        return read_frame(frame, self._drives.values())

    @property
    def _due_s(self) -> float:
        """The time up to which delayed frames arrive: without a failure all arrive at once."""
        return self._failures.now_s if self._failures.failing else inf

    def _after_failures(self, frame: Frame) -> Frame | None:
        """Return the frame as the active failures change it, or None where they lose it."""
        components, content = self._senders_of(frame)
        for component in components:
            failure = self._failures.of(component)
            if failure is None:
                continue
            joint, _, signal = component.partition(".")
            span = content.spans.get(signal) if content else None
            data: bytes | None
            if signal == "error":
                data = self._with_error(frame, failure, self._drives[joint])
            elif span is not None:
                data = self._with_failed_span(frame, failure, span)
            else:
                data = self._after_failure(frame, failure, of_bus=component == self._bus)
            if data is None:
                return None
            frame = frame if data is frame.data else frame._replace(data=data)
        return frame

    def _with_failed_span(self, frame: Frame, failure: Failure, span: Span) -> bytes | None:
        """Change one signal of a payload; return None where that loses the frame."""
        data, own = frame.data, frame._replace(data=frame.data[span.begin : span.end])
        changed = self._after_failure(own, failure, of_bus=False)
        if changed is None:
            changed = span.absent
        if changed is None:
            return None
        changed = changed.ljust(len(own.data), b"\0")[: len(own.data)]
        return data[: span.begin] + changed + data[span.end :]

    def _after_failure(self, frame: Frame, failure: Failure, of_bus: bool) -> bytes | None:
        """Return the changed payload, or None. A bus corrupts half of its frames, and a stuck one still hears."""
        if failure.kind in SILENT or failure.kind is FailureKind.INTERMITTENT and self._failures.loses():
            return None
        if failure.kind is FailureKind.GARBAGE and (not of_bus or self._failures.loses()):
            return corrupted(frame.data, self._failures.random)
        if failure.kind is FailureKind.STUCK and not of_bus:
            key = failure.component, frame.arbitration_id
            if self._frozen.get(key, (None,))[0] is not failure:
                self._frozen[key] = failure, frame.data
            return self._frozen[key][1]
        return frame.data

    def _with_error(self, frame: Frame, failure: Failure, drive: DriveParameters) -> bytes:
        """Add an error to a heartbeat or an error report; return one that is malformed already as it is."""
        kind = failure.kind
        if kind is FailureKind.INTERMITTENT and self._failures.loses():
            return frame.data
        drive_type = type_of(drive)
        flags = 0 if kind is FailureKind.OFF else drive_type.example_error
        if kind is FailureKind.GARBAGE:
            flags = self._failures.random.getrandbits(32) | 1
        return drive_type.with_error(frame, flags, idle=kind is not FailureKind.GARBAGE)

    def _node_id(self, frame: Frame) -> int:
        content = self._content(frame)
        return content.node_id if content else NO_NODE

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
                self._refused_sends += 1
                self.last_send_error = f"{REFUSING[failure.kind]} (on purpose)"
                self._count()
                return
            if failure.kind is FailureKind.OFF or failure.kind is FailureKind.INTERMITTENT and self._failures.loses():
                return
        if not self._delays(frame, components, self._outgoing):
            self._pass(frame)

    def _deliver(self) -> None:
        for frame in self._outgoing.pop_arrived(self._due_s):
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
    """Return the ports themselves where no failures may be injected."""
    if failures is None:
        return ports
    return {name: FailingPort(name, port, drives, failures) for name, port in ports.items()}


def corrupted(data: bytes, random: Random) -> bytes:
    """Draw random bytes, plausible numbers, numbers that are not finite or huge, or another length."""
    kind = random.randrange(4)
    if kind == 0:
        return random.randbytes(random.choice([size for size in range(DATA_MAX_BYTES + 1) if size != len(data)]))
    if kind == 1:
        return random.randbytes(len(data))
    number = random.choice(NO_NUMBERS) if kind == 2 else random.uniform(-FAR_TURNS, FAR_TURNS)
    return (2 * ONE_FLOAT.pack(number))[: len(data)]
