"""Where the mud begins: the surface of one insertion, from the force's own course, with its standard error.

Above the mud the force is level; in it, it is a line in depth. For every possible border between two batches two
shapes are fitted. Mud that bears at once (end bearing) makes the force jump: a level, and a line of its own below.
Mud whose force rises from nothing makes a kink: the line starts at the level, at the depth that fits best. (That is
slope and intercept of section 4 of the physics, which has no bias however soft the mud. The paper's trigger at 0.5 N
is 0.5 N over the slope too deep.) Which one it is, the residuals tell: each shape weighs exp(-½ residual/variance),
with Akaike's price for the jump's one more number. The surface is their mean; its doubt is theirs and their
disagreement. Doubt of a jump is the range of borders that are hardly worse (a likelihood interval), of a kink that
of the intercept.

One insertion tells the surface to a millimetre or so, and k_s goes with the square of depth. So what it tells is
weighed against the nominal height of the mud by the precision of each.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, hypot, inf, sqrt
from operator import mul
from typing import NamedTuple

from control.records import UNKNOWN
from estimation.strokes.origin_fit import NORMAL_MAD, median

MIN_ABOVE, MIN_BELOW = 2, 4  # batches
FREEDOM = 2.0  # residual variances that a jump must save for its one more number, as by Akaike
CLEAR = 12.0  # F of border and line against a level alone, from which there is mud at all
LIKELY = 4.0  # residual variances that a border may be worse and still be in doubt
LEAST_VARIANCE_N2 = 1e-12
SHARPEST_M = 1e-5  # no mud is smoother
REACH = 2  # batches to either side: one wild sample is in two loads, and so in two batches at most
WILD = 6.0  # standard deviations
LARGEST_EXPONENT = 50.0  # exp() of more says no more


class Surface(NamedTuple):
    depth_m: float
    std_error_m: float
    level_n: float  # force above the mud: what is left of the zero
    level_std_error_n: float
    found: bool


NO_SURFACE = Surface(UNKNOWN, UNKNOWN, 0.0, inf, False)


def combined(surface: Surface, expected_error_m: float, sample_m: float) -> Surface:
    """With what is known beforehand: the surface lies at its nominal height, give or take `expected_error_m`.

    `sample_m` is the way between two samples, which is how far angle and current may be apart (evenly distributed).
    """
    if not surface.found:
        return surface._replace(depth_m=0.0, std_error_m=expected_error_m)
    error_m = max(hypot(surface.std_error_m, sample_m / sqrt(12.0)), SHARPEST_M)
    reported = 1.0 / (error_m * error_m)
    expected = 1.0 / (expected_error_m * expected_error_m)
    weight = reported / (reported + expected)
    return surface._replace(depth_m=weight * surface.depth_m, std_error_m=1.0 / sqrt(reported + expected))


def find_surface(depths_m: Sequence[float], forces_n: Sequence[float]) -> Surface:
    """From the batches of one insertion, deeper and deeper; one that leads upward tells nothing."""
    n = len(depths_m)
    if n < MIN_ABOVE + MIN_BELOW or depths_m[0] >= depths_m[-1]:
        return NO_SURFACE
    if not sum([force_n * force_n for force_n in forces_n]) < inf:
        return NO_SURFACE
    tame_n = tamed(forces_n)
    mean_n = sum(tame_n) / n
    surface = _mud_begins(depths_m, [force_n - mean_n for force_n in tame_n])
    return surface._replace(level_n=surface.level_n + mean_n) if surface.found else surface


def tamed(forces_n: Sequence[float]) -> list[float]:
    """A batch far from the median of its neighbours takes their median (Hampel's filter).

    Borders and lines are their own medians, so nothing is flattened; noise stays as it is, and with it all doubt.
    """
    own = list(forces_n)
    medians_n = own[:REACH] + [median(own[i - REACH : i + REACH + 1]) for i in range(REACH, len(own) - REACH)]
    medians_n += own[len(own) - REACH :]
    bends_n = [abs(a - 2.0 * b + c) for a, b, c in zip(own, own[1:], own[2:], strict=False)]  # of noise, √6 of it
    wild_n = WILD * NORMAL_MAD * median(bends_n) / sqrt(6.0)
    return [b if abs(a - b) > wild_n else a for a, b in zip(own, medians_n, strict=True)]


def _mud_begins(x: Sequence[float], y: Sequence[float]) -> Surface:
    """The mean of `y` is zero."""
    square = sum([force_n * force_n for force_n in y])
    jumps, kinks, kinks_m = _explained(x, y)
    largest, best = max(jumps), max(kinks)
    variance = max((square - largest) / max(len(x) - 4, 1), LEAST_VARIANCE_N2)
    jump, jump_n, slope_n_m = _jump(x, y, jumps, variance)
    if largest < CLEAR * 2.0 * variance or (slope_n_m < 0.0 and jump.level_n > 0.0):
        return NO_SURFACE
    if not (slope_n_m > 0.0 and best > 0.0):
        return jump
    place = kinks.index(best)
    border = place + MIN_ABOVE
    border += kinks_m[place] >= x[border]  # a batch right at the kink counts as above, from whichever border it is met
    kink = _kink(x, y, border, kinks_m[place], square - best)
    saved = (largest - best) / variance - FREEDOM if jump_n > 0.0 else -inf
    return _mean(jump, kink, 1.0 / (1.0 + exp(min(-saved / 2.0, LARGEST_EXPONENT))))


def _explained(x: Sequence[float], y: Sequence[float]) -> tuple[list[float], list[float], list[float]]:
    """Of the sum of squares of `y`, whose mean is zero, for every border from above: by a jump, by a kink, and where
    that kink lies.

    With p = Σxy, q = Σy and a, b, c = Σx², Σx, n below the border, less what the mean takes, a kink at δ explains
    (p - qδ)² / (a - 2bδ + cδ²), which is greatest at δ = (qa - pb) / (qb - pc).
    """
    jumps, kinks, kinks_m = [], [], []
    n, below, sx, q, sxx, p = len(x), 0, 0.0, 0.0, 0.0, 0.0
    for border in range(n - 1, MIN_ABOVE - 1, -1):
        u, v = x[border], y[border]
        below, sx, q, sxx, p = below + 1, sx + u, q + v, sxx + u * u, p + u * v
        if below < MIN_BELOW:
            continue
        above, spread, cross = n - below, sxx - sx * sx / below, p - sx * q / below
        jumps.append(q * q / above + q * q / below + (cross * cross / spread if spread > 0.0 else 0.0))
        a, b, c = sxx - sx * sx / n, sx * above / n, below * above / n
        turn = q * b - p * c
        kink = min(max((q * a - p * b) / turn if turn else u, x[border - 1]), u)
        rise, square = p - q * kink, a + kink * (c * kink - 2.0 * b)
        kinks.append(rise * rise / square if rise > 0.0 < square else 0.0)
        kinks_m.append(kink)
    return jumps[::-1], kinks[::-1], kinks_m[::-1]


def _jump(x: Sequence[float], y: Sequence[float], jumps: list[float], variance: float) -> tuple[Surface, float, float]:
    """The best one with its size, and the slope below it."""
    largest = max(jumps)
    likely = [border for border, square in enumerate(jumps, MIN_ABOVE) if square >= largest - LIKELY * variance]
    border = MIN_ABOVE + jumps.index(largest)
    mean_x, mean_y, slope, _ = _line(x[border:], y[border:])
    edge_m, level_n = (x[border - 1] + x[border]) / 2.0, sum(y[:border]) / border
    error_m = _border_error_m(x, likely[0], likely[-1])
    jump_n = mean_y + slope * (edge_m - mean_x) - level_n
    return Surface(edge_m, error_m, level_n, sqrt(variance / border), True), jump_n, slope


def _border_error_m(depths_m: Sequence[float], first: int, last: int) -> float:
    """A quarter of the likely borders' range, and the even chance within one batch."""
    gap_m = depths_m[last] - depths_m[last - 1]
    range_m = depths_m[last] - depths_m[first]
    return hypot(range_m / 4.0, gap_m / sqrt(12.0))


def _kink(x: Sequence[float], y: Sequence[float], border: int, kink_m: float, residual: float) -> Surface:
    """Its doubt is that of where a line and a level meet."""
    n, below = len(x), len(x) - border
    ways_m = [depth_m - kink_m for depth_m in x[border:]]
    mean_m = sum(ways_m) / n
    slope = sum(map(mul, ways_m, y[border:])) / (sum(map(mul, ways_m, ways_m)) - n * mean_m * mean_m)
    mean_x, _, _, spread = _line(x[border:], y[border:])
    variance = max(residual / max(n - 3, 1), LEAST_VARIANCE_N2)
    error_n = sqrt(variance * (1.0 / border + 1.0 / below + (kink_m - mean_x) ** 2 / spread))
    return Surface(kink_m, error_n / slope, -slope * mean_m, sqrt(variance / border), True)


def _mean(jump: Surface, kink: Surface, fraction: float) -> Surface:
    """`share`: of the jump."""
    rest = 1.0 - fraction

    def uncertainty(own: float, other: float, apart: float) -> float:
        return sqrt(fraction * own * own + rest * other * other + fraction * rest * apart * apart)

    return Surface(
        fraction * jump.depth_m + rest * kink.depth_m,
        uncertainty(jump.std_error_m, kink.std_error_m, jump.depth_m - kink.depth_m),
        fraction * jump.level_n + rest * kink.level_n,
        uncertainty(jump.level_std_error_n, kink.level_std_error_n, jump.level_n - kink.level_n),
        True,
    )


def _line(x: Sequence[float], y: Sequence[float]) -> tuple[float, float, float, float]:
    """Least squares: mean of x and of y, slope, and Σ(x - mean)²."""
    n = len(x)
    mean_x, mean_y = sum(x) / n, sum(y) / n
    spread = sum([(u - mean_x) * (u - mean_x) for u in x])
    if not spread > 0.0:
        return mean_x, mean_y, 0.0, inf
    return mean_x, mean_y, sum([(u - mean_x) * v for u, v in zip(x, y, strict=True)]) / spread, spread
