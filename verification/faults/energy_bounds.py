"""Bounds on the energy that the motors may put into one joint after the onset of a failure, from physics alone.

    E = ½ I ω² + τ (s_d + s_r)

A motor does at most the work of its torque limit τ along the joint's path. ω is the speed above which a joint is too
fast, and ½ I ω² covers any oscillation about the path up to that speed. s_d is the path until the robot reacts: a
joint that runs away turns at ω for that time but not past its end stops; one that obeys follows the gait. s_r is the
path of the reaction: a soft stop raises the flipper once; damping drives a joint only until the torque has changed its
sign, and idle drives until the command has arrived. Commands that reach no drive leave its torque on until its
watchdog ends it. No measured energy enters.

`joint_runaway` watches energy itself. The work of a motor whose torque is inverted is minus that of the commanded
torque, so all of it is unexplained to the monitor, however strong the mud is. What is unexplained leaks with the time
constant t_l: a sum that reaches the bound E_0 within n ticks comes from at most E_0 e^(nT / t_l) of work. The delay of
the torque and the reaction add a path at the speed ω:

    E = E_0 e^(nT / t_l) + τ ω (2 + 2) T
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import ceil, exp, radians

from control.faults import FAULT_KINDS, FaultKind, Reaction
from control.gait.stride_table import stride_duration_s
from control.geometry import FlipperGeometry
from control.monitors.joint_monitor import FAST_FRACTION
from control.monitors.motion_monitor import RUNAWAY_LEAK_S, runaway_bound_j
from control.rate import PERIOD_S
from drivers.fault_injection.failure_table import FailureMode
from firmware_host.configuration.configuration import Configuration
from simulation.body.plant import END_STOPS_RAD

DELAY_TICKS = 2  # from the loop's torque to the motor's
SLEWING_TICKS = 3  # from full torque to the largest damping in the other direction, at the torque's slew rate
REACTING_TICKS = SLEWING_TICKS + DELAY_TICKS
WATCHDOG_TICKS = 40  # 0.1 s, and one tick for the command to the drive and one for its answer
DEEPEST_M = 0.05  # the deepest insertion of the paper
STOP_TO_STOP_RAD = 2.0 * max(END_STOPS_RAD)
BY_WATCHDOG = (  # the drive or the loop may be gone, so the torque may stay until the watchdog ends it
    FaultKind.DRIVE_QUIET,
    FaultKind.DRIVE_SILENT,
    FaultKind.BUS_OFF,
    FaultKind.BUS_REFUSES,
    FaultKind.LOOP_STALLED,
    FaultKind.LOOP_CRAWLING,
)
STOPPING = (Reaction.SOFT_STOP, Reaction.DAMPING, Reaction.DRIVES_IDLE)


@dataclass(frozen=True)
class EnergyBounds:
    """The bounds of one robot."""

    torque_nm: float  # τ
    speed_rad_s: float  # ω
    inertia_kg_m2: float  # I
    raising_rad: float  # the longest path of a soft stop
    stride_rad: float  # the gait's path of a joint in one stride
    stride_s: float  # of the shortest stride

    @property
    def kinetic_j(self) -> float:
        return 0.5 * self.inertia_kg_m2 * self.speed_rad_s**2

    def gait_rad(self, duration_s: float) -> float:
        """Return the longest path that the gait commands in this time: in each stride begun, that of a whole one."""
        return self.stride_rad * ceil(duration_s / self.stride_s)

    def detection_rad(self, ticks: int) -> float:
        duration_s = ticks * PERIOD_S
        return min(self.speed_rad_s * duration_s, max(STOP_TO_STOP_RAD, self.gait_rad(duration_s)))

    def reaction_rad(self, reaction: Reaction) -> float:
        if reaction is Reaction.SOFT_STOP:
            return self.raising_rad
        ticks = DELAY_TICKS + (SLEWING_TICKS if reaction is Reaction.DAMPING else 0)
        return self.speed_rad_s * ticks * PERIOD_S

    def stopping_j(self, ticks: int, reaction: Reaction) -> float:
        """Return the bound of a fault that stops the robot within `ticks`."""
        return self.kinetic_j + self.torque_nm * (self.detection_rad(ticks) + self.reaction_rad(reaction))

    def fault_j(self, kind: FaultKind, least_ticks: int = 0) -> float:
        """Return the published bound of a kind of fault that stops the robot, not before `least_ticks`."""
        ticks = max(detection_ticks(kind), least_ticks)
        return self.runaway_j(ticks) if kind is FaultKind.JOINT_RUNAWAY else self.stopping_j(ticks, kind.reaction)

    def runaway_j(self, ticks: int) -> float:
        """Return the bound of an inverted motor whose unexplained energy is found within `ticks`."""
        found_j = runaway_bound_j(self.torque_nm) * exp(ticks * PERIOD_S / RUNAWAY_LEAK_S)
        return found_j + self.torque_nm * self.speed_rad_s * 2 * DELAY_TICKS * PERIOD_S

    def walking_j(self, duration_s: float) -> float:
        """Return the bound of a robot that walks on for this time, 0 for one that holds a pose.

        A joint whose encoder fails is not seen to be too fast: full torque may accelerate it.
        """
        faster_rad_s = 0.5 * self.torque_nm / self.inertia_kg_m2 * duration_s
        path_rad = min((self.speed_rad_s + faster_rad_s) * duration_s, self.gait_rad(duration_s))
        return self.kinetic_j + self.torque_nm * path_rad


def detection_ticks(kind: FaultKind) -> int:
    """Return the ticks for which the motors may still exert any torque after the onset."""
    return max(kind.bound_ticks, WATCHDOG_TICKS) if kind in BY_WATCHDOG else kind.bound_ticks


def energy_bound_j(configuration: Configuration, mode: FailureMode, reported: Iterable[str], walked_s: float) -> float:
    """Return the bound since the onset of a failure, after which these faults were reported."""
    bounds = energy_bounds(configuration)
    if mode.torque_nm:
        bounds = replace(bounds, torque_nm=mode.torque_nm)
    if mode.restarted:
        return bounds.stopping_j(round(mode.lasts_s / PERIOD_S), Reaction.DRIVES_IDLE)
    if mode.ends_loop:
        return bounds.stopping_j(WATCHDOG_TICKS, Reaction.DRIVES_IDLE)
    if mode.fault_kind and mode.fault_kind.reaction in STOPPING and not mode.waived:
        return bounds.fault_j(mode.fault_kind, WATCHDOG_TICKS if mode.loses_commands else 0)
    kinds = (FAULT_KINDS[name] for name in reported)
    stopped_j = [bounds.fault_j(kind) for kind in kinds if kind.reaction in STOPPING]
    return max(bounds.walking_j(walked_s), *stopped_j, 0.0)


def pushing_bound_ticks(mode: FailureMode) -> int:
    """Return the ticks for which a motor may push against an end stop: until the reaction takes effect."""
    if mode.restarted:
        return round(mode.lasts_s / PERIOD_S) + REACTING_TICKS
    if mode.ends_loop or mode.loses_commands:
        return WATCHDOG_TICKS
    kind = FAULT_KINDS[mode.pushes_until] if mode.pushes_until else mode.fault_kind
    return REACTING_TICKS + (detection_ticks(kind) if kind and kind.reaction in STOPPING else 0)


def energy_bounds(configuration: Configuration) -> EnergyBounds:
    limits, gait, mass = configuration.limits, configuration.gait, configuration.arm
    front_rad = radians(gait.sweep_angle_deg)
    return EnergyBounds(
        torque_nm=limits.torque_nm,
        speed_rad_s=FAST_FRACTION * limits.velocity_rad_s,
        inertia_kg_m2=max(mass.sweep_inertia_kg_m2, mass.adduction_inertia_kg_m2),
        raising_rad=radians(max(-limits.adduction_min_deg, limits.adduction_max_deg)),
        stride_rad=max(4.0 * front_rad, _adduction_path_rad(configuration.geometry, front_rad)),
        stride_s=stride_duration_s(gait, configuration.geometry, 0.0),
    )


def _adduction_path_rad(geometry: FlipperGeometry, front_rad: float) -> float:
    """Return the path of a stride: down to the deepest insertion, at its depth through the stance, and up again."""
    front, middle = (geometry.adduction_rad(sweep_rad, DEEPEST_M) for sweep_rad in (front_rad, 0.0))
    return 2.0 * abs(front) + 2.0 * abs(front - middle)
