"""The transmit gate, the only path from the loop to the drives: it passes only the frames that its tables list.

Each drive has a table in the bytes of its protocol: payloads that may always leave (idle, the configured limits, the
reading of a parameter), payloads that may leave while the gate is open (following torque), and how a torque command is
decoded. Where all of them share one arbitration id, their payloads distinguish them. A torque must be finite, within
the limit, and within one slew step of the torque that left before for that drive; a torque towards zero is always
allowed. It must be exactly zero while the gate is closed, and where a torque command alone lets a drive follow torque,
none may leave then. Where a protocol rounds torques to coarse codes, a torque may exceed limit and slew by that
rounding. The gate examines the bytes as they leave, so it covers signs and encodings. control/limits.py enforces the
same limits earlier and more gently; this check is the last one and relies on nothing before it.

A refused frame is not sent. It is counted, and a message records the frame and the rule that it broke, since a refusal
always is a bug. In place of a refused torque the gate sends zero torque: the drive's watchdog stays fed and its motor
without torque, until the loop has seen the count grow and reacts. The slew then counts from that zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from control.parameters.joint_limits import JointLimits
from control.records import NEVER_S
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame

NOT_ARMED = "it may only leave while the drives are armed"
ROUNDING_NM = 1e-6  # binary32 rounds a torque of 5 N·m by less than a quarter of this


class FrameKind(NamedTuple):
    """The kind of all data frames of one protocol."""

    is_extended: bool = False
    is_fd: bool = False
    bit_rate_switch: bool = False


class GateTable(NamedTuple):
    """Everything that may leave for one drive. Payloads and checks are by arbitration id."""

    node_id: int
    torque_id: int  # of the frame that commands torque
    zero_torque: bytes  # its payload
    decode_torque: Callable[[bytes], float]  # in N·m; NaN for a payload that is not exactly one torque command
    always: Mapping[int, frozenset[bytes]]
    while_open: Mapping[int, frozenset[bytes]] = {}
    checks: Mapping[int, Callable[[bytes], bool]] = {}  # return whether a payload may leave that no set can list
    questions: frozenset[bytes] = frozenset()  # of those that may always leave under the torque's id: no command
    requests: frozenset[Frame] = frozenset()  # remote frames that may always leave
    kind: FrameKind = FrameKind()
    idle: bytes = b""  # replaces a torque while the gate is closed, where even zero torque ends a drive's idleness
    torque_step_nm: float = 0.0  # between two codes of torque, of which the nearest is sent


class TransmitGate:
    """Decides whether torque may leave; it is closed until it is opened. `refused` counts frames and only grows."""

    def __init__(self, limits: JointLimits) -> None:
        self.is_open = False
        self.refused = 0
        self.last_refusal = ""
        self._torque_rate_nm_s = limits.torque_rate_nm_s
        self._largest_nm = limits.torque_nm + ROUNDING_NM
        self._step_nm = 0.0
        self._outlets: list[GatedPort] = []

    def outlet(self, port: CanPort, tables: Iterable[GateTable]) -> GatedPort:
        """Make the path to one bus, for the drives on it."""
        outlet = GatedPort(self, port, tables)
        self._outlets.append(outlet)
        return outlet

    def open(self) -> None:
        """Let torque pass, for arming; the first torque counts from zero."""
        if not self.is_open:
            self.forget_torques()
        self.is_open = True

    def forget_torques(self) -> None:
        """Let the next torques count from zero: none has left for longer than any torque takes to grow."""
        for outlet in self._outlets:
            outlet.forget_torques()

    def close(self) -> None:
        """Let only zero torque pass."""
        self.is_open = False

    def allow_step(self, elapsed_s: float) -> None:
        """Set the largest step of the next torques: the slew rate times `elapsed_s`, the time since the last ones."""
        self._step_nm = self._torque_rate_nm_s * elapsed_s + ROUNDING_NM

    def torque_problem(self, torque_nm: float, before_nm: float, code_step_nm: float = 0.0) -> str:
        """Return why a torque may not follow the one before; empty where it may. NaN is beyond every bound.

        Both were rounded to codes that are `code_step_nm` apart: by half of it, or by all of it where a code is zero.
        """
        if torque_nm == 0.0:
            return ""
        if not self.is_open:
            return NOT_ARMED
        largest_nm, step_nm = self._largest_nm + 0.5 * code_step_nm, self._step_nm + 1.5 * code_step_nm
        if not -largest_nm <= torque_nm <= largest_nm:
            return f"it is no torque within the limit of {self._largest_nm:.4g} N·m"
        lowest_nm, highest_nm = before_nm - step_nm, before_nm + step_nm
        if (torque_nm < lowest_nm and torque_nm < 0.0) or (torque_nm > highest_nm and torque_nm > 0.0):
            return f"it is more than one step from the {before_nm:.4g} N·m before"
        return ""

    def refuse(self, message: str) -> None:
        self.refused += 1
        self.last_refusal = message


class GatedPort:
    """The gated path to one bus. Owns the torque that left last for each drive on it."""

    def __init__(self, gate: TransmitGate, port: CanPort, tables: Iterable[GateTable]) -> None:
        """Join the tables of the drives on one bus; raises ValueError where they want frames of different kinds."""
        self._gate = gate
        self._port = port
        self._tables = {table.torque_id: table for table in tables}
        self._sent_nm = dict.fromkeys(self._tables, 0.0)  # by the id of the torque frame
        self._always: dict[int, frozenset[bytes]] = {}
        self._while_open: dict[int, frozenset[bytes]] = {}
        self._checks: dict[int, Callable[[bytes], bool]] = {}
        self._requests: set[Frame] = set()
        for table in self._tables.values():
            for identifier, payloads in table.always.items():  # drives may share an id that addresses by payload
                self._always[identifier] = self._always.get(identifier, frozenset()) | payloads
            self._while_open.update(table.while_open)
            self._checks.update(table.checks)
            self._requests.update(table.requests)
        self._listed = self._always.keys() | self._while_open.keys() | self._checks.keys()
        (self._kind,) = {table.kind for table in self._tables.values()} or {FrameKind()}

    def forget_torques(self) -> None:
        for identifier in self._sent_nm:
            self._sent_nm[identifier] = 0.0

    def send(self, frame: Frame) -> None:
        identifier, data, is_remote, is_error, is_extended, _, is_fd, bit_rate_switch = frame
        if is_remote or is_error or (is_extended, is_fd, bit_rate_switch) != self._kind:
            passes = frame._replace(stamp_s=NEVER_S) in self._requests
        else:
            passes = identifier in self._listed and self._may_leave(identifier, data)
            if identifier in self._tables:
                if not passes:
                    self._send_torque(frame, self._tables[identifier])
                    return
                if data not in self._tables[identifier].questions:
                    self._sent_nm[identifier] = 0.0  # another command of the same id, after which no torque is known
        if passes:
            self._port.send(frame)
        else:
            self._gate.refuse(f"{_text_of(frame)} was not sent: {self._broken_rule(frame)}.")

    def _send_torque(self, frame: Frame, table: GateTable) -> None:
        identifier = table.torque_id
        torque_nm = table.decode_torque(frame.data)
        idle = b"" if self._gate.is_open else table.idle
        problem = (
            NOT_ARMED if idle else self._gate.torque_problem(torque_nm, self._sent_nm[identifier], table.torque_step_nm)
        )
        if problem:
            is_torque = torque_nm == torque_nm
            torque = f" ({torque_nm:.4g} N·m)" if is_torque else ""
            rule = problem if is_torque else "it is neither a listed frame nor a torque command"
            replacement = "the frame that keeps it idle" if idle else "zero torque"
            self._gate.refuse(
                f"{_text_of(frame)}{torque} to node {table.node_id} was replaced by {replacement}: {rule}."
            )
            torque_nm, frame = 0.0, frame._replace(data=idle or table.zero_torque)
        self._sent_nm[identifier] = torque_nm
        self._port.send(frame)

    def _broken_rule(self, frame: Frame) -> str:
        """Say why a frame that commands no torque may not leave."""
        if frame.is_remote:
            return "it is none of the requests that the tables of this bus list"
        if frame.is_error or (frame.is_extended, frame.is_fd, frame.bit_rate_switch) != self._kind:
            return "the drives of this bus take frames of another kind"
        if frame.arbitration_id not in self._listed:
            return "the tables of this bus do not list its id"
        if frame.data in self._while_open.get(frame.arbitration_id, ()):
            return NOT_ARMED
        return "the tables of this bus do not list its payload"

    def _may_leave(self, identifier: int, data: bytes) -> bool:
        if data in self._always.get(identifier, ()):
            return True
        if data in self._while_open.get(identifier, ()):
            return self._gate.is_open
        return identifier in self._checks and self._checks[identifier](data)


def _text_of(frame: Frame) -> str:
    kinds = (
        (frame.is_extended, "extended"),
        (frame.is_error, "error"),
        (frame.is_remote, "remote"),
        (frame.is_fd, "FD"),
        (frame.bit_rate_switch, "bit-rate-switch"),
    )
    marks = "".join(f" {kind}" for marked, kind in kinds if marked)
    return f"Frame 0x{frame.arbitration_id:03x}{marks} {frame.data.hex(' ')}".rstrip()
