"""The torque that a moteus computes from its command, and without one once its watchdog has expired.

Sources: ISR_DoPosition, ISR_DoZeroVelocity and ISR_DoPositionTimeout of fw/bldc_servo_control.h of mjbots/moteus.
"""

from collections.abc import Mapping
from math import isnan, nan

from drivers.moteus.codec import Mode
from drivers.moteus.registers import Register

KP_NM_TURN, KD_NM_S_TURN = 4.0, 0.05  # moteus's defaults, before their scales
BRAKE_NM_S_TURN = 0.06  # of shorted windings, some k_t² / R
TIMEOUT_TORQUE_NM = 5.0  # servo.timeout_max_torque_Nm

DEFAULTS = {  # of the registers that a command does not write
    Register.COMMAND_POSITION: 0.0,
    Register.COMMAND_VELOCITY: 0.0,
    Register.COMMAND_TORQUE: 0.0,
    Register.KP_SCALE: 1.0,
    Register.KD_SCALE: 1.0,
    Register.MAX_TORQUE: nan,
    Register.WATCHDOG: 0.0,
    Register.ILIMIT_SCALE: 1.0,
}
PURE_TORQUE = {  # what codec.encode_torque writes besides the torque
    Register.COMMAND_POSITION: nan,
    Register.KP_SCALE: 0.0,
    Register.KD_SCALE: 0.0,
    Register.ILIMIT_SCALE: 0.0,
}


def position_mode_nm(command: Mapping[Register, float], turns: float, turns_s: float, held_turns: float) -> float:
    """Return the torque in position mode; a position of NaN is the one that it held when it entered the mode."""
    position_turn, kp_nm_turn = command[Register.COMMAND_POSITION], KP_NM_TURN * command[Register.KP_SCALE]
    torque_nm = command[Register.COMMAND_TORQUE]
    torque_nm += KD_NM_S_TURN * command[Register.KD_SCALE] * (command[Register.COMMAND_VELOCITY] - turns_s)
    if kp_nm_turn:
        torque_nm += kp_nm_turn * ((held_turns if isnan(position_turn) else position_turn) - turns)
    most_nm = command[Register.MAX_TORQUE]
    return torque_nm if isnan(most_nm) else max(-most_nm, min(most_nm, torque_nm))


def timeout_nm(timeout_mode: float, kd_scale: float, turns: float, turns_s: float, held_turns: float) -> float:
    """Return the torque of the mode timeout. Zero velocity damps with the scale of kd of the last command."""
    match timeout_mode:
        case Mode.ZERO_VELOCITY:
            torque_nm = -KD_NM_S_TURN * kd_scale * turns_s
        case Mode.BRAKE:
            torque_nm = -BRAKE_NM_S_TURN * turns_s
        case Mode.POSITION:
            torque_nm = KP_NM_TURN * (held_turns - turns) - KD_NM_S_TURN * turns_s
        case _:
            return 0.0
    return max(-TIMEOUT_TORQUE_NM, min(TIMEOUT_TORQUE_NM, torque_nm))
