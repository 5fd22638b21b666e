"""The interface of motor drives, independent of the protocol that they speak.

`DriveParameters` are the configuration of one drive. A `DriveHealth` contains what a drive reports about itself, as
opposed to its joint. drivers/drive_axis.py is one drive as one joint; drivers/drives.py commands all of them together,
in any mix of protocols. drivers/drive_type.py says what a protocol consists of.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date
from math import ceil, inf
from typing import Annotated, ClassVar, NamedTuple, Protocol

from control.bounds import Bounds, Meaning
from control.records import UNKNOWN
from drivers.can.frames import Frame

FD = 1 << 29  # above every arbitration id


@dataclass(frozen=True)
class DriveCalibration:
    """For which drive the sign and the torque constant of a joint were calibrated."""

    date: Annotated[str, Meaning("of the calibration, such as 2026-11-28; empty: there was none")] = ""
    drive: Annotated[str, Meaning("its serial number; of one without, its bus, node id and model")] = ""


@dataclass(frozen=True)
class DriveParameters:
    """The configuration of a drive of any type; a type adds its own keys in a subclass."""

    bus: Annotated[str, Meaning("name of a [bus.NAME] section")]
    node_id: Annotated[int, Bounds(0, 62), Meaning("on that bus", "id")]
    type: Annotated[str, Meaning("the protocol that the drive speaks")] = "odrive"
    sign: Annotated[
        int, Bounds(-1, 1), Meaning("-1 for a mirrored motor: inverts angle, velocity, current and torque", "±1")
    ] = 1  # 0 is refused
    zero_turn: Annotated[float, Bounds(-1000.0, 1000.0), Meaning("encoder reading at joint angle zero")] = 0.0
    torque_constant_nm_a: Annotated[float, Bounds(0.001, 10.0), Meaning("torque per current")] = (
        0.083  # 60 / (2π · 115 rpm/V), as in the paper
    )
    current_limit_a: Annotated[float, Bounds(0.1, 200.0), Meaning("of the drive")] = 12.0
    heartbeat_period_s: Annotated[float, Bounds(0.01, 1.0), Meaning("as set on the drive")] = 0.1  # its default
    command_delay_s: Annotated[
        float, Bounds(0.003, 1.0), Meaning("for which it may still report the set-point of an older command")
    ] = 0.0079  # 3 T
    serial_number: Annotated[
        str, Meaning("of the drive; the robot is not armed with another one; empty: not compared")
    ] = ""
    firmware_date: Annotated[
        str, Meaning("when its firmware was installed, such as 2026-11-24; an older calibration or proof is refused")
    ] = ""
    calibrated: DriveCalibration = DriveCalibration()

    models: ClassVar[tuple[str, ...]] = ()  # of motors that its protocol distinguishes by a key `model`
    serial_digits: ClassVar[int] = 12  # hexadecimal ones, of a serial number of this type of drive; 0: it reports none
    answers_only: ClassVar[bool] = False  # it sends nothing unless it is asked, which each tick does once
    unreported: ClassVar[frozenset[str]] = frozenset()  # signals that this type of drive does not have
    holds_idle_current: ClassVar[bool] = False  # switched off, it reports its last current until its next heartbeat

    @property
    def asking_ends_torque(self) -> bool:
        """Return whether only a command, which ends the drive's torque, can ask for its signals."""
        return False

    @property
    def fastest_rad_s(self) -> float:
        """Return the speed up to which the motor can give the commanded torque; unlimited where none is known."""
        return inf

    @property
    def torque_step_nm(self) -> float:
        """Return the step between two codes of a commanded torque, of which the nearest is sent."""
        return 0.0

    @property
    def reports_settings(self) -> bool:
        """Return whether this program comes to know the drive's watchdog and version by itself."""
        return True

    @property
    def knows_watchdog(self) -> bool:
        """Return whether the drive reports its watchdog, or a trial of it is recorded."""
        return self.reports_settings

    @property
    def identity(self) -> str:
        """Return what tells this drive from others, as a record about it names it."""
        return self.serial_number or f"{self.bus} {self.node_id} {getattr(self, 'model', '')}".rstrip()

    def record_problems(self) -> Iterator[tuple[str, str]]:
        """Yield why a record is not that of this drive with this firmware: the key with its value, what it must be."""
        record, remedy = self.calibrated, "run 'mudskipper calibrate', or remove 'calibrated'"
        for key, value in (("firmware_date", self.firmware_date), ("calibrated.date", record.date)):
            if value and not is_date(value):
                yield f"{key} = {value!r}", "must be a date such as 2026-11-24"
                return
        if record.drive and not record.date:
            yield "calibrated.date = ''", "must be the date of the calibration"
        elif record.date and record.drive != self.identity:
            other = "it is a calibration of another drive"
            yield f"calibrated.drive = {record.drive!r}", f"must be {self.identity!r}: {other}; {remedy}"
        elif record.date and record.date < self.firmware_date:
            earliest = f"must be at least firmware_date = {self.firmware_date}"
            yield f"calibrated.date = {record.date}", f"{earliest}: the calibration was of older firmware; {remedy}"

    def torque_problems(self, torque_nm: float) -> Iterator[tuple[str, str]]:
        """Yield reasons why this drive cannot exert `torque_nm`: the key with its value, and what it must be."""
        if self.current_limit_a < torque_nm / self.torque_constant_nm_a:
            needed_a = ceil(100.0 * torque_nm / self.torque_constant_nm_a) / 100.0
            yield (
                f"current_limit_a = {self.current_limit_a}",
                f"must be at least {needed_a:.2f} for limits.torque_nm = {torque_nm}",
            )


def is_date(text: str) -> bool:
    try:
        return date.fromisoformat(text).isoformat() == text
    except ValueError:
        return False


@dataclass(frozen=True)
class WatchdogEndpoints:
    """The numbers of two parameters in one build of a drive's firmware, by which its watchdog is read back."""

    firmware: Annotated[str, Meaning("version of the firmware, such as 0.6.11")]
    hardware: Annotated[str, Meaning("product line, version and variant, such as 4.4.58")]
    enable: Annotated[int, Bounds(1, 65535), Meaning("number of the flag that enables the watchdog", "parameter id")]
    timeout: Annotated[int, Bounds(1, 65535), Meaning("number of the watchdog's time-out", "parameter id")]


class DriveHealth(NamedTuple):
    """One drive's report about itself. Texts are for people; an empty one means that there is nothing to report."""

    joint: str
    firmware: str = ""  # version; empty until the drive has reported it
    supported_firmware: str = ""  # major and minor version whose messages the codec knows
    firmware_supported: bool = False  # False also while the version is unknown
    hardware: str = ""
    watchdog_s: float = UNKNOWN  # its time-out, read back from the drive: NaN until then, 0 where it is off
    watchdog_advice: str = ""  # how to make an unknown watchdog known
    watchdog_expired: bool = False  # among the active errors, or the reason of the last disarming
    restarts: int = 0  # since the start; only grows
    duplicate_id: bool = False  # two drives seem to send under this id
    foreign_commands: int = 0  # of other programs to this drive, since the start; only grows
    setpoint_problem: str = ""  # it follows other torques than the commanded ones: for example which
    serial_number: str = ""  # empty until the drive has reported it
    expected_serial_number: str = ""  # as configured
    setting_problem: str = ""  # a setting that was read back differs from the configuration: which, and what to do
    other_protocol: str = ""  # in which another drive answers under this id
    busy_state: str = ""  # an activity that this program did not ask for, such as a calibration
    power_cut: bool = False  # an active error is an emergency stop, or a supply that is too low
    active_errors: str = ""
    errors: str = ""  # active errors and the reason of the last disarming


class Outlet(Protocol):
    """The path on which an axis sends its frames."""

    def send(self, frame: Frame) -> None: ...
