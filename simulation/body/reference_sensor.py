"""The simulator's reference sensor: the true strokes of the flippers, for a load cell to repeat.

It reads the plant, not the drives: true angles, velocities and surface, once in every tick of the loop, together with
the phase that was commanded for that tick. It closes a stride when swing or insertion follows the last of its three
strokes; a stride that a rest interrupts or follows does not count. Speeds are those of the middle of the plate's lower
edge relative to the mud, so they include the body's motion.

In a stance the means are those of the plate while the mud yields: in the ticks with slip, once the plate has been
displaced by the distance over which mud yields. (It rests at both ends of its arc, where it is 1 to 3 mm shallower, and
mud loses 2 % of its k_s with each millimetre.) In a stance in which it moves to and fro by less, they are those of all.
"""

from dataclasses import dataclass
from math import inf, sqrt
from typing import NamedTuple

from control.records import TWO_FLIPPERS, UNKNOWN, Phase, Rig
from simulation.body.plant import Arm, Plant
from simulation.mud.ground_contact import Ground
from simulation.mud.mud_springs import SIDEWAYS_YIELD_M

SLIPPING_M_S = 0.02  # slower motion is the mud's elastic yield
STROKES = (Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION)
BORDERS = (Phase.SWING, Phase.INSERTION, Phase.REST)


class StrokeTruth(NamedTuple):
    """The part of a stroke with the lower edge in the mud; NaN where there was none."""

    sweep_rad: float  # mean
    adduction_rad: float  # mean
    deepest_m: float  # below the true surface
    speed_m_s: float  # mean over the distance; in stance backward along the track, over the ticks with slip
    slip_m: float  # in stance: the distance in all ticks with slip; NaN in the other strokes
    mean_depth_m: float
    path_m: float = 0.0  # of the edge through the mud, in any direction


@dataclass(frozen=True, slots=True)
class StrideTruth:
    flipper: str
    index: int  # counts complete strides from 0
    ground: Ground  # with the firmness that earlier strokes left, when the flipper came in
    surface_m: float  # below its nominal height
    insertion: StrokeTruth
    stance: StrokeTruth
    extraction: StrokeTruth


class FlipperSnapshot(NamedTuple):
    """One flipper at one time."""

    sweep_rad: float
    adduction_rad: float
    depth_m: float  # of the lower edge's middle below the true surface
    forward_m_s: float
    speed_m_s: float


def snapshot_of(arm: Arm, body_m_s: float) -> FlipperSnapshot:
    geometry, angles_rad = arm.parameters.geometry, (arm.sweep_rad, arm.adduction_rad)
    x_sweep, x_adduction, y_sweep, y_adduction, z_sweep, z_adduction = geometry.jacobian(*angles_rad)
    sweep_rad_s, adduction_rad_s = arm.sweep_velocity_rad_s, arm.adduction_velocity_rad_s
    forward_m_s = x_sweep * sweep_rad_s + x_adduction * adduction_rad_s + body_m_s
    outward_m_s = y_sweep * sweep_rad_s + y_adduction * adduction_rad_s
    upward_m_s = z_sweep * sweep_rad_s + z_adduction * adduction_rad_s
    speed_m_s = sqrt(forward_m_s**2 + outward_m_s**2 + upward_m_s**2)
    return FlipperSnapshot(*angles_rad, geometry.depth_m(*angles_rad) - arm.surface_m, forward_m_s, speed_m_s)


class StrokeSums:
    """Owns the running sums of one stroke."""

    def __init__(self, phase: Phase) -> None:
        self.phase = phase
        self.reset()

    def reset(self) -> None:
        self._deepest_m, self._slip_m, self._path_m = -inf, 0.0, 0.0
        self._to_yield_m = SIDEWAYS_YIELD_M
        self._begin_means()

    def _begin_means(self) -> None:
        self._ticks = 0
        self._sweep = self._adduction = self._depths_m = self._speed_m2_s = self._counted_m = 0.0

    def update(self, dt_s: float, snapshot: FlipperSnapshot) -> None:
        if snapshot.depth_m <= 0.0:
            return
        self._deepest_m = max(self._deepest_m, snapshot.depth_m)
        self._path_m += dt_s * snapshot.speed_m_s
        if self.phase is Phase.STANCE:
            self._shear(dt_s, snapshot)
        else:
            self._add(dt_s, snapshot, snapshot.speed_m_s)

    def _shear(self, dt_s: float, snapshot: FlipperSnapshot) -> None:
        """Add a tick of a stance; once the mud yields, only one with slip."""
        forward_m_s, had_yielded = snapshot.forward_m_s, self._to_yield_m <= 0.0
        speed_m_s = -forward_m_s if forward_m_s < -SLIPPING_M_S else 0.0
        self._slip_m += dt_s * speed_m_s
        if not had_yielded:
            self._to_yield_m = min(self._to_yield_m + dt_s * forward_m_s, SIDEWAYS_YIELD_M)
            if self._to_yield_m <= 0.0:
                self._begin_means()
        if speed_m_s or not had_yielded:
            self._add(dt_s, snapshot, speed_m_s)

    def _add(self, dt_s: float, snapshot: FlipperSnapshot, speed_m_s: float) -> None:
        self._ticks += 1
        self._sweep += snapshot.sweep_rad
        self._adduction += snapshot.adduction_rad
        self._depths_m += snapshot.depth_m
        self._speed_m2_s += dt_s * speed_m_s * speed_m_s
        self._counted_m += dt_s * speed_m_s

    def truth(self) -> StrokeTruth:
        if not self._ticks:
            return StrokeTruth(UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN)
        return StrokeTruth(
            self._sweep / self._ticks,
            self._adduction / self._ticks,
            self._deepest_m,
            self._speed_m2_s / self._counted_m if self._counted_m > 0.0 else UNKNOWN,
            self._slip_m if self.phase is Phase.STANCE else UNKNOWN,
            self._depths_m / self._ticks,
            self._path_m,
        )


class FlipperReference:
    """Owns the sums over the current stride of one flipper."""

    def __init__(self, flipper: str) -> None:
        self.flipper = flipper
        self._sums = {phase: StrokeSums(phase) for phase in STROKES}
        self.reset()

    def reset(self) -> None:
        for sums in self._sums.values():
            sums.reset()
        self._entered: tuple[Ground, float] | None = None

    def update(self, dt_s: float, arm: Arm, body_m_s: float, phase: Phase) -> None:
        sums = self._sums.get(phase)
        if sums is None:
            return
        snapshot = snapshot_of(arm, body_m_s)
        sums.update(dt_s, snapshot)
        if self._entered is None and snapshot.depth_m > 0.0:
            self._entered = (arm.contact.plate.as_met(arm.ground), arm.surface_m)

    def truth(self, index: int, arm: Arm) -> StrideTruth:
        ground, surface_m = self._entered or (arm.ground, arm.surface_m)
        insertion, stance, extraction = (self._sums[phase].truth() for phase in STROKES)
        return StrideTruth(self.flipper, index, ground, surface_m, insertion, stance, extraction)


class StrokeReference:
    """Owns the count of strides, and the phases of the current stride so far."""

    def __init__(self, rig: Rig = TWO_FLIPPERS) -> None:
        self._flippers = [FlipperReference(flipper) for flipper in rig.flippers]
        self.reset()

    def reset(self) -> None:
        """Return to the start of a walk."""
        self.index = 0
        self._phase = Phase.REST
        self._start_stride()

    def _start_stride(self) -> None:
        self._phases: set[Phase] = set()
        for flipper in self._flippers:
            flipper.reset()

    def step(self, dt_s: float, plant: Plant, phase: Phase) -> list[StrideTruth]:
        """Return the strides that this phase has closed: one of each flipper, or none."""
        closed: list[StrideTruth] = []
        if phase is not self._phase and phase in BORDERS:
            closed = self._close(plant) if phase is not Phase.REST and self._phases.issuperset(STROKES) else []
            self._start_stride()
        self._phase = phase
        self._phases.add(phase)
        for flipper, arm in zip(self._flippers, plant.arms, strict=True):
            flipper.update(dt_s, arm, plant.body_m_s, phase)
        return closed

    def _close(self, plant: Plant) -> list[StrideTruth]:
        self.index += 1
        return [flipper.truth(self.index - 1, arm) for flipper, arm in zip(self._flippers, plant.arms, strict=True)]
