"""A map of the mud: each coefficient over pieces of 5 cm along the track, about half a step, if there is a pose.

A piece's coefficient is the weighted mean of ln k over all strides of both flippers there, with the weights 1/r² of
estimation/strokes/depth_line.py. Its repeatability is that of the mean, times √(χ²/(n - 1)) if the strides differ by
more than their own errors explain (Birge's ratio: a boundary within the piece, or a hole entered a second time). The
strides' depths differ too, so each coefficient has a mean depth. Lower bounds are not averaged: the greatest counts
while the piece has no value. The map drops the pieces that were entered longest ago, so its memory is bounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, floor, inf, isfinite, sqrt
from typing import NamedTuple

from control.records import StrideEstimate
from estimation.strokes.depth_line import Reading, reading_of

PIECE_M = 0.05
MOST_PIECES = 400  # 20 m


class Mapped(NamedTuple):
    """One coefficient of one piece."""

    value: float  # N/m³
    std_error: float  # N/m³, with what all strides have in common
    repeatability: float  # N/m³, without it
    depth_m: float  # mean of the strides'
    strides: int
    at_least: bool


class MapRow(NamedTuple):
    position_m: float  # the piece's middle
    k_p: Mapped | None
    k_s: Mapped | None
    k_e: Mapped | None


class Sums(NamedTuple):
    """Weighted sums over the strides in one piece; squares about the mean."""

    weight: float
    log_k: float
    log_depth: float
    squares: float
    strides: int
    at_least: bool
    common: float  # variance of the errors that all strides share

    def plus(self, reading: Reading) -> Sums:
        if reading.at_least:
            return _alone(reading) if self.at_least and reading.log_k > self.log_k else self
        if self.at_least:
            return _alone(reading)
        weight = 1.0 / reading.variance
        fraction = weight / (self.weight + weight)
        stronger = reading.log_k - self.log_k
        return Sums(
            self.weight + weight,
            self.log_k + fraction * stronger,
            self.log_depth + fraction * (reading.log_depth - self.log_depth),
            self.squares + self.weight * fraction * stronger * stronger,
            self.strides + 1,
            False,
            self.common + fraction * (reading.common - self.common),
        )

    def mapped(self) -> Mapped:
        k, strides = exp(self.log_k), self.strides
        scatter = max(1.0, self.squares / (strides - 1)) if strides > 1 else 1.0
        variance = scatter / self.weight
        return Mapped(
            value=k,
            std_error=k * sqrt(variance + self.common),
            repeatability=k * sqrt(variance),
            depth_m=exp(self.log_depth),
            strides=strides,
            at_least=self.at_least,
        )


def _alone(reading: Reading) -> Sums:
    return Sums(1.0 / reading.variance, reading.log_k, reading.log_depth, 0.0, 1, reading.at_least, reading.common)


Piece = tuple[Sums | None, Sums | None, Sums | None]  # of k_p, k_s, k_e


class MudMap:
    """Owns the pieces, in the order in which they were last entered."""

    def __init__(self) -> None:
        self._pieces: dict[int, Piece] = {}

    def reset(self) -> None:
        self._pieces.clear()

    def update(self, position_m: float, strides: Sequence[StrideEstimate]) -> None:
        """Add the strides that closed with the body at `position_m`, NaN without a pose."""
        if not isfinite(position_m / PIECE_M):
            return
        number = floor(position_m / PIECE_M)
        for stride in strides:
            k_p, k_s, k_e = (reading_of(each, stride.depth_m) for each in (stride.k_p, stride.k_s, stride.k_e))
            if k_p is None and k_s is None and k_e is None:
                continue
            a, b, c = self._pieces.pop(number, (None, None, None))
            self._pieces[number] = (_added(a, k_p), _added(b, k_s), _added(c, k_e))
        while len(self._pieces) > MOST_PIECES:
            del self._pieces[next(iter(self._pieces))]

    def rows(self, after_m: float = -inf, most: int = MOST_PIECES) -> tuple[MapRow, ...]:
        """Return the first pieces whose middle is beyond `after_m`, in the order of their positions."""
        numbers = sorted(number for number in self._pieces if _middle_m(number) > after_m)
        return tuple(
            MapRow(_middle_m(number), *(sums.mapped() if sums else None for sums in self._pieces[number]))
            for number in numbers[:most]
        )


def _middle_m(number: int) -> float:
    return (number + 0.5) * PIECE_M


def _added(sums: Sums | None, reading: Reading | None) -> Sums | None:
    if reading is None:
        return sums
    return sums.plus(reading) if sums else _alone(reading)
