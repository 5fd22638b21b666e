"""Checks the zero of the adduction: in swing the flipper's edge is above the mud, in stance it is in it.

The commanded depth is that of the authors' controller, whose geometry is not published in full. Between it and this
project's geometry of their robot lie up to 24 mm at 70 mm, because the motor is not stiff and mud resists, and 9 mm the
other way.
"""

from math import degrees
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.geometry import FlipperGeometry
from control.records import FLIPPERS, Phase
from logs.lab.columns import POSITION_COLUMNS
from logs.lab.findings import FindingKind
from logs.lab.log_rows import LogRows, known_range

Floats = NDArray[np.float64]

DEPTH_TOLERANCE_M = 0.015  # the edge's height with the arm level: a zero that differs by this much is at the surface
HIGHEST_SWING_M = 0.030  # above the surface, twice the height with the arm level
LEAST_DEPTH_FRACTION = 1.0 / 3.0  # of the commanded depth; stiff mud and a weak motor reach two thirds
EXTRACTION_HEIGHT_M = 0.03  # above the level arm's edge, in logs that do not have the setting; the authors' largest
LEVEL_TOLERANCE_M = 0.005  # of a swing's height: those of the authors' 16 shared logs are 0.5 mm lower to 3 mm higher
SHORTEST_S = 0.05  # of a swing


class Excursion(NamedTuple):
    """Depths of one flipper's edge in m, negative above the surface."""

    swing_m: float  # highest of the swings' medians: the swing in which no mud held it
    deepest_m: float  # in insertion and stance
    swing_row: int
    deepest_row: int
    commanded_m: float  # the largest; NaN where unknown


def check_zero(
    rows: LogRows, geometry: FlipperGeometry, angle_rad: Floats, commanded_m: Floats, extraction_m: float
) -> None:
    """Refuse an adduction whose zero is wrong, invalidate one that may be, and report an unexpected depth.

    `extraction_m` is the set height of the extraction, NaN where unknown. Raises LogError.
    """
    raised_m = extraction_m if extraction_m >= 0.0 else EXTRACTION_HEIGHT_M
    limit_m = geometry.clearance_m + DEPTH_TOLERANCE_M + raised_m
    for number in range(len(FLIPPERS)):
        depth_m = edge_depth_m(geometry, angle_rad[:, 2 * number], angle_rad[:, 2 * number + 1])
        excursion = _measure(rows, depth_m, commanded_m)
        if excursion is None:
            continue
        column = POSITION_COLUMNS[2 * number + 1]
        _refuse_zero(rows, column, excursion)
        _report_depth(rows, column, excursion)
        if excursion.swing_m < -limit_m:
            height = (
                f"{-1e3 * excursion.swing_m:.0f} mm above the surface in swing, expected up to {1e3 * limit_m:.0f} mm"
            )
            text = f"the edge is {height}: the zero of the adduction is not certain, and its angles are left out"
            rows.report(FindingKind.DEPTH, column, excursion.swing_row, text)
            angle_rad[:, 2 * number + 1] = np.nan
        else:
            _report_swing(rows, column, excursion, geometry, raised_m)


def _measure(rows: LogRows, depth_m: Floats, commanded_m: Floats) -> Excursion | None:
    """Return the excursion of a flipper that swung and pushed; None for one that did not."""
    pushing = np.isin(rows.phase, (Phase.INSERTION, Phase.STANCE)) & np.isfinite(depth_m)
    known_s = np.where(np.isfinite(depth_m), rows.time_s, np.nan)
    swings = [each for each in rows.strokes(Phase.SWING) if known_range(known_s[each]) > SHORTEST_S]
    if not np.any(pushing) or not swings:
        return None
    medians_m = [float(np.nanmedian(depth_m[each])) for each in swings]
    highest = int(np.argmin(medians_m))
    deepest = int(np.argmax(np.where(pushing, depth_m, -np.inf)))
    known = np.isfinite(commanded_m)
    commanded = float(np.max(commanded_m[known])) if np.any(known) else np.nan
    return Excursion(medians_m[highest], float(depth_m[deepest]), swings[highest].start, deepest, commanded)


def edge_depth_m(geometry: FlipperGeometry, sweep_rad: Floats, adduction_rad: Floats) -> Floats:
    """Return the depth of the lower edge below the nominal surface, as FlipperGeometry.depth_m does for one sample."""
    tilted_drop_m = geometry.drop_m * np.cos(adduction_rad)
    lowered_m: Floats = geometry.flipper_length_m * np.cos(sweep_rad) * np.sin(adduction_rad)
    return tilted_drop_m - lowered_m - geometry.axis_height_m


def _refuse_zero(rows: LogRows, column: str, excursion: Excursion) -> None:
    swing_mm, deepest_mm = 1e3 * excursion.swing_m, 1e3 * excursion.deepest_m
    if swing_mm > 0.0:
        text = f"the edge is {swing_mm:.0f} mm below the surface in every swing: the zero of the adduction is wrong"
        raise rows.refusal(FindingKind.DEPTH, column, excursion.swing_row, text)
    least_m = LEAST_DEPTH_FRACTION * np.nan_to_num(excursion.commanded_m)
    if excursion.swing_m < -HIGHEST_SWING_M and excursion.deepest_m < least_m:
        place = f"{-swing_mm:.0f} mm above the surface in swing and at most {deepest_mm:.0f} mm below it"
        command = f", commanded {1e3 * excursion.commanded_m:.0f} mm" * bool(np.isfinite(excursion.commanded_m))
        text = f"the edge is {place}{command}: the zero of the adduction is wrong"
        raise rows.refusal(FindingKind.DEPTH, column, excursion.deepest_row, text)


def _report_depth(rows: LogRows, column: str, excursion: Excursion) -> None:
    deepest_mm, commanded_mm = 1e3 * excursion.deepest_m, 1e3 * excursion.commanded_m
    below_m, above_m = excursion.commanded_m * LEAST_DEPTH_FRACTION, excursion.commanded_m + DEPTH_TOLERANCE_M
    if excursion.deepest_m <= 0.0:
        text = f"the edge never reaches the surface; its lowest point is {-deepest_mm:.0f} mm above it"
    elif excursion.deepest_m < below_m or excursion.deepest_m > above_m:
        text = f"the greatest depth is {deepest_mm:.0f} mm, commanded are {commanded_mm:.0f} mm"
    else:
        return
    rows.report(FindingKind.DEPTH, column, excursion.deepest_row, text)


def _report_swing(rows: LogRows, column: str, excursion: Excursion, geometry: FlipperGeometry, raised_m: float) -> None:
    """Report swings that are lower than a level arm's, or higher than one raised by `raised_m`."""
    height_m, level_m = -excursion.swing_m, geometry.clearance_m
    off_m = height_m - min(max(height_m, level_m), level_m + raised_m)
    if abs(off_m) > LEVEL_TOLERANCE_M:
        off_deg = degrees(abs(off_m) / geometry.flipper_length_m)
        heights = f"{1e3 * height_m:.0f} mm above the surface in swing, and {1e3 * level_m:.0f} mm with the arm level"
        text = f"the edge is {heights}: the zero of the adduction may be wrong by {off_deg:.0f} degrees or more"
        rows.report(FindingKind.DEPTH, column, excursion.swing_row, text)
