"""What a robot that is not armed may send, by the type of its drives: nothing with which a motor could move.

These lists are stated here again, and not taken from the transmit gate's tables, which they test. They are narrower:
what only an operator's command would send is missing too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from drivers.can.frames import Frame, MalformedMessageError
from drivers.mit import codec as mit
from drivers.moteus import registers
from drivers.moteus.codec import Mode, command_id
from drivers.moteus.registers import Register
from drivers.odrive import codec as odrive
from drivers.odrive05 import codec as odrive05
from firmware_host.ticker import Tick
from simulation.harness.lockstep import Lockstep

ZERO_TORQUES = (bytes(4), bytes.fromhex("00000080"))
LEAVE = bytes.fromhex("fffffffffffffffd")
LARGEST_MIT_ID, LARGEST_MOTEUS_ID = 15, 126
HARMLESS_WRITE = (Register.MODE, Mode.STOPPED)


def is_harmless(frame: Frame, drive_type: str) -> bool:
    return not frame.is_error and HARMLESS[drive_type](frame)


def _is_zero_or_idle(frame: Frame) -> bool:
    """Firmware 0.5 and 0.6 share the two commands that a disarmed robot sends to an ODrive."""
    command = frame.arbitration_id & odrive.LAST_COMMAND
    if command == odrive.SET_INPUT_TORQUE.command:
        return frame.data in ZERO_TORQUES
    return command == odrive.SET_AXIS_STATE.command and frame.data == odrive.SET_AXIS_STATE.encode(
        odrive.AxisState.IDLE
    )


def _for_odrive(frame: Frame) -> bool:
    if frame.is_extended or frame.is_fd:
        return False
    command = frame.arbitration_id & odrive.LAST_COMMAND
    if frame.is_remote:
        return command == odrive.GET_VERSION.command
    return _is_zero_or_idle(frame) or command == odrive.RX_SDO.command and frame.data[:1] == b"\0"


def _for_odrive05(frame: Frame) -> bool:
    """An expired watchdog is cleared before it is proven."""
    if frame.is_extended or frame.is_fd:
        return False
    command = frame.arbitration_id & odrive.LAST_COMMAND
    if frame.is_remote:
        return command in (odrive.GET_VERSION.command, odrive05.GET_ENCODER_COUNT.command)
    return _is_zero_or_idle(frame) or command == odrive05.CLEAR_ERRORS.command and not frame.data


def _for_moteus(frame: Frame) -> bool:
    """A torque of zero is harmful, because it lets the drive follow torque."""
    if frame.is_remote or not (frame.is_extended and frame.is_fd):
        return False
    if not command_id(1) <= frame.arbitration_id <= command_id(LARGEST_MOTEUS_ID):
        return False
    try:
        subframes = list(registers.decode_frame(frame.data))
    except MalformedMessageError:
        return False
    return all(
        each.text.startswith(b"conf get ")
        if each.kind == registers.CONSOLE_INPUT
        else each.kind != registers.WRITE or (each.register, *each.values) == HARMLESS_WRITE
        for each in subframes
    )


def _for_mit(frame: Frame) -> bool:
    """No code is zero torque: nothing but leaving the mode, and reading a register."""
    if not frame.is_plain or len(frame.data) != mit.ANSWER_BYTES:
        return False
    if frame.arbitration_id == mit.REGISTER_ID:
        return frame.data[2] == mit.READ and not any(frame.data[4:])
    return 1 <= frame.arbitration_id <= LARGEST_MIT_ID and frame.data == LEAVE


HARMLESS: Mapping[str, Callable[[Frame], bool]] = {
    "odrive": _for_odrive,
    "odrive05": _for_odrive05,
    "moteus": _for_moteus,
    "mit": _for_mit,
}


class Observer:
    """Owns a third node on each bus of a robot, by which frames come in, and those of the loop are seen."""

    def __init__(self, robot: Lockstep) -> None:
        self._robot = robot
        self._nodes = [bus.open() for bus in robot.buses.values()]

    def tick(self, arriving: Sequence[Frame] = (), with_drives: bool = True) -> list[Frame]:
        """Run a tick in which these frames arrive; return those that the loop sends."""
        robot = self._robot
        for index, frame in enumerate(arriving):
            self._nodes[index % len(self._nodes)].send(frame)
        robot.tick_number += 1
        if with_drives:
            robot.robot.advance(robot.now_s)
        self._receive()
        robot.loop.tick(Tick(robot.now_s, 0.0, robot.tick_number, 0))
        return self._receive()

    def _receive(self) -> list[Frame]:
        return [frame for node in self._nodes for frame in node.receive()]
