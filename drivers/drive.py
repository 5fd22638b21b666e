"""The interface of motor drives, independent of the protocol that they speak.

Four drives, one for each joint, are commanded together as `Drives`: read their states, send torques, arm, disarm. A
`DriveHealth` contains what a drive reports about itself, as opposed to its joint. A `DriveType` describes one protocol:
the parameters that the configuration states, the drives that speak it, and how to read its frames without commanding a
drive, which the checks of the wiring and the fault injection need. drivers/drive_types.py lists the types that exist.

Only `Drives` send commands on the drives' buses. Every frame passes a gate (drivers/transmit_gate.py), which refuses
and counts any command that the limits forbid.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Annotated, NamedTuple, Protocol

from control.bounds import Bounds, Meaning
from control.limits import JointLimits
from control.records import UNKNOWN, DriveStates, Joints, Torques
from drivers.can.bus_load import FrameRate
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame


@dataclass(frozen=True)
class DriveParameters:
    """The configuration of a drive of any type; a type adds its own keys in a subclass."""

    bus: Annotated[str, Meaning("name of a [bus.NAME] section")]
    node_id: Annotated[int, Bounds(0, 62), Meaning("on that bus", "id")]
    type: Annotated[str, Meaning("the protocol that the drive speaks; the same for all joints")] = "odrive"
    sign: Annotated[
        int, Bounds(-1, 1), Meaning("-1 for a mirrored motor: inverts angle, velocity, current and torque", "±1")
    ] = 1  # 0 is refused
    zero_turn: Annotated[float, Bounds(-1000.0, 1000.0), Meaning("encoder reading at joint angle zero")] = 0.0
    torque_constant_nm_a: Annotated[float, Bounds(0.001, 10.0), Meaning("torque per current")] = (
        0.083  # 60 / (2π · 115 rpm/V), as in the paper
    )
    current_limit_a: Annotated[float, Bounds(0.1, 200.0), Meaning("of the drive")] = 12.0
    heartbeat_period_s: Annotated[float, Bounds(0.01, 1.0), Meaning("as set on the drive")] = 0.1  # its default
    serial_number: Annotated[
        str, Meaning("of the drive; the robot is not armed with another one; empty: not compared")
    ] = ""

    def torque_problems(self, torque_nm: float) -> Iterator[tuple[str, str]]:
        """Yields reasons why this drive cannot exert `torque_nm`: the key with its value, and what it must be."""
        if self.current_limit_a < torque_nm / self.torque_constant_nm_a:
            needed_a = ceil(100.0 * torque_nm / self.torque_constant_nm_a) / 100.0
            yield (
                f"current_limit_a = {self.current_limit_a}",
                f"must be at least {needed_a:.2f} for limits.torque_nm = {torque_nm}",
            )


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
    busy_state: str = ""  # an activity that this program did not ask for, such as a calibration
    active_errors: str = ""
    errors: str = ""  # active errors and the reason of the last disarming


class Drives(Protocol):
    """The drives of all joints, on one bus or several."""

    ports: dict[str, CanPort]  # by the name of the bus
    unknown_frames: int  # of ids that belong to none of the drives
    malformed_frames: int  # of one of the drives, with a payload that cannot be decoded

    @property
    def health(self) -> Joints[DriveHealth]: ...

    @property
    def heard(self) -> bool:
        """Returns whether every drive has sent every signal that control depends on at least once."""

    @property
    def refused_commands(self) -> int:
        """Commands that the gate has refused since the start."""

    @property
    def last_refusal(self) -> str: ...

    def read(self, now_s: float) -> DriveStates:
        """Reads all frames that have arrived; returns the newest of every signal."""

    def send(self, torques_nm: Torques, elapsed_s: float) -> None:
        """Commands all torques. They may differ from the ones before by the slew rate times `elapsed_s`."""

    def send_torque(self, joint: str, torque_nm: float) -> None:
        """Commands one joint alone, within the step that the last `send` allowed."""

    def arm(self, now_s: float, at_once: bool = False) -> None:
        """Prepares all drives when `at_once`, else prepares and enables those that do not follow torque yet."""

    def disarm(self, now_s: float, at_once: bool = False) -> None:
        """Commands zero torque and idle: to all drives when `at_once`, else to those that still follow torque."""

    def force_idle(self, repeats: int) -> None:
        """Commands zero torque and idle to every drive, `repeats` times. Never raises."""

    def clear_errors(self) -> None: ...

    def request_settings(self, now_s: float) -> None:
        """Asks for firmware version and watchdog, every few seconds: a restart forgets them, and they may change."""

    def close(self) -> None: ...


class FrameContent(NamedTuple):
    """The meaning of a frame in a drive's protocol."""

    node_id: int  # of the drive that sends it or is addressed
    is_command: bool = False  # a drive obeys it and never sends it
    signals: tuple[str, ...] = ()  # what it reports, the main one first: position, current, heartbeat, error, ...


class DriveType(Protocol):
    """One protocol, and the drives that speak it."""

    @property
    def parameters(self) -> type[DriveParameters]:
        """The record of the configuration's `[drive.JOINT]`."""

    @property
    def example_error(self) -> int:
        """The flags of an error on which the drive switches its torque off, for fault injection."""

    @property
    def command(self) -> FrameRate:
        """The command that this program sends to each drive in every tick."""

    @property
    def reports(self) -> tuple[FrameRate, ...]:
        """The messages that each drive sends cyclically, at the rates that the set-up instructions give."""

    def make_drives(
        self,
        parameters: Mapping[str, DriveParameters],
        ports: Mapping[str, CanPort],
        limits: JointLimits,
        endpoints: Sequence[WatchdogEndpoints],
    ) -> Drives: ...

    def read_frame(self, frame: Frame) -> FrameContent | None:
        """Returns the content of a frame by its id; None for frames of another kind than the protocol uses."""

    def harmless_frames(self, node_id: int) -> Mapping[str, Frame]:
        """Returns frames that other programs may send while torque is on, by name: they must not feed a watchdog."""

    def with_error(self, frame: Frame, flags: int, idle: bool) -> bytes:
        """Returns the payload of a frame that reports errors, with these error flags added and the drive set to `idle`.

        A payload that cannot be decoded is returned unchanged.
        """
