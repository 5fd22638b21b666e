"""ODrive CANSimple, firmware 0.5.6: the bytes of the messages that differ from those of 0.6.

Ids, axis states, commands of torque, and the reports of motion, current and supply are those of drivers/odrive. The
heartbeat contains an error word of the axis and one flag each for errors of motor, encoder and controller, whose words
are messages of their own. There is no version, no temperature, no serial number and no reading of parameters. Sources:
can_simple.cpp and odrive-interface.yaml of odriverobotics/ODrive, tag fw-v0.5.6, and the DBC that is published with it.
Where those two differ, the firmware counts: the DBC has 32 of the motor's 64 error flags, and unsigned counts.
"""

from drivers.odrive.codec import Message, error_text

HEARTBEAT: Message = Message(0x01, "<I4B")  # axis error, axis state; bit 0 of each: motor, encoder, controller error
GET_MOTOR_ERROR = Message(0x03, "<Q")
GET_ENCODER_ERROR = Message(0x04, "<I4x")
GET_ENCODER_COUNT = Message(0x0A, "<ii")  # counts since power-on, and within one turn
CLEAR_ERRORS = Message(0x18, "<")  # of both axes of the board
GET_CONTROLLER_ERROR = Message(0x1D, "<I4x")

# Everything that a drive obeys: besides those of this program a node id, positions and velocities, their limits and
# gains, calibration of cogging, reboot, and a new angle.
COMMANDS = frozenset((0x02, 0x06, 0x07, *range(0x0B, 0x14), 0x16, 0x18, 0x19, 0x1A, 0x1B))
PART_FLAG = 0x01  # in the last three bytes of a heartbeat
TRAJECTORY_DONE = 0x80  # in the last byte

# Flags of the axis error (Axis.Error). The error of a part sets that part's flag, but not in every case.
ERROR_MOTOR = 0x40
ERROR_ENCODER = 0x100
ERROR_CONTROLLER = 0x200
ERROR_WATCHDOG = 0x800
ERROR_ESTOP = 0x4000

AXIS_ERRORS = {
    0x1: "invalid state",
    ERROR_MOTOR: "motor failed",
    0x80: "sensorless estimator failed",
    ERROR_ENCODER: "encoder failed",
    ERROR_CONTROLLER: "controller failed",
    ERROR_WATCHDOG: "watchdog expired",
    0x1000: "minimum end stop pressed",
    0x2000: "maximum end stop pressed",
    ERROR_ESTOP: "emergency stop requested",
    0x20000: "homing without end stop",
    0x40000: "over-temperature",
    0x80000: "unknown position",
}
MOTOR_ERRORS = {
    0x1: "phase resistance out of range",
    0x2: "phase inductance out of range",
    0x8: "gate driver fault",
    0x10: "control deadline missed",
    0x80: "modulation magnitude",
    0x400: "current sense saturation",
    0x1000: "current limit violation",
    0x10000: "modulation not a number",
    0x20000: "motor over-temperature",
    0x40000: "inverter over-temperature",
    0x80000: "timer update missed",
    0x100000: "current measurement unavailable",
    0x200000: "current controller failed",
    0x400000: "bus current out of range",
    0x800000: "brake resistor disarmed",
    0x1000000: "system level",
    0x2000000: "timing error",
    0x4000000: "unknown phase",
    0x8000000: "unknown phase velocity",
    0x10000000: "unknown torque",
    0x20000000: "unknown current command",
    0x40000000: "unknown current",
    0x80000000: "unknown bus voltage",
    0x100000000: "unknown voltage command",
    0x200000000: "unknown gains",
    0x400000000: "initializing",
    0x800000000: "unbalanced phases",
}
ENCODER_ERRORS = {
    0x1: "unstable gain",
    0x2: "counts per turn and pole pairs do not fit",
    0x4: "no response",
    0x8: "unsupported mode",
    0x10: "illegal hall state",
    0x20: "index not found yet",
    0x40: "SPI time-out",
    0x80: "SPI transfer failed",
    0x100: "SPI not ready",
    0x200: "hall sensors not calibrated",
}
CONTROLLER_ERRORS = {
    0x1: "overspeed",
    0x2: "invalid input mode",
    0x4: "unstable gain",
    0x8: "invalid mirror axis",
    0x10: "invalid load encoder",
    0x20: "invalid estimate",
    0x40: "invalid circular range",
    0x80: "spin-out",
}


def axis_flags(error: int, motor: int, encoder: int, controller: int) -> int:
    """Return the axis error of a heartbeat, with the flags of those parts that have one of their own."""
    if motor & PART_FLAG:
        error |= ERROR_MOTOR
    if encoder & PART_FLAG:
        error |= ERROR_ENCODER
    return error | ERROR_CONTROLLER if controller & PART_FLAG else error


def errors_text(flags: int, motor: int, encoder: int, controller: int) -> str:
    """Name the errors of the axis, and those of the parts that it says have failed."""
    parts = (
        (flags & ERROR_MOTOR, "motor", error_text(motor, MOTOR_ERRORS)),
        (flags & ERROR_ENCODER, "encoder", error_text(encoder, ENCODER_ERRORS)),
        (flags & ERROR_CONTROLLER, "controller", error_text(controller, CONTROLLER_ERRORS)),
    )
    named = [f"{part}: {text}" for failed, part, text in parts if failed and text]
    return "; ".join(filter(None, (error_text(flags, AXIS_ERRORS), *named)))
