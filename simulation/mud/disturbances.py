"""Disturbances that the authors' logs show and a clay without memory lacks, each switched off by 0.

Measured in the authors' raw logs, where not stated otherwise:

    clinging     the adduction motor carries 0.4 to 1 N more in swing from the first extraction on: mud sticks to the
                 plate. Each extraction leaves another amount, here drawn uniformly within 40 % of the mean. Its weight
                 acts in the middle of the plate's wet part, 15 mm above the edge. It has no inertia here.
    shaking off  a part of that weight falls off on the way down to the next stroke, in proportion to the way from the
                 highest point since the extraction: 0.3 in the mean over 19 strokes of four trials of one mud, from 0
                 to 0.7; in one log of another 1.28 N at the end of the swing are 0.46 +- 0.37 N just above the mud.
                 Through the second half of the swing the weight stays within 0.1 N
    remoulding   a stroke at the same position as n earlier ones finds 0.5 + 0.5 exp(-0.4 n) of the strength (a law of
                 the Einav-Randolph kind; the logs have 15 to 20 % a stroke and a half of the slope after five)
    relaxation   a hold of 3 s after insertion loses 10 to 15 % of the load, most of it in half a second
    surface      a new, normally distributed height for every stride of a flipper; not measured
    trial        an offset of the surface of the whole trial, common to both flippers. If it explained the whole scatter
                 of k_s in the first strokes of one mud, 3.6 to 5.2 % with the surface held at its nominal height, it
                 would be 0.5 to 0.8 mm at 6.5 % a millimetre: k_s goes with the square of a depth of 3 cm
    friction     dry, against the direction of motion. Half the difference between both directions at the same angle, in
                 air: 0.05 to 0.06 N·m in the sweep joints and 0.045 in the adduction joints in September 2024, 0.01 in
                 both in June and August. It adds to the plant's own. An estimator has to withstand the larger one,
                 which is that of LAB. TRACKWAY has the smaller one: with the larger one no mud has the speeds of
                 Table I (docs/explanation/depth.md)
    play         of belts between motor and joint (simulation/body/belt.py); the authors' robots have none
    drives       current noise of 0.1 to 0.3 A; 50 to 210 distinct states a second; a clip of the current

Infrequent messages disturb more than the estimator here, where the joints' loop is closed over the bus: with the
default gains it rings from a period of 5 ms on and oscillates by itself from 7 ms on. LAB therefore leaves the period
to the drives. A test that wants repeated samples in the estimator alone repeats them after the loop.

A stroke is a stay in the mud that reached 5 mm. When the plate has left the mud, new amounts are drawn for the next
stroke. The draws do not depend on which disturbances are on.
"""

from dataclasses import dataclass, replace
from math import cos, exp, hypot, sin
from random import Random
from typing import Annotated

from control.bounds import Bounds
from control.geometry import FlipperGeometry

STROKE_M = 0.005
SAME_POSITION_M = 0.015
CLINGING_SPREAD = 0.4
CLINGING_ABOVE_EDGE_M = 0.015
SHORTEST_FALL_M = 0.005  # over which the fraction falls off, where the plate has hardly risen
REMOULDED_FRACTION = 0.5  # of the strength that can be lost
REMOULDING_RATE = 0.4  # per stroke


@dataclass(frozen=True)
class Disturbances:
    clinging_n: Annotated[float, Bounds(0.0, 10.0)] = 0.0  # mean weight of the mud on one plate
    remoulding: Annotated[float, Bounds(0.0, 1.0)] = 0.0  # 1: as above
    relaxation: Annotated[float, Bounds(0.0, 0.9)] = 0.0  # fraction of the load
    surface_sd_m: Annotated[float, Bounds(0.0, 0.01)] = 0.0
    current_noise_a: Annotated[float, Bounds(0.0, 10.0)] = 0.0  # 0: the drive's own
    sample_period_s: Annotated[float, Bounds(0.0, 1.0)] = 0.0  # of angle, and of current; 0: the drive's own
    current_limit_a: Annotated[float, Bounds(0.0, 200.0)] = 0.0  # of the motor itself; 0: none
    shaken_fraction: Annotated[float, Bounds(0.0, 1.0)] = 0.0  # of the clinging weight
    trial_surface_sd_m: Annotated[float, Bounds(0.0, 0.01)] = 0.0
    sweep_friction_nm: Annotated[float, Bounds(0.0, 0.5)] = 0.0
    adduction_friction_nm: Annotated[float, Bounds(0.0, 0.5)] = 0.0
    play_deg: Annotated[float, Bounds(0.0, 5.0)] = 0.0  # of the belts between motors and joints

    @property
    def surface_error_m(self) -> float:
        """The standard deviation of one stroke's surface from the nominal height."""
        return hypot(self.surface_sd_m, self.trial_surface_sd_m)


NONE = Disturbances()
LAB = Disturbances(
    clinging_n=0.7,
    remoulding=1.0,
    relaxation=0.13,
    surface_sd_m=0.0015,
    current_noise_a=0.2,
    sample_period_s=0.0,
    current_limit_a=19.98,
    shaken_fraction=0.3,
    trial_surface_sd_m=0.0008,
    sweep_friction_nm=0.05,
    adduction_friction_nm=0.045,
)
TRACKWAY = replace(LAB, sweep_friction_nm=0.01, adduction_friction_nm=0.01)


# The drives' parameters that each disturbance sets.
DRIVE_FIELDS = {
    "current_noise_a": ("current_noise_a",),
    "sample_period_s": ("encoder_period_s", "current_period_s"),
    "current_limit_a": ("motor_current_limit_a",),
}


def drive_changes(disturbances: Disturbances) -> dict[str, float]:
    """Return the drives' parameters that differ from their own."""
    changes = {name: getattr(disturbances, source) for source, names in DRIVE_FIELDS.items() for name in names}
    return {name: value for name, value in changes.items() if value}


def clinging_torques_nm(
    geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float, weight_n: float
) -> tuple[float, float]:
    """Return the torque -W ∂z/∂q of a weight on (sweep, adduction), with z = l cos α sin β + (s - h) cos β."""
    length_m, below_arm_m = geometry.flipper_length_m, geometry.drop_m - CLINGING_ABOVE_EDGE_M
    lever_m = length_m * cos(sweep_rad) * cos(adduction_rad) + below_arm_m * sin(adduction_rad)
    return weight_n * length_m * sin(sweep_rad) * sin(adduction_rad), -weight_n * lever_m


class StrokeHistory:
    """Owns the effects of one flipper's earlier strokes, and the height at which it meets the mud."""

    def __init__(self, disturbances: Disturbances, seed: int, trial_surface_m: float = 0.0) -> None:
        """`trial_surface_m`: how far the surface of the whole trial lies below the nominal height."""
        self.disturbances = disturbances
        self.trial_surface_m = trial_surface_m
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        self._random = Random(self._seed)
        self.clinging_n = self._pulled_out_n = self._shaken = self._highest_m = 0.0
        self.firmness = 1.0  # the remaining fraction of the strength at the position of the current stroke
        self.surface_m = self._next_surface_m = self._draw_surface_m()
        self._worked_m: list[float] = []  # positions along the track
        self._in_mud = False
        self._entered_m = self._deepest_m = 0.0

    def step(self, lowest_m: float, position_m: float) -> None:
        """`lowest_m`: depth of the plate's lowest point below the track's own surface; `position_m` along the track."""
        submerged_m = lowest_m - self.surface_m
        if submerged_m > 0.0:
            if not self._in_mud:
                self._enter(position_m)
            self._deepest_m = max(self._deepest_m, submerged_m)
            return
        if self._in_mud:
            self._leave(lowest_m)
        elif lowest_m <= self._next_surface_m:  # the surface does not rise over a plate that has just left
            self.surface_m = self._next_surface_m
        self._shake_off(lowest_m)

    def _shake_off(self, lowest_m: float) -> None:
        """Find how much of the way down from its highest point the plate has gone; what fell off does not return."""
        self._highest_m = min(self._highest_m, lowest_m)
        way_m = max(self.surface_m - self._highest_m, SHORTEST_FALL_M)
        self._shaken = max(self._shaken, (lowest_m - self._highest_m) / way_m)
        self.clinging_n = self._pulled_out_n * (1.0 - self.disturbances.shaken_fraction * self._shaken)

    def _enter(self, position_m: float) -> None:
        self._in_mud = True
        self._entered_m, self._deepest_m = position_m, 0.0
        earlier = sum(abs(position_m - worked_m) <= SAME_POSITION_M for worked_m in self._worked_m)
        lost_fraction = REMOULDED_FRACTION * (1.0 - exp(-REMOULDING_RATE * earlier))
        self.firmness = 1.0 - self.disturbances.remoulding * lost_fraction

    def _leave(self, lowest_m: float) -> None:
        self._in_mud = False
        if self._deepest_m < STROKE_M:
            return
        self._worked_m.append(self._entered_m)
        spread = self._random.uniform(-CLINGING_SPREAD, CLINGING_SPREAD)
        self._pulled_out_n = self.disturbances.clinging_n * (1.0 + spread)
        self._shaken, self._highest_m = 0.0, lowest_m
        self._next_surface_m = self._draw_surface_m()

    def _draw_surface_m(self) -> float:
        """Draw how far the surface lies below the nominal height."""
        return self.trial_surface_m + self._random.gauss(0.0, self.disturbances.surface_sd_m)
