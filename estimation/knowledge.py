"""The estimate of the mud from stride to stride: merged within one mud, dropped at a boundary.

For each flipper and coefficient the memory is a line, ln k against ln z (depth_line.py). Old strides fade, so the
memory follows slow change.

A stride that lies more than 2.6 standard deviations off the line at its depth raises an alarm: the former memory is set
aside and the estimate follows this stride alone. By chance that happens once in a hundred tests, so the next stride
decides. If it agrees with the one before, and both together do not fit the former memory, the mud has changed; if they
do fit, all are joined again. If it agrees with the former memory only, the stride between was an outlier and is left
out; if with neither, it stands alone in turn. The same pair is tested if its first stride raised no alarm, so the mean
of the two strides after a boundary decides. Its standard deviation is 0.08/√2, that of eight remembered strides
0.08/√8: a change of 17 % either way is detected with even chance, one of 30 % practically always. In simulations with
scatter, in which k_p and k_s both change, the robot detects 20 % within two strides 99 times in 100; each flipper alone
follows it 82 times in 100, and 30 % 99 times. On uniform mud one stride in 25 (of both flippers, four tests and four
pairs) is taken for a boundary if the assumed 8 % scatter is true, and is mostly joined again a stride later.

k_p and k_s each decide for all coefficients of their flipper, since these belong to the same mud. k_e is dropped with
them, and alone if it alone changed, since suction also changes with the hole. A boundary drops the level. The exponent
is a property of mud in general: it is preserved, with at least half of its initial standard error.

A lower bound is never merged. If it exceeds the remembered value by more than the error, it indicates a stronger mud
and stands until a value comes; otherwise the remembered value stays. While no value is known the estimate is the
greatest of the last eight bounds that a second bound confirms: one outlier would persist, since no later bound refutes
it.

Each flipper has its own estimate. They are merged where they agree, within each one's lasting error; where they do not,
they are in two muds, of which a mean would describe neither, and the common estimate is None.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, log, sqrt
from typing import NamedTuple

from control.mud_estimate import NOTHING_KNOWN, Coefficient, FlipperEstimate, MudEstimate
from control.records import FLIPPERS, StrideEstimate
from estimation.strokes.depth_line import (
    REMEMBERED_STRIDES,
    SHEAR_LAW,
    STROKE_LAW,
    DepthLaw,
    Line,
    Reading,
    common_variance,
    reading_of,
)

CHANGE = 2.6  # standard deviations beyond which a stride is no chance
PAIR_CHANGE = 2.8  # of two strides: a second test as frequent as the first must not add as many false alarms
FLIPPER_SPREAD = 0.05  # each flipper's lasting error, mostly of its torque constant, in the same mud


class SameMud(NamedTuple):
    """The parts of the memory that belong to the same mud as the new stride."""

    settled: bool  # all before the last stride
    last: bool

    def both(self, other: SameMud) -> SameMud:
        """Return the parts that two coefficients both assign to the same mud."""
        return SameMud(self.settled and other.settled, self.last and other.last)


class CoefficientMemory:
    """Owns one flipper's memory of one coefficient: the last stride, and the settled line of all before it."""

    def __init__(self, law: DepthLaw) -> None:
        self.law = law
        self.reset()

    def reset(self) -> None:
        self.alone = False  # the last stride did not fit: the settled memory waits for the next one to decide
        self._settled = Line(0.0, 0.0, 0.0, self.law.exponent, self.law.std_error**-2, 0)
        self._last: Reading | None = None
        self._current = self._settled
        self._bounds: tuple[Reading, ...] = ()  # the last ones; they count while no value is known

    def _cleared(self) -> Line:
        """Return the line without its level; the exponent stays, with at least half of its initial standard error."""
        exponent_weight = min(self._settled.exponent_weight, (self.law.std_error / 2.0) ** -2)
        return Line(0.0, 0.0, 0.0, self._settled.exponent, exponent_weight, 0)

    def test(self, reading: Reading | None) -> SameMud:
        if not self._current.agrees(reading, CHANGE):
            return SameMud(settled=self.alone and self._settled.agrees(reading, CHANGE), last=False)
        return SameMud(settled=self._settled.agrees(self._joined(reading), PAIR_CHANGE), last=True)

    def _joined(self, reading: Reading | None) -> Reading | None:
        """Return the mean of the last two strides if both gave a value, else the reading of one of them."""
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

    def remember(self, reading: Reading | None, same: SameMud) -> None:
        self.alone = not (same.settled or same.last)
        if same.last:
            self._settled = (self._settled if same.settled else self._cleared()).plus(self._last)
        elif self.alone:
            self._settled = self._current
        self._current = (self._cleared() if self.alone else self._settled).plus(reading)
        self._remember_bound(reading, same)
        self._last = reading

    def _remember_bound(self, reading: Reading | None, same: SameMud) -> None:
        if not same.last:
            self._bounds = ()
        elif not same.settled:
            self._bounds = tuple(bound for bound in self._bounds if bound is self._last)
        if reading is not None and reading.at_least:
            self._bounds = (*self._bounds, reading)[-REMEMBERED_STRIDES:]

    def coefficient(self) -> Coefficient | None:
        if self._current.strides:
            return self._current.coefficient()
        if not self._bounds:
            return None
        bound = self._confirmed_bound()._replace(at_least=False)
        return self._cleared().plus(bound).coefficient()._replace(strides=len(self._bounds), at_least=True)

    def _confirmed_bound(self) -> Reading:
        """Return the greatest bound that a second stride confirms; the only one while there is one."""
        exponent = self._settled.exponent
        return sorted(self._bounds, key=lambda bound: bound.log_k - exponent * bound.log_depth)[-2:][0]


class FlipperKnowledge:
    """Owns the three memories of one flipper, which a boundary clears together."""

    def __init__(self) -> None:
        self._k_p, self._k_e = CoefficientMemory(STROKE_LAW), CoefficientMemory(STROKE_LAW)
        self._k_s = CoefficientMemory(SHEAR_LAW)

    def reset(self) -> None:
        for memory in (self._k_p, self._k_s, self._k_e):
            memory.reset()

    def update(self, stride: StrideEstimate) -> bool:
        """Add a stride; return whether the mud has changed."""
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
    """Owns the memories of both flippers."""

    def __init__(self) -> None:
        self._flippers = {flipper: FlipperKnowledge() for flipper in FLIPPERS}
        self.mud_estimate = NOTHING_KNOWN

    def reset(self) -> None:
        for flipper in self._flippers.values():
            flipper.reset()
        self.mud_estimate = NOTHING_KNOWN

    def update(self, strides: Sequence[StrideEstimate]) -> MudEstimate:
        """Add the strides that just closed and return the estimate after them."""
        reported = [
            self._flippers[stride.flipper].update(stride) for stride in strides if stride.flipper in self._flippers
        ]
        left, right = (self._flippers[flipper].mud_estimate() for flipper in FLIPPERS)
        k_p, k_s, k_e = (_together(one, other) for one, other in zip(left, right, strict=True))
        self.mud_estimate = MudEstimate(k_p, k_s, k_e, left, right, any(reported))
        return self.mud_estimate


def _together(left: Coefficient | None, right: Coefficient | None) -> Coefficient | None:
    """Return the coefficient on which both flippers agree, or None. If one has none, the other counts for both."""
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
    """Return the mean, weighted by precision after adding the variance that explains the difference.

    This is the method of DerSimonian and Laird. The exponents' errors stem mostly from one prior, so averaging does not
    reduce them.
    """
    between = max(0.0, (excess * excess - variance_left - variance_right) / 2.0)
    weight_left, weight_right = 1.0 / (variance_left + between), 1.0 / (variance_right + between)
    fraction = weight_right / (weight_left + weight_right)
    k = left.at(depth_m)[0] * exp(fraction * excess)
    repeatability = k / sqrt(weight_left + weight_right)
    common = (1.0 - fraction) * common_variance(left) + fraction * common_variance(right)
    return Coefficient(
        value=k,
        std_error=sqrt(repeatability * repeatability + k * k * common),
        repeatability=repeatability,
        depth_m=depth_m,
        exponent=left.exponent + fraction * (right.exponent - left.exponent),
        exponent_std_error=left.exponent_std_error + fraction * (right.exponent_std_error - left.exponent_std_error),
        strides=left.strides + right.strides,
    )


def _log_at(coefficient: Coefficient, depth_m: float) -> tuple[float, float]:
    """Return ln k and its variance."""
    k, error = coefficient.at(depth_m)
    relative = error / k
    return log(k), relative * relative
