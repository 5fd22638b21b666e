"""Converts an amplifier's readings to newtons: a straight line through two known weights, with standard errors.

    reading = zero + per_newton · force

The zero hardly matters, because every trial is tared. The error of the span enters every coefficient. An amplifier that
prints grams or newtons uses its own calibration, whose standard error is unknown.
"""

import json
from math import fsum, hypot, isfinite, sqrt
from pathlib import Path
from typing import NamedTuple

from drivers.load_cell.line_formats import NEWTONS

LEAST_SPAN = 20.0  # standard errors between the readings of two weights
LEAST_DIFFERENCE_N = 0.05
DRIFTING = 5.0  # standard errors between the halves of one reading
DRIFT_FRACTION = 0.002  # of the span; a smaller drift is negligible


class CalibrationError(Exception):
    """The calibration failed; the text says why, and what to do."""


class LoadCellCalibration(NamedTuple):
    unit: str
    per_newton: float  # units per newton; negative where the cell is loaded in the other direction
    zero: float = 0.0
    per_newton_std_error: float = 0.0
    zero_std_error: float = 0.0

    def force_n(self, reading: float) -> float:
        return (reading - self.zero) / self.per_newton

    @property
    def relative_error(self) -> float:
        """The relative standard error of every force."""
        return abs(self.per_newton_std_error / self.per_newton)


class Weighing(NamedTuple):
    """The readings under a known load."""

    force_n: float
    reading: float
    std_error: float
    drift: float  # from the first half of the readings to the second
    drift_std_error: float


def weigh(force_n: float, readings: list[float]) -> Weighing:
    """Average the readings under a load. Raises CalibrationError for too few of them."""
    if len(readings) < 4:
        raise CalibrationError(f"only {len(readings)} readings under {force_n:.3g} N: is the amplifier still sending?")
    half = len(readings) // 2
    (first, first_error), (second, second_error) = _mean(readings[:half]), _mean(readings[half:])
    mean, error = _mean(readings)
    return Weighing(
        force_n=force_n,
        reading=mean,
        std_error=error,
        drift=second - first,
        drift_std_error=hypot(first_error, second_error),
    )


def _mean(values: list[float]) -> tuple[float, float]:
    mean = fsum(values) / len(values)
    square = fsum((value - mean) ** 2 for value in values) / max(len(values) - 1, 1)
    return mean, sqrt(square / len(values))


def calibrate(unit: str, light: Weighing, heavy: Weighing) -> LoadCellCalibration:
    """Fit the line through two loads. Raises CalibrationError where they do not determine the span."""
    difference_n, span = heavy.force_n - light.force_n, heavy.reading - light.reading
    if abs(difference_n) < LEAST_DIFFERENCE_N:
        raise CalibrationError(
            f"both weights are {light.force_n:.3g} N: the second one must differ; "
            "take one near the largest force that you expect"
        )
    error = hypot(light.std_error, heavy.std_error)
    if not isfinite(span) or abs(span) <= LEAST_SPAN * error or span == 0.0:
        raise CalibrationError(
            f"the reading hardly changed, from {light.reading:g} to {heavy.reading:g} {unit}, for "
            f"{difference_n:.3g} N: does the weight hang on the cell, along the direction that it measures?"
        )
    per_newton, slope_error = span / difference_n, error / abs(difference_n)
    zero = light.reading - per_newton * light.force_n
    return LoadCellCalibration(
        unit=unit,
        per_newton=per_newton,
        zero=zero,
        per_newton_std_error=slope_error,
        zero_std_error=hypot(light.std_error, slope_error * light.force_n),
    )


def remarks_about(calibration: LoadCellCalibration, light: Weighing, heavy: Weighing) -> list[str]:
    """List what the operator should know about a calibration."""
    remarks = []
    span = abs(heavy.reading - light.reading)
    for weighing in (light, heavy):
        if abs(weighing.drift) > max(DRIFTING * weighing.drift_std_error, DRIFT_FRACTION * span):
            remarks.append(
                f"the reading under {weighing.force_n:.3g} N drifted by {weighing.drift / calibration.per_newton:+.3g} "
                "N: let the weight come to rest and the amplifier warm up, then calibrate again"
            )
    return remarks


def calibration_of_unit(unit: str, scale: float | None) -> LoadCellCalibration | None:
    """Make the calibration of an amplifier that prints weights or forces; `scale` is in newtons per unit.

    Returns None where neither the unit nor `scale` is known.
    """
    newtons = scale if scale is not None else NEWTONS.get(unit.lower())
    return None if newtons is None else LoadCellCalibration(unit, 1.0 / newtons)


def write_calibration(path: Path, calibration: LoadCellCalibration) -> None:
    path.write_text(json.dumps(calibration._asdict(), indent=1) + "\n", encoding="utf-8")


def read_calibration(path: Path) -> LoadCellCalibration:
    """Read a calibration file; raises CalibrationError for another file, and OSError."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as problem:
        raise CalibrationError(f"{path}: not a calibration, since it is not JSON: {problem}") from problem
    names = LoadCellCalibration._fields
    if not isinstance(document, dict) or set(document) != set(names) or not isinstance(document["unit"], str):
        raise CalibrationError(f"{path}: a calibration has the keys {', '.join(names)}, and no others")
    for name in names[1:]:
        if type(document[name]) not in (int, float) or not isfinite(document[name]):
            raise CalibrationError(f"{path}: {name} = {document[name]!r}: must be a number")
    if document["per_newton"] == 0.0:
        raise CalibrationError(f"{path}: per_newton = 0: must not be zero")
    return LoadCellCalibration(**document)
