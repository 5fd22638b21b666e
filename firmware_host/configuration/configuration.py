"""The robot's configuration: one TOML file, checked once, before anything is energised.

Only what differs from machine to machine is configuration. Every section is a record of the part that uses it, with
default, unit and bounds beside each field there, by which toml_records.py refuses unknown keys and values out of
bounds, all of them at once and by name; configuration_problems.py checks what only the whole can show.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from math import radians
from pathlib import Path
from typing import Annotated, Any, Literal

from control.bounds import Bounds
from control.controller import MotionParameters
from control.depth.depth_choice import AdaptationParameters
from control.gait.gait import PROTOCOLS, GaitParameters
from control.gait.recovery import RecoveryParameters
from control.geometry import FlipperGeometry
from control.joint_friction import NO_FRICTION, JointFriction
from control.joint_pd import ArmMass, JointGains
from control.limits import JointLimits, JointRange
from control.monitors.joint_monitor import FaultBounds
from control.monitors.winding import WindingParameters
from control.records import JOINTS
from drivers.fault_injection.failures import FailureParameters
from drivers.odrive.axis import DriveParameters, WatchdogEndpoints
from drivers.pose.natnet_parameters import NatNetParameters
from drivers.pose.rail_encoder import RailEncoderParameters
from estimation.joint_load import FlipperDrive
from estimation.mud import EstimationParameters
from firmware_host.configuration.consistency import contradictions
from firmware_host.configuration.toml_records import ConfigurationError as ConfigurationError  # for whoever loads one
from firmware_host.configuration.toml_records import RecordReader, parse_document, read_text
from firmware_host.log.log_parameters import LogParameters

EXIT_CONFIGURATION = 78  # EX_CONFIG of sysexits.h; systemd is told not to restart on it


@dataclass(frozen=True)
class RobotIdentity:
    name: str = "mudskipper"


@dataclass(frozen=True)
class BusParameters:
    """Any python-can interface; `options` go to it as they are."""

    interface: str
    channel: str
    options: dict[str, str | int | float | bool] = field(default_factory=dict)
    bit_rate_kbit_s: Annotated[int, Bounds(10, 1000)] = 1000  # of its drives, by which `doctor` judges the interface


@dataclass(frozen=True)
class LoopParameters:
    priority: Annotated[int, Bounds(0, 99)] = 45  # SCHED_FIFO, under the interrupt threads' 50; 0: none
    cpu: Annotated[int, Bounds(-1, 1023)] = -1  # to run on; -1: any
    lock_memory: bool = True
    wait_for_bus: bool = False  # start without a bus that does not open, and try again every second; else end


@dataclass(frozen=True)
class StatusParameters:
    socket: str = "/run/mudskipper/mudskipper.sock"
    anyone_may_stop: bool = True  # whoever has an account here; else nobody outside these two groups
    read_group: str = ""  # who may see how the robot is; empty: the daemon's own group
    drive_group: str = ""  # who may operate it, and see; empty: the daemon's own group


@dataclass(frozen=True)
class PoseParameters:
    """Where the body's place along the track is known from."""

    source: Literal["", "none", "socket", "natnet", "rail_encoder"] = ""  # empty: the socket where one is named
    socket: str = ""  # where a motion-capture bridge sends the place
    axis: object = "x"  # of motion capture's frame, along the track: x, -z, or three numbers
    origin_m: Annotated[float, Bounds(-1000.0, 1000.0)] = 0.0  # along the axis, or of the encoder, where x is zero
    natnet: NatNetParameters = NatNetParameters()
    rail_encoder: RailEncoderParameters = RailEncoderParameters()

    @property
    def chosen(self) -> str:
        return self.source or ("socket" if self.socket else "none")


@dataclass(frozen=True)
class Configuration:
    bus: dict[str, BusParameters]
    drive: dict[str, DriveParameters]
    robot: RobotIdentity = RobotIdentity()
    geometry: FlipperGeometry = FlipperGeometry()
    arm: ArmMass = ArmMass()
    gait: GaitParameters = GaitParameters()
    gains: JointGains = JointGains()
    motion: MotionParameters = MotionParameters()
    recovery: RecoveryParameters = RecoveryParameters()
    limits: JointLimits = JointLimits()
    winding: WindingParameters = WindingParameters()
    faults: FaultBounds = FaultBounds()
    estimation: EstimationParameters = EstimationParameters()
    friction: dict[str, JointFriction] = field(default_factory=dict)  # by joint, where it was measured
    adaptation: AdaptationParameters = AdaptationParameters()
    loop: LoopParameters = LoopParameters()
    log: LogParameters = LogParameters()
    status: StatusParameters = StatusParameters()
    pose: PoseParameters = PoseParameters()
    failures: FailureParameters = FailureParameters()
    watchdog_endpoints: list[WatchdogEndpoints] = field(default_factory=list)  # of further builds of ODrive's firmware
    text: str = ""  # the file itself, which goes into every log

    @property
    def torque_constants_nm_a(self) -> tuple[float, float, float, float]:
        a, b, c, d = (self.drive[joint].torque_constant_nm_a for joint in JOINTS)
        return a, b, c, d

    @property
    def flipper_drives(self) -> tuple[FlipperDrive, FlipperDrive]:
        """What the estimator knows of the left and the right flipper's motors."""
        left, right = (self._flipper_drive(*JOINTS[place : place + 2]) for place in (0, 2))
        return left, right

    def _flipper_drive(self, sweep: str, adduction: str) -> FlipperDrive:
        drives = (self.drive[sweep], self.drive[adduction])
        limits_a = [min(d.current_limit_a, self.limits.torque_nm / d.torque_constant_nm_a) for d in drives]
        return FlipperDrive(
            self.arm,
            drives[0].torque_constant_nm_a,
            drives[1].torque_constant_nm_a,
            self.friction.get(sweep, NO_FRICTION),
            self.friction.get(adduction, NO_FRICTION),
            min(limits_a),
        )

    @property
    def joint_ranges(self) -> tuple[JointRange, JointRange, JointRange, JointRange]:
        limits = self.limits
        sweep = JointRange(radians(limits.sweep_min_deg), radians(limits.sweep_max_deg))
        adduction = JointRange(radians(limits.adduction_min_deg), radians(limits.adduction_max_deg))
        return sweep, adduction, sweep, adduction


_READER = RecordReader(Configuration, without={"text"})


def load_configuration(path: Path) -> Configuration:
    """Raises ConfigurationError, also where the file cannot be read."""
    return parse_configuration(read_text(path), path)


def parse_configuration(text: str, file: Path | None = None) -> Configuration:
    """Raises ConfigurationError."""
    document = parse_document(text, file)
    _apply_protocol(document)
    configuration = Configuration(**_READER.read(document), text=text)
    problems = list(contradictions(configuration))
    if problems:
        raise ConfigurationError(problems)
    return configuration


def _apply_protocol(document: dict[str, Any]) -> None:
    """`gait.protocol` names the preset that the other keys of [gait] change."""
    gait = document.get("gait")
    if not isinstance(gait, dict) or "protocol" not in gait:
        return
    name = gait.pop("protocol")
    if not isinstance(name, str) or name not in PROTOCOLS:
        raise ConfigurationError([f"gait.protocol = {name!r}: must be one of {', '.join(PROTOCOLS)}"])
    document["gait"] = asdict(PROTOCOLS[name]) | gait
