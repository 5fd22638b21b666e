"""The parameters of a simulated motor drive, and the errors and forged frames that it may be asked for."""

from dataclasses import dataclass
from enum import Enum, auto
from math import inf, pi
from typing import Annotated

from control.bounds import Bounds


@dataclass(frozen=True)
class SimulatedDriveParameters:
    """One simulated drive and its motor: what the configuration fixes, then what differs from an ideal drive."""

    node_id: Annotated[int, Bounds(0, 126)]
    sign: Annotated[int, Bounds(-1, 1)] = 1
    zero_turn: Annotated[float, Bounds(-1000.0, 1000.0)] = 0.0
    torque_constant_nm_a: Annotated[float, Bounds(0.001, 10.0)] = 0.083  # in the drive's own settings
    torque_constant_error: Annotated[float, Bounds(-0.9, 9.0)] = 0.0  # fraction by which the true one is larger
    commutation_error_deg: Annotated[float, Bounds(-180.0, 180.0)] = 0.0  # electrical: 60 halves, 180 inverts torque
    cogging_nm: Annotated[float, Bounds(0.0, 0.5)] = 0.0
    cogging_per_turn: Annotated[int, Bounds(1, 1000)] = 84  # 12 slots and 14 magnets, as many small motors have
    cogging_phase_deg: Annotated[float, Bounds(-360.0, 360.0)] = 0.0
    current_lag_s: Annotated[float, Bounds(0.0, 0.1)] = 0.0  # time constant
    current_noise_a: Annotated[float, Bounds(0.0, 10.0)] = 0.1
    encoder_counts: Annotated[int, Bounds(16, 16777216)] = 16384
    encoder_direction: Annotated[int, Bounds(-1, 1)] = 1  # of the phases, by which some drives report current
    encoder_offset_rad: Annotated[float, Bounds(-pi, pi)] = 0.0  # reported minus true angle of the joint
    encoder_noise_rad: Annotated[float, Bounds(0.0, 0.1)] = 0.0
    encoder_frozen: bool = False  # the last angle for ever, and exactly zero velocity: a magnet that came off
    encoder_slip_rad_s: Annotated[float, Bounds(-10.0, 10.0)] = (
        0.0  # rate at which the reported angle leaves the true one
    )
    velocity_slip_rad_s: Annotated[float, Bounds(-10.0, 10.0)] = 0.0  # reported minus true speed of the joint
    velocity_error: Annotated[float, Bounds(-0.9, 5.0)] = 0.0  # fraction by which the reported speed is larger
    watchdog_s: Annotated[float, Bounds(0.0, 60.0)] = 0.1  # 0: off, as ODrives are delivered
    any_frame_feeds: bool = False  # its watchdog, as in firmware 0.5
    encoder_period_s: Annotated[float, Bounds(0.001, 1.0)] = 0.002
    current_period_s: Annotated[float, Bounds(0.001, 1.0)] = 0.002
    heartbeat_period_s: Annotated[float, Bounds(0.001, 1.0)] = 0.1
    slow_period_s: Annotated[float, Bounds(0.001, 10.0)] = 0.1  # error, temperature, bus voltage
    message_delay_s: Annotated[float, Bounds(0.0, 0.05)] = 0.0  # longest
    repeated_fraction: Annotated[float, Bounds(0.0, 0.99)] = 0.0  # of the messages of angle, and of current
    velocity_gain_nm_s_turn: Annotated[float, Bounds(0.0, 100.0)] = 1.0 / 6.0  # ODrive's default vel_gain, in the clamp
    velocity_noise_rad_s: Annotated[float, Bounds(0.0, 5.0)] = 0.0  # of the drive's estimate
    overspeed_fraction: Annotated[float, Bounds(0.0, 10.0)] = 0.0  # of the velocity limit that trips; ODrive: 1.2
    temperature_c: Annotated[float, Bounds(-50.0, 200.0)] = 30.0
    bus_voltage_v: Annotated[float, Bounds(0.0, 100.0)] = 24.0
    motor_current_limit_a: Annotated[float, Bounds(0.0, inf)] = inf  # the motor clips at it, at any limit from the bus
    current_limit_a: Annotated[float, Bounds(0.1, 200.0)] = 12.0  # in the settings of a drive that has it there
    timeout_mode: Annotated[int, Bounds(0, 15)] = 12  # moteus: what it does once its watchdog has expired
    serial_number: str = ""
    type: str = "odrive"
    model: str = ""  # of the motor, where the ranges of the drive's codes depend on it
    velocity_range_rad_s: Annotated[float, Bounds(-1.0, 500.0)] = -1.0  # of these codes; -1: that of the model
    torque_range_nm: Annotated[float, Bounds(0.0, 500.0)] = 0.0  # of these codes; 0: that of the model


class Forgery(Enum):
    """Frames that a bus may carry in the name of a drive, or to it, though neither drive nor loop sent them."""

    EMERGENCY_STOP = auto()
    CLOSE_LOOP = auto()
    OLD_FIRMWARE = auto()
    STARTING = auto()
    WATCHDOG_OFF = auto()
    OTHER_DRIVE = auto()
    OTHER_SETTING = auto()  # for drives whose settings are read back


class DriveError(Enum):
    OVERCURRENT = auto()
    WATCHDOG = auto()
    OVERSPEED = auto()
    OVERVOLTAGE = auto()  # of the supply, while the motor brakes
    UNDERVOLTAGE = auto()
    BRAKE_RESISTOR = auto()  # disarmed
