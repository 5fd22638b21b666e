"""What the flippers truly did in each stride, as far as a load cell needs it to repeat their strokes.

A witness sees the plant, not the drives: true angles, velocities and surface, once in every tick of the loop, with
the phase that was commanded while they came about. It closes a stride when swing, insertion or rest follows the last
of its three strokes; one that rest cuts short does not count. Speeds are those of the middle of the plate's lower
edge relative to the mud, which lies still: the body's motion counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

from control.records import FLIPPERS, UNKNOWN, Phase
from simulation.body.plant import Arm, Plant
from simulation.mud.clay import Clay

SLIPPING_M_S = 0.02  # slower is the mud's give
STROKES = (Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION)
BORDERS = (Phase.SWING, Phase.INSERTION, Phase.REST)


class StrokeTruth(NamedTuple):
    """Of the part of a stroke in which the lower edge was in the mud; NaN where there was none."""

    sweep_rad: float  # mean
    adduction_rad: float  # mean
    deepest_m: float  # below the true surface
    speed_m_s: float  # mean over the way; in stance backward along the track, in the ticks in which it slips
    slip_m: float  # in stance: how far it went back in those ticks; NaN in the other strokes
    mean_depth_m: float


@dataclass(frozen=True, slots=True)
class StrideTruth:
    flipper: str
    index: int  # counts complete strides from 0
    clay: Clay  # as firm as earlier strokes had left it when the flipper came in
    surface_m: float  # below its nominal height
    insertion: StrokeTruth
    stance: StrokeTruth
    extraction: StrokeTruth


class Sight(NamedTuple):
    """One flipper at one moment."""

    sweep_rad: float
    adduction_rad: float
    depth_m: float  # of the lower edge's middle below the true surface
    forward_m_s: float
    speed_m_s: float


def sight_of(arm: Arm, body_m_s: float) -> Sight:
    geometry, angles_rad = arm.parameters.geometry, (arm.sweep_rad, arm.adduction_rad)
    x_sweep, x_adduction, y_sweep, y_adduction, z_sweep, z_adduction = geometry.jacobian(*angles_rad)
    sweep_rad_s, adduction_rad_s = arm.sweep_velocity_rad_s, arm.adduction_velocity_rad_s
    forward_m_s = x_sweep * sweep_rad_s + x_adduction * adduction_rad_s + body_m_s
    outward_m_s = y_sweep * sweep_rad_s + y_adduction * adduction_rad_s
    upward_m_s = z_sweep * sweep_rad_s + z_adduction * adduction_rad_s
    speed_m_s = sqrt(forward_m_s**2 + outward_m_s**2 + upward_m_s**2)
    return Sight(*angles_rad, geometry.depth_m(*angles_rad) - arm.surface_m, forward_m_s, speed_m_s)


class StrokeSums:
    """Owns the running sums of one stroke."""

    def __init__(self, phase: Phase) -> None:
        self.phase = phase
        self.reset()

    def reset(self) -> None:
        self._ticks = 0
        self._sweep = self._adduction = self._depths_m = self._speed_m2_s = self._path_m = 0.0
        self._deepest_m = UNKNOWN

    def update(self, dt_s: float, sight: Sight) -> None:
        if sight.depth_m <= 0.0:
            return
        self._ticks += 1
        self._sweep += sight.sweep_rad
        self._adduction += sight.adduction_rad
        self._depths_m += sight.depth_m
        self._deepest_m = sight.depth_m if self._ticks == 1 else max(self._deepest_m, sight.depth_m)
        speed_m_s = -sight.forward_m_s if self.phase is Phase.STANCE else sight.speed_m_s
        if self.phase is not Phase.STANCE or speed_m_s > SLIPPING_M_S:
            self._speed_m2_s += dt_s * speed_m_s * speed_m_s
            self._path_m += dt_s * speed_m_s

    def truth(self) -> StrokeTruth:
        if not self._ticks:
            return StrokeTruth(UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN)
        return StrokeTruth(
            self._sweep / self._ticks,
            self._adduction / self._ticks,
            self._deepest_m,
            self._speed_m2_s / self._path_m if self._path_m > 0.0 else UNKNOWN,
            self._path_m if self.phase is Phase.STANCE else UNKNOWN,
            self._depths_m / self._ticks,
        )


class FlipperReference:
    """Owns what was seen of one flipper in the stride under way."""

    def __init__(self, flipper: str) -> None:
        self.flipper = flipper
        self._sums = {phase: StrokeSums(phase) for phase in STROKES}
        self.reset()

    def reset(self) -> None:
        for sums in self._sums.values():
            sums.reset()
        self._met: tuple[Clay, float] | None = None

    def look(self, dt_s: float, arm: Arm, body_m_s: float, phase: Phase) -> None:
        sums = self._sums.get(phase)
        if sums is None:
            return
        sight = sight_of(arm, body_m_s)
        sums.update(dt_s, sight)
        if self._met is None and sight.depth_m > 0.0:
            self._met = (arm.clay, arm.surface_m)

    def truth(self, index: int, arm: Arm) -> StrideTruth:
        clay, surface_m = self._met or (arm.clay, arm.surface_m)
        insertion, stance, extraction = (self._sums[phase].truth() for phase in STROKES)
        return StrideTruth(self.flipper, index, clay, surface_m, insertion, stance, extraction)


class StrokeReference:
    """Owns the count of strides, and which strokes of the one under way were seen."""

    def __init__(self) -> None:
        self._flippers = [FlipperReference(flipper) for flipper in FLIPPERS]
        self.reset()

    def reset(self) -> None:
        """As at the start of a walk."""
        self.index = 0
        self._phase = Phase.REST
        self._begin_stride()

    def _begin_stride(self) -> None:
        self._seen: set[Phase] = set()
        for flipper in self._flippers:
            flipper.reset()

    def step(self, dt_s: float, plant: Plant, phase: Phase) -> list[StrideTruth]:
        """Strides that this phase has closed: one of each flipper, or none."""
        closed: list[StrideTruth] = []
        if phase is not self._phase and phase in BORDERS:
            closed = self._close(plant) if phase is not Phase.REST and self._seen.issuperset(STROKES) else []
            self._begin_stride()
        self._phase = phase
        self._seen.add(phase)
        for flipper, arm in zip(self._flippers, plant.arms, strict=True):
            flipper.look(dt_s, arm, plant.body_m_s, phase)
        return closed

    def _close(self, plant: Plant) -> list[StrideTruth]:
        self.index += 1
        return [flipper.truth(self.index - 1, arm) for flipper, arm in zip(self._flippers, plant.arms, strict=True)]
