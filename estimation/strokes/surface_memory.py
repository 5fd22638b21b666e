"""The surface of a trial: the insertions' surfaces, combined with the nominal height and with each other.

k_s depends on the square of depth, so a surface that scatters from stroke to stroke scatters k_s. A stroke's surface is

    s_i = m + δ_i      δ_i ~ N(0, σ²)      found_i = s_i + ε_i      ε_i ~ N(0, e_i²)

with m the trial's offset, σ the configured error of the nominal height and e_i the error of the find, in which the law
of the force and a delay of up to one gap between samples of angle and current have a part. Where the surfaces found
scatter more than both explain, one of them is too small by Birge's ratio r, at least 1:

    on a fixed base     e_i → r e_i: the surface belongs to the trial, and the find is in error. In the authors' bench
                        logs the finds scatter by 3 to 4 mm, claim 0.6 to 2, and ln k_s follows them (correlation 0.92)
    on a free body      σ → r σ for δ: the body sinks, pitches, and steps into its own holes

The finds of a trial share the error of the law and of the delay, so their mean is no better than one of them. Three or
more of them that lie CONTRADICTION errors off the nominal height show that the height is wrong, and replace it.
"""

from math import hypot, sqrt

from estimation.strokes.surface import NO_SURFACE, Surface

SHARPEST_M = 1e-5  # smallest standard error: no mud is smoother
REMEMBERED = 8  # strokes: the body sinks and the track is uneven
CONTRADICTION = 3.0  # standard errors of the mean
FEWEST = 3  # finds that can refute the nominal height


class SurfaceMemory:
    """Owns the sums over the surfaces found by one flipper in a trial."""

    def __init__(self, nominal_error_m: float, fixed_base: bool) -> None:
        self.nominal_error_m = nominal_error_m
        self.fixed_base = fixed_base
        self.reset()

    def reset(self) -> None:
        self._finds = self._weight = self._moment = self._square = 0.0

    def update(self, found: Surface, sample_m: float) -> Surface:
        """Return the surface of a stroke; `sample_m` is the travel between two samples of its insertion."""
        nominal_m2 = self.nominal_error_m**2
        offset_m = self._offset_m()
        if not found.found:
            scatter_m2 = nominal_m2 if self.fixed_base else self._ratio() * nominal_m2
            return found._replace(depth_m=offset_m, std_error_m=sqrt(scatter_m2))
        own_m2 = max(hypot(found.std_error_m, found.law_error_m, sample_m / sqrt(3.0)), SHARPEST_M) ** 2
        self._remember(found.depth_m, 1.0 / (own_m2 + nominal_m2))
        if self.fixed_base:
            own_m2 *= self._ratio()
        else:
            nominal_m2 *= self._ratio()
        fraction = nominal_m2 / (nominal_m2 + own_m2)
        depth_m = offset_m + fraction * (found.depth_m - offset_m)
        return found._replace(depth_m=depth_m, std_error_m=sqrt(fraction * own_m2))

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


def unknown_surface(nominal_error_m: float) -> Surface:
    """Return the surface before any insertion: at its nominal height."""
    return NO_SURFACE._replace(depth_m=0.0, std_error_m=nominal_error_m)
