"""The mud's surface from the force profile of one insertion, with its standard error.

Above the mud the force is constant; in the mud it is linear in depth. For every possible border between two batches two
shapes are fitted. Mud with end bearing makes the force jump: a constant, and an independent line below. Mud whose force
rises from zero makes a kink: the line starts at the constant, at the depth that fits best. (A line's slope and
intercept have no bias however soft the mud is. The paper's trigger at 0.5 N lies too deep by 0.5 N over the slope.) The
residuals weight the shapes: each counts with exp(-½ residual/variance), with Akaike's penalty for the jump's additional
parameter. The surface is their weighted mean; its standard error includes theirs and their difference. A jump is the
mean over all borders, each weighted by its likelihood: the best border alone moves by whole batches where a small
change of the forces, such as a delay of 5 ms, makes another one fit slightly better. The error of a jump is the
standard deviation of the border, that of a kink the intercept's.

One insertion locates the surface to about a millimetre; `SurfaceMemory` (surface_memory.py) combines it with the
nominal height and with the other strokes.
"""

from collections.abc import Sequence
from math import exp, inf, sqrt
from operator import mul
from typing import NamedTuple

from control.computing.bounded_work import Work
from control.computing.exact_sum import exact_sum
from control.records import UNKNOWN
from estimation.strokes.origin_fit import NORMAL_MAD, median

MIN_ABOVE, MIN_BELOW = 2, 4  # batches
FREEDOM = 2.0  # residual variances that a jump must save for its additional parameter, after Akaike
CLEAR = 12.0  # F of border and line against a constant alone; from there on the stroke met mud
LAW_FRACTION = 0.18  # of the depth below a kink: what a force with the exponent 1.5 in place of 1 shifts it
LEAST_VARIANCE_N2 = 1e-12
SHARPEST_M = 1e-5  # smallest standard error: no mud is smoother
REACH = 2  # batches to either side: one outlying sample is in two loads, so in two batches at most
OUTLIER = 6.0  # standard deviations
LARGEST_EXPONENT = 50.0  # avoids overflow of exp()


class Surface(NamedTuple):
    depth_m: float
    std_error_m: float
    level_n: float  # force above the mud: the error of the tare
    level_std_error_n: float
    found: bool
    law_error_m: float = 0.0  # if the force below grows otherwise than in proportion to depth
    other_m: float = UNKNOWN  # the trial's other surface, where its strokes find two (surface_memory.py)
    own_error_m: float = 0.0  # the part of std_error_m that differs between the strokes of a set-up


NO_SURFACE = Surface(UNKNOWN, UNKNOWN, 0.0, inf, False)


def find_surface(depths_m: Sequence[float], forces_n: Sequence[float]) -> Work[Surface]:
    """Find the surface from the batches of one insertion, in order of depth, in bounded units."""
    n = len(depths_m)
    if n < MIN_ABOVE + MIN_BELOW or depths_m[0] >= depths_m[-1]:
        return NO_SURFACE
    if not exact_sum([force_n * force_n for force_n in forces_n]) < inf:
        return NO_SURFACE
    clipped_n = hampel_filtered(forces_n)
    mean_n = exact_sum(clipped_n) / n
    yield
    surface = yield from _mud_begins(depths_m, [force_n - mean_n for force_n in clipped_n])
    return surface._replace(level_n=surface.level_n + mean_n) if surface.found else surface


def hampel_filtered(forces_n: Sequence[float]) -> list[float]:
    """Replace a batch far from the median of its neighbours by that median (Hampel's filter).

    Borders and lines are their own medians, so the filter does not flatten them; ordinary noise passes unchanged, and
    with it the standard errors.
    """
    own = list(forces_n)
    medians_n = own[:REACH] + [median(own[i - REACH : i + REACH + 1]) for i in range(REACH, len(own) - REACH)]
    medians_n += own[len(own) - REACH :]
    bends_n = [abs(a - 2.0 * b + c) for a, b, c in zip(own, own[1:], own[2:], strict=False)]  # of noise, √6 of it
    outlier_n = OUTLIER * NORMAL_MAD * median(bends_n) / sqrt(6.0)
    return [b if abs(a - b) > outlier_n else a for a, b in zip(own, medians_n, strict=True)]


def _mud_begins(x: Sequence[float], y: Sequence[float]) -> Work[Surface]:
    """Choose between no surface, jump and kink; the mean of `y` is zero."""
    square = exact_sum([force_n * force_n for force_n in y])
    jumps, kinks, kinks_m = _explained(x, y)
    yield
    largest, best = max(jumps), max(kinks)
    variance = max((square - largest) / max(len(x) - 4, 1), LEAST_VARIANCE_N2)
    jump, jump_n, slope_n_m = _jump(x, y, jumps, variance)
    yield
    if largest < CLEAR * 2.0 * variance or (slope_n_m < 0.0 and jump.level_n > 0.0):
        return NO_SURFACE
    if not (slope_n_m > 0.0 and best > 0.0):
        return jump
    place = kinks.index(best)
    border = place + MIN_ABOVE
    border += kinks_m[place] >= x[border]  # a batch right at the kink counts as above it
    kink = _kink(x, y, border, kinks_m[place], square - best)
    saved = (largest - best) / variance - FREEDOM if jump_n > 0.0 else -inf
    return _mean(jump, kink, 1.0 / (1.0 + exp(min(-saved / 2.0, LARGEST_EXPONENT))))


def _explained(x: Sequence[float], y: Sequence[float]) -> tuple[list[float], list[float], list[float]]:
    """Return, for every border from above, the sums of squares that a jump and a kink explain, and the kink's depth.

    The mean of `y` is zero.

    With p = Σxy, q = Σy and a, b, c = Σx², Σx, n below the border, corrected for the mean, a kink at δ explains
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
    """Return the mean jump over all borders by their likelihood, its size, and the slope below the best border."""
    largest = max(jumps)
    border = MIN_ABOVE + jumps.index(largest)
    mean_x, mean_y, slope, _ = _line(x[border:], y[border:])
    level_n = exact_sum(y[:border]) / border
    edge_m, error_m = _mean_border_m(x, [exp((square - largest) / (2.0 * variance)) for square in jumps])
    jump_n = mean_y + slope * (edge_m - mean_x) - level_n
    return Surface(edge_m, error_m, level_n, sqrt(variance / border), True), jump_n, slope


def _mean_border_m(depths_m: Sequence[float], likelihoods: Sequence[float]) -> tuple[float, float]:
    """Return mean and standard deviation of the border, which is equally probable at each depth before the stroke."""
    total = first = second = 0.0
    pairs = zip(depths_m[MIN_ABOVE - 1 :], depths_m[MIN_ABOVE:], likelihoods, strict=False)
    for above_m, below_m, likelihood in pairs:
        gap_m, middle_m = below_m - above_m, (above_m + below_m) / 2.0 - depths_m[0]
        weight = max(abs(gap_m), SHARPEST_M) * likelihood
        total += weight
        first += weight * middle_m
        second += weight * (middle_m * middle_m + gap_m * gap_m / 12.0)
    mean_m = first / total
    return depths_m[0] + mean_m, sqrt(max(0.0, second / total - mean_m * mean_m))


def _kink(x: Sequence[float], y: Sequence[float], border: int, kink_m: float, residual: float) -> Surface:
    """Return the kink, with the standard error of the intersection of line and constant."""
    n, below = len(x), len(x) - border
    travels_m = [depth_m - kink_m for depth_m in x[border:]]
    mean_m = exact_sum(travels_m) / n
    spread_m2 = exact_sum(map(mul, travels_m, travels_m)) - n * mean_m * mean_m
    slope = exact_sum(map(mul, travels_m, y[border:])) / spread_m2
    mean_x, _, _, spread = _line(x[border:], y[border:])
    variance = max(residual / max(n - 3, 1), LEAST_VARIANCE_N2)
    error_n = sqrt(variance * (1.0 / border + 1.0 / below + (kink_m - mean_x) ** 2 / spread))
    law_m = LAW_FRACTION * (x[-1] - kink_m)
    return Surface(kink_m, error_n / slope, -slope * mean_m, sqrt(variance / border), True, law_m)


def _mean(jump: Surface, kink: Surface, fraction: float) -> Surface:
    """Average jump and kink; `fraction` is the weight of the jump."""
    rest = 1.0 - fraction

    def uncertainty(own: float, other: float, apart: float) -> float:
        return sqrt(fraction * own * own + rest * other * other + fraction * rest * apart * apart)

    return Surface(
        fraction * jump.depth_m + rest * kink.depth_m,
        uncertainty(jump.std_error_m, kink.std_error_m, jump.depth_m - kink.depth_m),
        fraction * jump.level_n + rest * kink.level_n,
        uncertainty(jump.level_std_error_n, kink.level_std_error_n, jump.level_n - kink.level_n),
        True,
        rest * kink.law_error_m,
    )


def _line(x: Sequence[float], y: Sequence[float]) -> tuple[float, float, float, float]:
    """Return the mean of x and of y, the least-squares slope, and Σ(x - mean)²."""
    n = len(x)
    mean_x, mean_y = exact_sum(x) / n, exact_sum(y) / n
    spread = exact_sum([(u - mean_x) * (u - mean_x) for u in x])
    if not spread > 0.0:
        return mean_x, mean_y, 0.0, inf
    return mean_x, mean_y, exact_sum([(u - mean_x) * v for u, v in zip(x, y, strict=True)]) / spread, spread
