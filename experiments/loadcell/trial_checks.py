"""Problems of a recorded trial, for which the operator may repeat it or leave it out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from experiments.loadcell.analysis.coefficients import AnalysedTrial
from experiments.loadcell.analysis.force_motion import Insertion, Shear
from experiments.loadcell.recording import StrokeRecording, Tare

FORCE_ALONE = "the trial is evaluated by its force alone, which assumes a stage of one speed"
LEAST_DRIFT_N, DRIFT_FRACTION = 0.02, 0.03  # of the largest force, by which the zero may move over a trial
GARBLED_FRACTION = 0.05
MISSING_FRACTION = 0.15  # of the samples of a stroke
FLAT_SAMPLES = 8  # equal samples at the largest force: a cell that saturates without a message


def list_problems(analysed: AnalysedTrial, stroke: StrokeRecording, before: Tare, after: Tare) -> list[str]:
    """Return messages on everything that may make a trial invalid."""
    problems, recorded = list[str](), analysed.recorded
    if stroke.problems.breaks:
        problems.append("the load cell was unplugged during the trial")
    if stroke.overloads or is_clipped(recorded.forces_n):
        problems.append(
            "the load cell was at its limit: the force is beyond its range. Take a cell of a larger range, a smaller "
            "plate, or a lower gain of the amplifier"
        )
    garbled = stroke.problems.garbled_lines
    lines = len(stroke.samples) + garbled
    if garbled > GARBLED_FRACTION * lines:
        problems.append(f"{garbled} of {lines} lines were garbled: check cable and ground")
    problems += [each for each in (analysed.problem, analysed.remark) if each]
    problems += _list_position_problems(analysed, stroke)
    moved_n = abs(after.force_n - before.force_n)
    largest_n = float(np.max(np.abs(recorded.forces_n - recorded.zero_n), initial=0.0))
    if moved_n > max(LEAST_DRIFT_N, DRIFT_FRACTION * largest_n):
        problems.append(
            f"the zero moved by {moved_n:.3f} N over the trial: something slipped, mud clings to the plate, or the "
            "cell drifts. Wipe the plate, check the mounting, let the amplifier warm up"
        )
    missing = missing_fraction(analysed)
    if missing > MISSING_FRACTION:
        problems.append(
            f"{100.0 * missing:.0f} % of the samples of its strokes are missing: check cable and connectors"
        )
    return problems


def _list_position_problems(analysed: AnalysedTrial, stroke: StrokeRecording) -> list[str]:
    of_line = stroke.position_problems
    if of_line is None:
        return []
    if of_line.breaks:
        return [f"the stage's encoder was unplugged or restarted during the trial: {FORCE_ALONE}"]
    if not stroke.positions:
        return [f"the stage's encoder sent no position: {FORCE_ALONE}"]
    missing = _fraction_without_position(analysed)
    if missing > MISSING_FRACTION:
        return [
            f"the stage's position is unknown for {100.0 * missing:.0f} % of its strokes ({of_line.garbled_lines} "
            f"garbled lines, {of_line.drop_outs} gaps): check the encoder's cable and connectors"
        ]
    return []


def _fraction_without_position(analysed: AnalysedTrial) -> float:
    if analysed.positions_m is None or analysed.profile is None:
        return 0.0
    times_s, fractions = analysed.profile.times_s, [0.0]
    for begin_s, end_s in _strokes(analysed):
        inside = (times_s >= begin_s) & (times_s < end_s)
        fractions.append(float(np.mean(np.isnan(analysed.positions_m[inside]))) if np.any(inside) else 0.0)
    return max(fractions)


def is_clipped(forces_n: np.ndarray[Any, np.dtype[np.float64]]) -> bool:
    """Return whether the largest force repeats exactly, many times in a row, in a cell that is not always still."""
    if len(forces_n) < FLAT_SAMPLES or len(np.unique(forces_n)) < FLAT_SAMPLES:
        return False
    ends = (forces_n == np.max(forces_n)) | (forces_n == np.min(forces_n))
    return any(np.all(ends[i : i + FLAT_SAMPLES]) for i in np.flatnonzero(ends))


def missing_fraction(analysed: AnalysedTrial) -> float:
    """Return the fraction of missing samples in the worst stroke."""
    if analysed.profile is None or analysed.motion is None:
        return 0.0
    times_s = analysed.profile.times_s
    period_s = float(np.median(np.diff(times_s)))
    fractions = []
    for begin_s, end_s in _strokes(analysed):
        inside = np.count_nonzero((times_s >= begin_s) & (times_s < end_s))
        fractions.append(1.0 - (inside + 1) * period_s / (end_s - begin_s))
    return max(fractions)


def _strokes(analysed: AnalysedTrial) -> Iterable[tuple[float, float]]:
    motion, extraction = analysed.motion, analysed.extraction
    if isinstance(motion, Shear):
        yield motion.begin_s, motion.steady_to_s
    if isinstance(motion, Insertion):
        yield motion.surface_s, motion.stop_s
    if extraction is not None:
        yield extraction.lift_s, extraction.out_s
