"""The only way from the program to the drives' wires: what is not on its list does not pass.

The list: standard ids of the configured drives on their own bus, the messages that we use, and of each only payloads
that we would send: idle, the configured limits, torque mode, reading a parameter. A torque must be finite, within the
limit, and within one slew step of the one that left before for that drive; towards zero is always allowed. It must be
exactly zero while the gate is closed, and closed loop is asked for only through an open one. The bytes are judged, as
they leave, so signs and encodings are covered. Checks upstream make the same promises with better manners
(control/limits.py); this one is last and trusts nobody.

What is refused is not sent, but counted and remembered in a sentence, since it always is a bug. In place of a refused
torque zero is sent: the drive's watchdog stays fed and the drive without torque, until the loop has seen the count
grow and reacts. The slew then counts from that zero.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import nan
from struct import Struct

from control.limits import JointLimits
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from drivers.odrive import codec
from drivers.odrive.codec import AxisState, arbitration_id
from drivers.odrive.parameters import OdriveParameters

ROUNDING_NM = 1e-6  # binary32 holds 5 N·m to within a quarter of that
TORQUE = Struct("<f")
ZERO = codec.SET_INPUT_TORQUE.encode(0.0)
IDLE = codec.SET_AXIS_STATE.encode(AxisState.IDLE)
CLOSED_LOOP = codec.SET_AXIS_STATE.encode(AxisState.CLOSED_LOOP)
TORQUE_MODE = codec.SET_CONTROLLER_MODE.encode(codec.TORQUE_CONTROL, codec.PASSTHROUGH)
NO_IDENTIFYING = codec.CLEAR_ERRORS.encode(0)
READ_BYTES = 4  # of a request to read a parameter


class TransmitGate:
    """Owns whether torque may leave at all; closed until it is opened. `refused` only grows."""

    def __init__(self, limits: JointLimits) -> None:
        self.is_open = False
        self.refused = 0
        self.last_refusal = ""
        self._torque_rate_nm_s = limits.torque_rate_nm_s
        self._largest_nm = limits.torque_nm + ROUNDING_NM
        self._step_nm = 0.0
        self._outlets: list[GatedPort] = []

    def outlet(self, port: CanPort, drives: Iterable[OdriveParameters]) -> GatedPort:
        """The way to one bus, for the drives on it."""
        outlet = GatedPort(self, port, drives)
        self._outlets.append(outlet)
        return outlet

    def open(self) -> None:
        """For arming; the first torque counts from zero."""
        if not self.is_open:
            for outlet in self._outlets:
                outlet.forget_torques()
        self.is_open = True

    def close(self) -> None:
        """For anything else."""
        self.is_open = False

    def allow_step(self, elapsed_s: float) -> None:
        """A torque for each drive follows, `elapsed_s` after the one before."""
        self._step_nm = self._torque_rate_nm_s * elapsed_s + ROUNDING_NM

    def torque_problem(self, torque_nm: float, before_nm: float) -> str:
        """Why it may not follow the torque before; empty where it may. What is no number is beyond every bound."""
        if torque_nm == 0.0:
            return ""
        if not self.is_open:
            return "the drives are not armed"
        if not -self._largest_nm <= torque_nm <= self._largest_nm:
            return f"the limit is {self._largest_nm:.4g} N·m"
        if not min(before_nm - self._step_nm, 0.0) <= torque_nm <= max(before_nm + self._step_nm, 0.0):
            return f"too far from the {before_nm:.4g} N·m before"
        return ""

    def refuse(self, message: str) -> None:
        self.refused += 1
        self.last_refusal = message


class GatedPort:
    """One bus behind the gate. Owns the torque that left last for each drive on it."""

    def __init__(self, gate: TransmitGate, port: CanPort, drives: Iterable[OdriveParameters]) -> None:
        self._gate = gate
        self._port = port
        self._sent_nm: dict[int, float] = {}  # by the id of the torque message
        self._payloads: dict[int, frozenset[bytes]] = {}  # that may always pass
        self._arming: set[int] = set()  # ids of messages that may ask for closed loop
        self._reads: set[int] = set()  # ids of messages that read a parameter
        self._requests: set[int] = set()  # ids that may be asked for by remote frame
        for drive in drives:
            self._admit(drive)

    def _admit(self, drive: OdriveParameters) -> None:
        node_id = drive.node_id
        limits = codec.SET_LIMITS.encode(drive.velocity_limit_turn_s, drive.current_limit_a)
        gains = codec.SET_VEL_GAINS.encode(drive.velocity_gain_nm_s_turn, 0.0)
        self._sent_nm[arbitration_id(node_id, codec.SET_INPUT_TORQUE)] = 0.0
        self._payloads[arbitration_id(node_id, codec.SET_VEL_GAINS)] = frozenset({gains})
        self._payloads[arbitration_id(node_id, codec.SET_AXIS_STATE)] = frozenset({IDLE})
        self._payloads[arbitration_id(node_id, codec.SET_CONTROLLER_MODE)] = frozenset({TORQUE_MODE})
        self._payloads[arbitration_id(node_id, codec.SET_LIMITS)] = frozenset({limits})
        self._payloads[arbitration_id(node_id, codec.CLEAR_ERRORS)] = frozenset({NO_IDENTIFYING})
        self._arming.add(arbitration_id(node_id, codec.SET_AXIS_STATE))
        self._reads.add(arbitration_id(node_id, codec.RX_SDO))
        self._requests.add(arbitration_id(node_id, codec.GET_VERSION))

    def forget_torques(self) -> None:
        for identifier in self._sent_nm:
            self._sent_nm[identifier] = 0.0

    def send(self, frame: Frame) -> None:
        identifier, data, is_remote, is_error, is_extended, _ = frame
        if is_extended or is_error or is_remote:
            passes = self._is_request(frame)
        elif identifier in self._sent_nm:
            self._send_torque(frame, identifier, data)
            return
        else:
            passes = self._is_command(identifier, data)
        if passes:
            self._port.send(frame)
        else:
            self._gate.refuse(f"A frame that is not on the list was not sent: {_text_of(frame)}.")

    def _send_torque(self, frame: Frame, identifier: int, data: bytes) -> None:
        torque_nm: float = TORQUE.unpack(data)[0] if len(data) == TORQUE.size else nan
        problem = self._gate.torque_problem(torque_nm, self._sent_nm[identifier])
        if problem:
            self._gate.refuse(f"Node {identifier >> 5} got no torque in place of {torque_nm:.4g} N·m: {problem}.")
            torque_nm, frame = 0.0, Frame(identifier, ZERO)
        self._sent_nm[identifier] = torque_nm
        self._port.send(frame)

    def _is_request(self, frame: Frame) -> bool:
        known = frame.arbitration_id in self._requests and frame.data == b""
        return known and frame.is_remote and not frame.is_extended and not frame.is_error

    def _is_command(self, identifier: int, data: bytes) -> bool:
        if data in self._payloads.get(identifier, ()):
            return True
        if identifier in self._arming:
            return self._gate.is_open and data == CLOSED_LOOP
        return identifier in self._reads and _reads_parameter(data)


def _reads_parameter(data: bytes) -> bool:
    """Whatever its number: opcode and reserved byte are zero, and no value to write follows."""
    return len(data) == READ_BYTES and data[0] == codec.SDO_READ and data[3] == 0


def _text_of(frame: Frame) -> str:
    kinds = ((frame.is_extended, "extended"), (frame.is_error, "error"), (frame.is_remote, "remote"))
    marks = "".join(f" {kind}" for marked, kind in kinds if marked)
    return f"0x{frame.arbitration_id:03x}{marks} {frame.data.hex(' ')}".rstrip()
