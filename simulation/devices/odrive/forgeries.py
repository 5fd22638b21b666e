"""Forges ODrive frames that a bus carries in the name of a drive, or to it, though neither drive nor loop sent them.

OLD_FIRMWARE is a firmware other than the drive's type says.
"""

from collections.abc import Mapping

from drivers.can.frames import Frame
from drivers.odrive import codec
from drivers.odrive.codec import AxisState, Message, arbitration_id
from simulation.devices.drive import Forgery

WATCHDOG_TIMEOUT_ENDPOINT, ENABLE_WATCHDOG_ENDPOINT = 1, 2  # of hardware 0.0.0, which no real board has
OLD_FIRMWARE = (2, 4, 4, 58, 0, 5, 6, 0)

Forgeries = Mapping[Forgery, tuple[Message, tuple[int, ...], bytes]]  # message, values, and bytes after them
COMMON: Forgeries = {
    Forgery.EMERGENCY_STOP: (codec.ESTOP, (), b""),
    Forgery.CLOSE_LOOP: (codec.SET_AXIS_STATE, (AxisState.CLOSED_LOOP,), b""),
}
FORGERIES: Forgeries = {
    **COMMON,
    Forgery.OLD_FIRMWARE: (codec.GET_VERSION, OLD_FIRMWARE, b""),
    Forgery.STARTING: (codec.HEARTBEAT, (codec.ERROR_INITIALIZING, AxisState.IDLE, 0, 0), b""),
    Forgery.WATCHDOG_OFF: (codec.TX_SDO, (0, ENABLE_WATCHDOG_ENDPOINT, 0), b"\0"),
    Forgery.OTHER_DRIVE: (codec.ADDRESS, (0, 0xABCDEF, 0), b""),
}


def forged_frame(node_id: int, forgery: Forgery, forgeries: Forgeries = FORGERIES) -> Frame:
    message, values, value = forgeries[forgery]
    return Frame(arbitration_id(node_id, message), message.encode(*values) + value)


def forged_current(node_id: int, setpoint_a: float, current_a: float) -> Frame:
    """Reports another measured current than the motor has."""
    return Frame(arbitration_id(node_id, codec.GET_IQ), codec.GET_IQ.encode(setpoint_a, current_a))


def forged_torque(node_id: int, torque_nm: float) -> Frame:
    """Commands a torque of the motor."""
    return Frame(arbitration_id(node_id, codec.SET_INPUT_TORQUE), codec.SET_INPUT_TORQUE.encode(torque_nm))
