"""The surface of a trial: the insertions' surfaces, combined with the nominal height and with each other.

k_s depends on the square of depth, so a surface that scatters from stroke to stroke scatters k_s. A stroke's surface is

    s_i = m + δ_i      δ_i ~ N(0, σ²)      found_i = s_i + ε_i      ε_i ~ N(0, e_i²)

with m the trial's offset, σ the configured error of the nominal height and e_i the error of the find, in which the law
of the force and a delay of up to one gap between samples of angle and current have a part. Where the surfaces found
scatter more than both explain, one of them is too small by Birge's ratio r, at least 1:

    on a fixed base     e_i → r e_i: the surface belongs to the trial, and the find is in error. In the authors' bench
                        logs the finds scatter by 3 to 4 mm, claim 0.6 to 2, and ln k_s follows them (correlation 0.92)
    on a free body      σ → r σ for δ: the body sinks, pitches, and steps into its own holes

The error of s_i has two parts. On a fixed base the strokes of a set-up share its levelling, and only the find moves the
surface from stroke to stroke: own_error_m is what of ε_i enters s_i. A free body meets another surface in each stride,
so there all of the error is the stroke's own. It may also step into a hole that it left: a find that lies below the
trial's highest one by more than HOLE errors of both is the mud's surface or the bottom of a hole. The surface may be
anywhere between them with equal probability, √(1/3) of the distance from the find.

The finds of a trial share the error of the law and of the delay, so their mean is no better than one of them. Three or
more of them that lie CONTRADICTION errors off the nominal height show that the height is wrong, and replace it.

A trial can have two surfaces: a flipper steps into its own hole and next to it, or on a crust and through it. Then the
finds contradict one surface (χ² that chance exceeds in one trial of twenty), and two of at least two finds each explain
0.85 of it, where halves of normal scatter explain 2/π. The errors are those of each find and of the nominal height, not
those that all finds share. One mean would be at neither surface, so the other one is reported. Of 100 trials of four to
eight finds with two surfaces six errors apart 92 are found. One surface is taken for two in 1 of 100, and where errors
are twice those claimed, in 13 to 18.
"""

from collections import deque
from collections.abc import Sequence
from math import hypot, inf, sqrt
from typing import NamedTuple

from control.computing.exact_sum import exact_sum
from control.records import UNKNOWN
from estimation.strokes.surface import NO_SURFACE, Surface

SHARPEST_M = 1e-5  # smallest standard error: no mud is smoother
REMEMBERED = 8  # strokes: the body sinks and the track is uneven
CONTRADICTION = 3.0  # standard errors of the mean
FEWEST = 3  # finds that can refute the nominal height
FEWEST_OF_TWO = 2  # finds of either of two surfaces
EXPLAINED = 0.85  # of χ² by two surfaces
HOLE = 3.0  # standard errors: one find in 700 lies so far below the highest of the trial by chance
FIVE_PERCENT = 1.645  # quantile of the normal distribution


class Find(NamedTuple):
    depth_m: float
    weight: float  # 1/m²


class SurfaceMemory:
    """Owns the sums over the surfaces found by one flipper in a trial."""

    def __init__(self, nominal_error_m: float, fixed_base: bool) -> None:
        self.nominal_error_m = nominal_error_m
        self.fixed_base = fixed_base
        self.reset()

    def reset(self) -> None:
        self._finds = self._weight = self._moment = self._square = 0.0
        self._recent: deque[Find] = deque(maxlen=REMEMBERED)
        self._highest = Find(inf, inf)

    def update(self, found: Surface, sample_m: float) -> Surface:
        """Return the surface of a stroke; `sample_m` is the travel between two samples of its insertion."""
        nominal_m2 = self.nominal_error_m**2
        offset_m = self._offset_m()
        if not found.found:
            error_m = sqrt(nominal_m2 if self.fixed_base else self._ratio() * nominal_m2)
            return found._replace(
                depth_m=offset_m, std_error_m=error_m, own_error_m=0.0 if self.fixed_base else error_m
            )
        own_m2 = max(hypot(found.std_error_m, found.law_error_m, sample_m / sqrt(3.0)), SHARPEST_M) ** 2
        self._remember(found.depth_m, 1.0 / (own_m2 + nominal_m2))
        alone_m2 = max(found.std_error_m, SHARPEST_M) ** 2  # without the errors that the finds share
        self._recent.append(Find(found.depth_m, 1.0 / (alone_m2 + nominal_m2)))
        if self.fixed_base:
            own_m2 *= self._ratio()
        else:
            nominal_m2 *= self._ratio()
        fraction = nominal_m2 / (nominal_m2 + own_m2)
        depth_m = offset_m + fraction * (found.depth_m - offset_m)
        error_m = sqrt(fraction * own_m2)
        if self.fixed_base:
            own_error_m = fraction * sqrt(own_m2)
        else:
            own_error_m = error_m = hypot(error_m, self._hole_m(Find(found.depth_m, 1.0 / own_m2)))
        return found._replace(
            depth_m=depth_m,
            std_error_m=error_m,
            own_error_m=own_error_m,
            other_m=other_surface_m(self._recent),
        )

    def _hole_m(self, find: Find) -> float:
        """Return the error of a find that may be the bottom of a hole; 0 for one that is no deeper than the others."""
        self._highest = min(self._highest, find)
        below_m = find.depth_m - self._highest.depth_m
        errors_m = sqrt(1.0 / find.weight + 1.0 / self._highest.weight)
        return below_m / sqrt(3.0) if below_m > HOLE * errors_m else 0.0

    def _remember(self, depth_m: float, weight: float) -> None:
        fading = 1.0 - 1.0 / REMEMBERED if self._finds >= REMEMBERED else 1.0
        self._finds = fading * self._finds + 1.0
        self._weight = fading * self._weight + weight
        self._moment = fading * self._moment + weight * depth_m
        self._square = fading * self._square + weight * depth_m * depth_m

    def _ratio(self) -> float:
        """Return r²: about the finds' own mean on a fixed base, and about the nominal height for a body that sinks."""
        if self._finds == 0.0:
            return 1.0
        if self.fixed_base and self._finds > 1.0:
            return max(1.0, (self._square - self._moment**2 / self._weight) / (self._finds - 1.0))
        return max(1.0, self._square / self._finds)

    def _offset_m(self) -> float:
        """Return the trial's offset from the nominal height."""
        if self._finds == 0.0:
            return 0.0
        weight = self._weight / self._finds / self._ratio()
        mean_m, nominal_m2 = self._moment / self._weight, self.nominal_error_m**2
        if self._finds >= FEWEST and mean_m**2 > CONTRADICTION**2 * (1.0 / weight + nominal_m2):
            nominal_m2 = mean_m**2
        return mean_m * weight / (weight + 1.0 / nominal_m2)


def other_surface_m(finds: Sequence[Find]) -> float:
    """Return the surface of the half of the finds to which the last one does not belong; NaN where all agree."""
    total = chi_square(finds) if finds else 0.0
    if len(finds) < 2 * FEWEST_OF_TWO or total <= largest_chi_square(len(finds) - 1):
        return UNKNOWN
    ordered = sorted(finds)
    halves = [(ordered[:i], ordered[i:]) for i in range(FEWEST_OF_TWO, len(ordered) - FEWEST_OF_TWO + 1)]
    scatter, upper, lower = min([(chi_square(a) + chi_square(b), a, b) for a, b in halves])
    if scatter > (1.0 - EXPLAINED) * total:
        return UNKNOWN
    return mean_m(lower if finds[-1] in upper else upper)


def mean_m(finds: Sequence[Find]) -> float:
    return exact_sum([find.weight * find.depth_m for find in finds]) / exact_sum([find.weight for find in finds])


def chi_square(finds: Sequence[Find]) -> float:
    """Return the square of the scatter about the mean, in units of the claimed errors."""
    middle_m = mean_m(finds)
    return exact_sum([find.weight * (find.depth_m - middle_m) ** 2 for find in finds])


def largest_chi_square(freedom: int) -> float:
    """Return the value that χ² exceeds by chance once in twenty times (Wilson and Hilferty 1931)."""
    spread = 2.0 / (9.0 * freedom)
    root = 1.0 - spread + FIVE_PERCENT * sqrt(spread)
    return freedom * root * root * root


def unknown_surface(nominal_error_m: float) -> Surface:
    """Return the surface before any insertion: at its nominal height."""
    return NO_SURFACE._replace(depth_m=0.0, std_error_m=nominal_error_m, own_error_m=nominal_error_m)
