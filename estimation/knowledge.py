"""What is known of the mud from stride to stride: merged on one mud, forgotten at the next.

Of every flipper and coefficient the memory is a line, ln k against ln z (depth_line.py). It fades as it grows, so slow
change is followed.

A stride that is more than 2.6 standard deviations off what the line expects at its depth raises an alarm: the memory
steps aside, this stride stands alone, and what one stride can tell is followed at once. By chance that happens once
in a hundred tests, so the next stride decides. If it agrees with the one before, and both together do not fit the
former memory, the mud has changed; if they do fit, all are joined again. If it agrees with the former memory only,
the stride between was a wild one and is left out; if with neither, it stands alone in turn. The same pair is tested
where its first stride raised no alarm. So two strides behind a boundary it is their mean that decides. Its standard
deviation is 0.08/√2, that of eight remembered strides 0.08/√8: a change of 17 % either way is told by an even chance,
one of 30 % practically always. Simulated with scatter, k_p and k_s both changed: the robot tells 20 % within two
strides 99 times in 100, each flipper by itself follows it 82 times in 100, and 30 % 99 times. On uniform mud one
stride in 25 (of both flippers, four tests and four pairs) is called a boundary, if the 8 % are true, and is mostly
joined again a stride later.

k_p and k_s each tell for all of their flipper, since it is the same mud. k_e forgets with them, and alone where it
alone changed, since suction also changes with the hole. The level is forgotten at a boundary. The exponent belongs to
mud more than to one mud: it is kept, with at least half the doubt that it had when nothing was known.

A lower bound is never merged. Above the remembered value by more than the doubt it tells a stronger mud, and stands
until a value comes; else the remembered value stays. While no value is known the greatest of the last eight bounds
that a second one bears out is believed: one wild bound would be believed too long, since no later bound refutes it.

Each flipper is known apart. Together they are merged where they agree, allowing for each one's lasting error; where
they do not, they are in two muds, a mean would be the coefficient of neither, and there is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, log, sqrt
from typing import NamedTuple

from control.mud_estimate import NOTHING_KNOWN, Coefficient, FlipperEstimate, MudEstimate
from control.records import FLIPPERS, StrideEstimate
from estimation.strokes.depth_line import REMEMBERED_STRIDES, DepthLaw, Line, Reading, reading_of

CHANGE = 2.6  # standard deviations of a stride that are not chance
PAIR_CHANGE = 2.8  # of two strides: asked for as often as the other, they may not tell as much by chance as well
FLIPPER_SPREAD = 0.05  # each flipper's lasting error, of its torque constant mostly: two may differ so in one mud
# A force exponent from 1 (the same pressure everywhere) to 2 (the paper's triangle), where k_s assumes 2.
SHEAR_LAW = DepthLaw(-0.5, 0.3)
# 0.5 to 1 in the authors' logs (end bearing and adhesion), where k_p and k_e assume 1.
STROKE_LAW = DepthLaw(-0.4, 0.3)


class Kept(NamedTuple):
    """What of the memory is of the same mud as the stride that just came."""

    settled: bool  # all before the last stride
    last: bool

    def both(self, other: Kept) -> Kept:
        """What two coefficients both call the same mud."""
        return Kept(self.settled and other.settled, self.last and other.last)


class CoefficientMemory:
    """Owns what one flipper's strides said of one coefficient: the last one, and settled, all before it."""

    def __init__(self, law: DepthLaw) -> None:
        self.law = law
        self.reset()

    def reset(self) -> None:
        self.alone = False  # the last stride did not fit: the settled memory waits for the next one to decide
        self._settled = Line(0.0, 0.0, 0.0, self.law.exponent, self.law.std_error**-2, 0)
        self._last: Reading | None = None
        self._believed = self._settled
        self._bounds: tuple[Reading, ...] = ()  # the last ones; they count while no value is known

    def _cleared(self) -> Line:
        """The level forgotten; the exponent kept with at least half the doubt that it had at first."""
        exponent_weight = min(self._settled.exponent_weight, (self.law.std_error / 2.0) ** -2)
        return Line(0.0, 0.0, 0.0, self._settled.exponent, exponent_weight, 0)

    def test(self, reading: Reading | None) -> Kept:
        if not self._believed.agrees(reading, CHANGE):
            return Kept(settled=self.alone and self._settled.agrees(reading, CHANGE), last=False)
        return Kept(settled=self._settled.agrees(self._joined(reading), PAIR_CHANGE), last=True)

    def _joined(self, reading: Reading | None) -> Reading | None:
        """The mean of the last two strides where both told a value, else what one of them told."""
        last = self._last
        if last is None or (last.at_least and reading is not None):
            return reading
        if reading is None or reading.at_least:
            return last
        weight, last_weight = 1.0 / reading.variance, 1.0 / last.variance
        fraction = weight / (weight + last_weight)
        log_k = last.log_k + fraction * (reading.log_k - last.log_k)
        log_depth = last.log_depth + fraction * (reading.log_depth - last.log_depth)
        return Reading(log_k, 1.0 / (weight + last_weight), log_depth)

    def remember(self, reading: Reading | None, kept: Kept) -> None:
        self.alone = not (kept.settled or kept.last)
        if kept.last:
            self._settled = (self._settled if kept.settled else self._cleared()).plus(self._last)
        elif self.alone:
            self._settled = self._believed
        self._believed = (self._cleared() if self.alone else self._settled).plus(reading)
        self._remember_bound(reading, kept)
        self._last = reading

    def _remember_bound(self, reading: Reading | None, kept: Kept) -> None:
        if not kept.last:
            self._bounds = ()
        elif not kept.settled:
            self._bounds = tuple(bound for bound in self._bounds if bound is self._last)
        if reading is not None and reading.at_least:
            self._bounds = (*self._bounds, reading)[-REMEMBERED_STRIDES:]

    def coefficient(self) -> Coefficient | None:
        if self._believed.strides:
            return self._believed.coefficient()
        if not self._bounds:
            return None
        bound = self._borne_out()._replace(at_least=False)
        return self._cleared().plus(bound).coefficient()._replace(strides=len(self._bounds), at_least=True)

    def _borne_out(self) -> Reading:
        """The greatest bound that a second stride bears out; the only one, while there is one."""
        exponent = self._settled.exponent
        return sorted(self._bounds, key=lambda bound: bound.log_k - exponent * bound.log_depth)[-2:][0]


class FlipperKnowledge:
    """Owns the three memories of one flipper, which forget together."""

    def __init__(self) -> None:
        self._k_p, self._k_e = CoefficientMemory(STROKE_LAW), CoefficientMemory(STROKE_LAW)
        self._k_s = CoefficientMemory(SHEAR_LAW)

    def reset(self) -> None:
        for memory in (self._k_p, self._k_s, self._k_e):
            memory.reset()

    def update(self, stride: StrideEstimate) -> bool:
        """Whether the mud is another one than was believed."""
        k_p, k_s, k_e = (reading_of(estimate, stride.depth_m) for estimate in (stride.k_p, stride.k_s, stride.k_e))
        suction = self._k_e.test(k_e)
        if k_p is None and k_s is None:  # an alarm can neither be raised nor settled
            self._k_e.remember(k_e, suction)
            return False
        mud = self._k_p.test(k_p).both(self._k_s.test(k_s))
        boundary = not mud.settled and not (self._k_p.alone and mud.last)
        self._k_p.remember(k_p, mud)
        self._k_s.remember(k_s, mud)
        self._k_e.remember(k_e, mud.both(suction))
        return boundary

    def mud_estimate(self) -> FlipperEstimate:
        return FlipperEstimate(self._k_p.coefficient(), self._k_s.coefficient(), self._k_e.coefficient())


class MudKnowledge:
    """Owns what both flippers remember."""

    def __init__(self) -> None:
        self._flippers = {flipper: FlipperKnowledge() for flipper in FLIPPERS}
        self.mud_estimate = NOTHING_KNOWN

    def reset(self) -> None:
        for flipper in self._flippers.values():
            flipper.reset()
        self.mud_estimate = NOTHING_KNOWN

    def update(self, strides: Sequence[StrideEstimate]) -> MudEstimate:
        """The belief after the strides that closed just now."""
        reported = [
            self._flippers[stride.flipper].update(stride) for stride in strides if stride.flipper in self._flippers
        ]
        left, right = (self._flippers[flipper].mud_estimate() for flipper in FLIPPERS)
        k_p, k_s, k_e = (_together(one, other) for one, other in zip(left, right, strict=True))
        self.mud_estimate = MudEstimate(k_p, k_s, k_e, left, right, any(reported))
        return self.mud_estimate


def _together(left: Coefficient | None, right: Coefficient | None) -> Coefficient | None:
    """What both flippers hold for true, or None. Where only one knows, it speaks for both."""
    if left is None or right is None:
        return left or right
    depth_m = sqrt(left.depth_m * right.depth_m)
    (log_left, variance_left), (log_right, variance_right) = _log_at(left, depth_m), _log_at(right, depth_m)
    excess = log_right - log_left
    largest = CHANGE * sqrt(variance_left + variance_right + 2.0 * FLIPPER_SPREAD**2)
    if left.at_least and right.at_least:
        return left if excess > 0.0 else right
    if left.at_least:
        return right if -excess <= largest else None
    if right.at_least:
        return left if excess <= largest else None
    return _mean(left, right, depth_m, excess, variance_left, variance_right) if abs(excess) <= largest else None


def _mean(
    left: Coefficient, right: Coefficient, depth_m: float, excess: float, variance_left: float, variance_right: float
) -> Coefficient:
    """By precision, after both were given so much variance that their difference is no more than chance (as
    DerSimonian and Laird do). The exponents' doubt is mostly one prior's: told twice, it does not get smaller.
    """
    between = max(0.0, (excess * excess - variance_left - variance_right) / 2.0)
    weight_left, weight_right = 1.0 / (variance_left + between), 1.0 / (variance_right + between)
    fraction = weight_right / (weight_left + weight_right)
    k = left.at(depth_m)[0] * exp(fraction * excess)
    return Coefficient(
        k,
        k / sqrt(weight_left + weight_right),
        depth_m,
        left.exponent + fraction * (right.exponent - left.exponent),
        left.exponent_std_error + fraction * (right.exponent_std_error - left.exponent_std_error),
        left.strides + right.strides,
    )


def _log_at(coefficient: Coefficient, depth_m: float) -> tuple[float, float]:
    """ln k and its variance."""
    k, std_error = coefficient.at(depth_m)
    relative = std_error / k
    return log(k), relative * relative
