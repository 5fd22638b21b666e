"""From an amplifier's readings to newtons: a straight line through two known weights, with its standard errors.

    reading = zero + per_newton · force

The zero hardly matters, since every trial is tared; the span is what every coefficient is as good as. An amplifier
that prints grams or newtons has its span from its own calibration, and no standard error that anybody here knows.
"""

from __future__ import annotations

import json
from math import hypot, isfinite, sqrt
from pathlib import Path
from typing import Any, NamedTuple

from drivers.load_cell.line_formats import newtons_per

LEAST_SPAN = 20.0  # standard errors between the readings of two weights
LEAST_APART_N = 0.05
DRIFTING = 5.0  # standard errors between the halves of one reading
DRIFT_FRACTION = 0.002  # of the span, below which a drift matters to nobody


class CalibrationError(Exception):
    """No calibration; the text says why, and what to do."""


class LoadCellCalibration(NamedTuple):
    unit: str
    per_newton: float  # of the unit; negative where the cell is loaded the other way round
    zero: float = 0.0
    per_newton_std_error: float = 0.0
    zero_std_error: float = 0.0

    def force_n(self, reading: float) -> float:
        return (reading - self.zero) / self.per_newton

    @property
    def relative_error(self) -> float:
        """Of every force, one standard error."""
        return abs(self.per_newton_std_error / self.per_newton)


class Weighing(NamedTuple):
    """What was read under a known load."""

    force_n: float
    reading: float
    std_error: float
    drift: float  # from the first half of the readings to the second
    drift_std_error: float


def weigh(force_n: float, readings: list[float]) -> Weighing:
    """Raises CalibrationError for too few of them."""
    if len(readings) < 4:
        raise CalibrationError(f"only {len(readings)} readings under {force_n:.3g} N: is the amplifier still sending?")
    half = len(readings) // 2
    (first, first_error), (second, second_error) = _mean(readings[:half]), _mean(readings[half:])
    mean, error = _mean(readings)
    return Weighing(force_n, mean, error, second - first, hypot(first_error, second_error))


def _mean(values: list[float]) -> tuple[float, float]:
    mean = sum(values) / len(values)
    square = sum((value - mean) ** 2 for value in values) / max(len(values) - 1, 1)
    return mean, sqrt(square / len(values))


def calibrate(unit: str, light: Weighing, heavy: Weighing) -> LoadCellCalibration:
    """Raises CalibrationError where the two say nothing of the span."""
    apart_n, span = heavy.force_n - light.force_n, heavy.reading - light.reading
    if abs(apart_n) < LEAST_APART_N:
        raise CalibrationError(
            f"both weights are {light.force_n:.3g} N: the second one must be another one; "
            "take one near the largest force that you expect"
        )
    error = hypot(light.std_error, heavy.std_error)
    if not isfinite(span) or abs(span) <= LEAST_SPAN * error or span == 0.0:
        raise CalibrationError(
            f"the reading hardly changed, from {light.reading:g} to {heavy.reading:g} {unit}, for {apart_n:.3g} N: "
            "does the weight hang on the cell, along the direction that it measures?"
        )
    per_newton, slope_error = span / apart_n, error / abs(apart_n)
    zero = light.reading - per_newton * light.force_n
    zero_error = hypot(light.std_error, slope_error * light.force_n)
    return LoadCellCalibration(unit, per_newton, zero, slope_error, zero_error)


def remarks_on(calibration: LoadCellCalibration, light: Weighing, heavy: Weighing) -> list[str]:
    """What a person should know of it."""
    reported = []
    span = abs(heavy.reading - light.reading)
    for weighing in (light, heavy):
        if abs(weighing.drift) > max(DRIFTING * weighing.drift_std_error, DRIFT_FRACTION * span):
            reported.append(
                f"the reading under {weighing.force_n:.3g} N drifted by {weighing.drift / calibration.per_newton:+.3g} "
                "N while it was taken: let the weight come to rest and the amplifier warm up, then calibrate again"
            )
    if calibration.per_newton < 0.0:
        reported.append(
            "the reading falls as the load grows: the cell is loaded the other way round, which is allowed for"
        )
    return reported


def of_unit(unit: str, scale: float | None) -> LoadCellCalibration | None:
    """Of an amplifier that prints weights or forces; `scale`: newtons per unit. None where neither tells."""
    newtons = scale if scale is not None else newtons_per(unit)
    return None if newtons is None else LoadCellCalibration(unit, 1.0 / newtons)


def write_calibration(path: Path, calibration: LoadCellCalibration) -> None:
    path.write_text(json.dumps(calibration._asdict(), indent=1) + "\n", encoding="utf-8")


def read_calibration(path: Path) -> LoadCellCalibration:
    """Raises CalibrationError, OSError."""
    try:
        reported = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as problem:
        raise CalibrationError(f"{path}: not a calibration, since it is not JSON: {problem}") from problem
    return _checked(path, reported)


def _checked(path: Path, reported: Any) -> LoadCellCalibration:
    names = LoadCellCalibration._fields
    if not isinstance(reported, dict) or set(reported) != set(names) or not isinstance(reported["unit"], str):
        raise CalibrationError(f"{path}: a calibration has the keys {', '.join(names)}, and no others")
    for name in names[1:]:
        if (
            isinstance(reported[name], bool)
            or not isinstance(reported[name], int | float)
            or not isfinite(reported[name])
        ):
            raise CalibrationError(f"{path}: {name} = {reported[name]!r}: must be a number")
    if reported["per_newton"] == 0.0:
        raise CalibrationError(f"{path}: per_newton = 0: must not be zero")
    return LoadCellCalibration(**reported)
