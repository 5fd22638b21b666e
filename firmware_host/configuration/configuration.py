"""The robot's configuration as records: one section of the TOML file each.

Only values that differ from machine to machine are configuration. Each section is a record of the part that uses it,
with default, unit, bounds and meaning next to each field. loading.py reads the file once, before anything is energised.
"""

from dataclasses import dataclass, field
from math import radians
from typing import Annotated, Literal

from control.bounds import Bounds, Meaning
from control.geometry import FlipperGeometry
from control.joint_friction import NO_FRICTION, JointFriction
from control.limits import JointRange
from control.monitors.motion_monitor import JointDynamics
from control.parameters.adaptation_parameters import AdaptationParameters
from control.parameters.arm_mass import ArmMass
from control.parameters.fault_bounds import FaultBounds
from control.parameters.gait_parameters import GaitParameters
from control.parameters.joint_gains import JointGains
from control.parameters.joint_limits import JointLimits
from control.parameters.motion_parameters import MotionParameters
from control.parameters.recovery_parameters import RecoveryParameters
from control.parameters.winding_parameters import WindingParameters
from control.records import Joints, Rig, same_for_each
from drivers.can.bus_load import BitRates
from drivers.drive import DriveParameters, WatchdogEndpoints
from drivers.fault_injection.failures import FailureParameters
from drivers.pose.natnet_sockets import NatNetParameters
from drivers.pose.rail_encoder import RailEncoderParameters
from drivers.power_switch import EmergencyStopParameters
from estimation.estimation_parameters import EstimationParameters
from estimation.joint_load import FlipperDrive
from firmware_host.configuration.log_parameters import LogParameters

CaptureAxis = Literal["x", "y", "z"]  # of motion capture's frame
EXIT_CONFIGURATION = 78  # EX_CONFIG of sysexits.h; the service's unit does not restart on it


@dataclass(frozen=True)
class RobotIdentity:
    name: Annotated[str, Meaning("in the logs and their file names")] = "mudskipper"


@dataclass(frozen=True)
class BusParameters:
    """Any python-can interface; `options` are passed to it unchanged."""

    interface: Annotated[str, Meaning("python-can interface, such as socketcan")]
    channel: Annotated[str, Meaning("of the interface, such as can0")]
    options: Annotated[
        dict[str, str | int | float | bool], Meaning("further arguments of the python-can interface")
    ] = field(default_factory=dict)
    bit_rate_kbit_s: Annotated[
        int, Bounds(10, 1000), Meaning("of the drives on the bus; `doctor` compares the interface with it")
    ] = 1000
    data_bit_rate_kbit_s: Annotated[
        int, Bounds(0, 8000), Meaning("of the data in CAN FD frames; 0: a bus without CAN FD")
    ] = 0

    @property
    def bit_rates(self) -> BitRates:
        return BitRates(1e3 * self.bit_rate_kbit_s, 1e3 * self.data_bit_rate_kbit_s)


@dataclass(frozen=True)
class LoopParameters:
    priority: Annotated[int, Bounds(0, 99), Meaning("SCHED_FIFO; 0: none", "1")] = 45  # under the interrupt threads' 50
    cpu: Annotated[int, Bounds(-1, 1023), Meaning("to run on; -1: any", "CPU number")] = -1
    lock_memory: Annotated[bool, Meaning("keep the process in RAM")] = True
    stay_awake: Annotated[bool, Meaning("keep all processors awake while torque is on; costs power")] = True
    wait_for_bus: Annotated[
        bool, Meaning("start without a bus that does not open and retry every second; false: exit")
    ] = False


@dataclass(frozen=True)
class SafetyParameters:
    weakened: Annotated[
        str, Meaning("why bounds of protection may be beyond twice their defaults; empty: they are refused")
    ] = ""


@dataclass(frozen=True)
class StatusParameters:
    socket: Annotated[str, Meaning("path of the Unix socket for operators")] = "/run/mudskipper/mudskipper.sock"
    anyone_may_stop: Annotated[
        bool, Meaning("every local account may stop and disarm; false: the two groups below")
    ] = True
    read_group: Annotated[
        str, Meaning("may see the status; empty: mudskipper-view, or without that the daemon's own group")
    ] = ""
    drive_group: Annotated[str, Meaning("may operate the robot, and see; empty: the daemon's own group")] = ""


@dataclass(frozen=True)
class PoseParameters:
    """The source of the body's position along the track."""

    source: Annotated[
        Literal["", "none", "socket", "natnet", "rail_encoder"],
        Meaning("of the body's position; empty: the socket where one is named"),
    ] = ""
    socket: Annotated[str, Meaning("path at which a motion-capture bridge sends the position")] = ""
    axis: Annotated[object, Meaning("of motion capture's frame, along the track: x, -z, or three numbers")] = "x"
    vertical: Annotated[
        CaptureAxis, Meaning("axis of motion capture's frame that points up; for replays of CSV logs")
    ] = "y"
    origin_m: Annotated[
        float, Bounds(-1000.0, 1000.0), Meaning("along that axis, or of the encoder, where the robot's x is zero")
    ] = 0.0
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
    rig: Rig = Rig()
    geometry: FlipperGeometry = FlipperGeometry()
    arm: ArmMass = ArmMass()
    gait: GaitParameters = GaitParameters()
    gains: JointGains = JointGains()
    motion: MotionParameters = MotionParameters()
    recovery: RecoveryParameters = RecoveryParameters()
    limits: JointLimits = JointLimits()
    winding: WindingParameters = WindingParameters()
    faults: FaultBounds = FaultBounds()
    safety: SafetyParameters = SafetyParameters()
    estimation: EstimationParameters = EstimationParameters()
    friction: dict[str, JointFriction] = field(default_factory=dict)  # by joint, where it was measured
    adaptation: AdaptationParameters = AdaptationParameters()
    loop: LoopParameters = LoopParameters()
    log: LogParameters = LogParameters()
    status: StatusParameters = StatusParameters()
    pose: PoseParameters = PoseParameters()
    emergency_stop: EmergencyStopParameters = EmergencyStopParameters()
    failures: FailureParameters = FailureParameters()
    watchdog_endpoints: list[WatchdogEndpoints] = field(default_factory=list)  # of more firmware builds
    text: str = ""  # the file itself, which goes into every log
    warnings: tuple[str, ...] = ()  # about former names of keys, and about a gait that measures badly

    @property
    def bus_of(self) -> dict[str, str]:
        """Return the name of the bus of each joint's drive."""
        return {joint: self.drive[joint].bus for joint in self.rig.joints}

    @property
    def torque_constants_nm_a(self) -> Joints[float]:
        return Joints(*(self.drive[joint].torque_constant_nm_a for joint in self.rig.joints))

    @property
    def flipper_drives(self) -> tuple[FlipperDrive, ...]:
        """Return the estimator's description of each flipper's motors."""
        rig = self.rig
        return tuple(self._flipper_drive(*rig.joints[rig.joints_of(flipper)]) for flipper in rig.flippers)

    def _flipper_drive(self, sweep: str, adduction: str) -> FlipperDrive:
        drives = (self.drive[sweep], self.drive[adduction])
        return FlipperDrive(
            mass=self.arm,
            sweep_constant_nm_a=drives[0].torque_constant_nm_a,
            adduction_constant_nm_a=drives[1].torque_constant_nm_a,
            sweep_friction=self.friction.get(sweep, NO_FRICTION),
            adduction_friction=self.friction.get(adduction, NO_FRICTION),
            current_limit_a=min(drives[0].current_limit_a, self.limits.torque_nm / drives[0].torque_constant_nm_a),
        )

    @property
    def joint_ranges(self) -> Joints[JointRange]:
        limits = self.limits
        sweep = JointRange(radians(limits.sweep_min_deg), radians(limits.sweep_max_deg))
        adduction = JointRange(radians(limits.adduction_min_deg), radians(limits.adduction_max_deg))
        return same_for_each(sweep, adduction, self.rig)

    @property
    def joint_dynamics(self) -> Joints[JointDynamics]:
        arm, gains = self.arm, self.gains
        sweep = JointDynamics(arm.sweep_inertia_kg_m2, gains.sweep_stiffness_nm_rad)
        adduction = JointDynamics(arm.adduction_inertia_kg_m2, gains.adduction_stiffness_nm_rad)
        return same_for_each(sweep, adduction, self.rig)
