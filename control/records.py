"""The records that cross from one part of the program to another, and the names of joints and phases.

Everything here is immutable and carries its unit in its name. Angles follow the paper (section II-A): the sweep
angle is positive with the flipper in front of its joint, the adduction angle is positive with the flipper raised,
for the left and the right flipper alike; the driver reverses the sign of a mirrored motor. Stamps are seconds of the
monotonic clock. A value that was never measured is NaN, a stamp that was never set is -inf.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from math import isfinite
from typing import Annotated, Any, Generic, NamedTuple, TypeVar

from control.bounds import Meaning

T = TypeVar("T")
U = TypeVar("U")

FLIPPERS = ("left", "right")  # that a rig may have
NEVER_S = float("-inf")
UNKNOWN = float("nan")
COEFFICIENTS = ("k_p", "k_s", "k_e")  # of a mud: penetration, shear, extraction


@dataclass(frozen=True)
class Rig:
    """The flippers of a robot, each with a sweep and an adduction motor: all that says how many joints there are."""

    flippers: Annotated[tuple[str, ...], Meaning("each with a sweep and an adduction motor")] = FLIPPERS

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """The names of the joints, in the order of every `Joints`."""
        return tuple(f"{flipper}_{axis}" for flipper in self.flippers for axis in FlipperJoints._fields)

    def joints_of(self, flipper: str) -> slice:
        """Return which values of a `Joints` belong to a flipper."""
        first = len(FlipperJoints._fields) * self.flippers.index(flipper)
        return slice(first, first + len(FlipperJoints._fields))


class FlipperJoints(NamedTuple, Generic[T]):
    """One value for each joint of one flipper."""

    sweep: T
    adduction: T


class Joints(tuple[T, ...], Generic[T]):
    """One value for each joint of the robot, in the order of its `Rig.joints`: `zip(rig.joints, states)`.

    The values are stored flat and not as pairs because the loop, the gate and the log iterate over all joints several
    times a tick; `flippers` has them as pairs, `states.flippers[0].adduction`.
    """

    __slots__ = ()

    def __new__(cls, *values: T) -> Joints[T]:
        return tuple.__new__(cls, values)

    def __getnewargs__(self) -> tuple[Any, ...]:
        return tuple(self)

    @property
    def flippers(self) -> tuple[FlipperJoints[T], ...]:
        """The values of one flipper after the other."""
        return tuple(map(FlipperJoints, self[::2], self[1::2]))

    def map(self, function: Callable[[T], U]) -> Joints[U]:
        """Apply a function to the value of each joint."""
        return Joints(*map(function, self))


TWO_FLIPPERS = Rig()
JOINTS = TWO_FLIPPERS.joints  # that a rig may have


def same_for_all(value: T, rig: Rig = TWO_FLIPPERS) -> Joints[T]:
    """Give every joint the same value."""
    return Joints(*(value,) * len(rig.joints))


def same_for_each(sweep: T, adduction: T, rig: Rig = TWO_FLIPPERS) -> Joints[T]:
    """Give every flipper the same values."""
    return Joints(*(sweep, adduction) * len(rig.flippers))


class Phase(IntEnum):
    """The phase of a stride. REST is outside of any stride, PAUSE is a short rest between two phases.

    RECOVERY comes before the swing if a flipper is still stuck in the mud. STROKE is a path that does what insertion,
    stance and extraction do at once, as an ellipse.
    """

    REST = 0
    INSERTION = 1
    STANCE = 2
    EXTRACTION = 3
    SWING = 4
    PAUSE = 5
    RECOVERY = 6
    STROKE = 7


class DriveState(NamedTuple):
    """The newest signals of one drive, each with the time at which it arrived."""

    angle_rad: float = UNKNOWN
    velocity_rad_s: float = UNKNOWN
    angle_stamp_s: float = NEVER_S
    current_a: float = UNKNOWN  # measured, not the set-point
    current_stamp_s: float = NEVER_S
    closed_loop: bool = False
    error_flags: int = 0
    heartbeat_stamp_s: float = NEVER_S
    temperature_c: float = UNKNOWN
    temperature_stamp_s: float = NEVER_S
    bus_voltage_v: float = UNKNOWN
    bus_voltage_stamp_s: float = NEVER_S
    bus_current_a: float = UNKNOWN  # that the drive takes from its supply

    @property
    def heard(self) -> bool:
        """Every signal that control depends on has arrived at least once."""
        return isfinite(self.angle_stamp_s + self.current_stamp_s + self.heartbeat_stamp_s)


DriveStates = Joints[DriveState]
Torques = Joints[float]  # N·m


class JointTarget(NamedTuple):
    angle_rad: float
    velocity_rad_s: float


JointTargets = Joints[JointTarget]
JointAngles = Joints[float]  # rad


class GaitTarget(NamedTuple):
    """The target of the gait for both flippers in one tick."""

    phase: Phase
    stride: int
    sweep_rad: float
    sweep_velocity_rad_s: float
    depth_m: float  # of the lower edge's middle below the mud's nominal surface; negative above it
    depth_velocity_m_s: float


class FlipperLoad(NamedTuple):
    """The mud's load on one flipper: torques about its joints, the force of the configured map, and the depth."""

    sweep_torque_nm: float
    adduction_torque_nm: float
    force_x_n: float  # forward
    force_z_n: float  # up
    depth_m: float


NO_LOAD = FlipperLoad(UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN)


STANCES = ("unknown", "yield", "mixed", "limited_by_motor", "limited_by_body")  # what set the force of a stance


class Estimate(NamedTuple):
    """One coefficient, at the depth and the speed of its stroke, with two standard errors.

    `std_error` contains everything: publish it. `repeatability` contains only what differs between the strides of one
    session in one mud: compare strides by it. `reason` says why a value is invalid, only a lower bound, or ambiguous.
    """

    value: float  # N/m³
    std_error: float  # N/m³
    samples: int  # distinct ones
    valid: bool
    reason: str = ""
    at_least: bool = False  # the mud did not yield: the value is a lower bound
    repeatability: float = UNKNOWN  # N/m³
    depth_m: float = UNKNOWN  # deepest point of the stroke below the mud's surface
    speed_m_s: float = UNKNOWN  # of the flipper in the stroke; of k_s through the mud


@dataclass(frozen=True, slots=True)
class StrideEstimate:
    """The result of one stride of one flipper."""

    flipper: str
    index: int
    t_start_s: float
    t_end_s: float
    insertion_s: float
    stance_s: float
    extraction_s: float
    k_p: Estimate
    k_s: Estimate
    k_e: Estimate
    surface_m: float  # depth of the mud's surface below its nominal height
    depth_m: float  # deepest point reached below that surface
    released: bool  # out of the mud without a recovery, before swing began
    insertion_force_n: float  # largest upward force in insertion
    stance_force_n: float  # largest forward force in stance
    extraction_force_n: float  # most negative upward force in extraction
    step_m: float  # the body's advance since the stride before; NaN without a pose
    surface_std_error_m: float = UNKNOWN
    other_surface_m: float = UNKNOWN  # where the strokes of the trial find two, as in and next to a hole; else NaN
    position_m: float = UNKNOWN  # of the body along the track when the insertion ended; NaN without a pose
    stance: str = STANCES[0]
    yield_force_n: float = UNKNOWN  # across the plate while the mud yielded, at the depth of k_s; NaN where it did not
    yield_force_std_error_n: float = UNKNOWN  # between strides of one session
    tare_n: float = UNKNOWN  # weight of what clings to the flipper; an offset below zero is no weight
    tare_drift_n: float = UNKNOWN  # since the stride before
    extraction_torque_nm: float = UNKNOWN  # largest of the mud on the adduction joint during the extraction


class BodyPose(NamedTuple):
    """The body's position along the track, from motion capture or a rail encoder."""

    stamp_s: float = NEVER_S
    x_m: float = UNKNOWN
