"""The trials of the load cell, one after the other: prepared, tared, recorded, checked and written to the notebook.

Samples are on the disk before they are evaluated, and the files of a repeated trial stay there; the notebook names the
file that counts. The same command continues an interrupted experiment.
"""

from collections import Counter
from collections.abc import Iterator
from functools import partial
from itertools import count
from pathlib import Path

import numpy as np

from experiments.loadcell.analysis import analyse_trial, speed_remark
from experiments.loadcell.curve_fit import Array
from experiments.loadcell.recording import (
    AVERAGED,
    FORCES,
    POSITIONS,
    RAW,
    CellBench,
    StrokeRecording,
    load_recorded,
    write_rows,
)
from experiments.loadcell.stage import CellTrial
from experiments.loadcell.strokes import INSERTION, AnalysedTrial, Mask
from experiments.reports.mud_names import file_part
from experiments.robot.steps import OperatorStep, conduct_steps
from experiments.study.notebook import Entry
from experiments.study.prompt import GO_ON, REDO, SKIP

KEEP, WITHOUT = "k", "w"
OFFERED = {GO_ON: "measure it again", KEEP: "keep it as it is", SKIP: "leave it out"}
OFFERED_OFTEN = {GO_ON: "leave it out", REDO: "measure it again", KEEP: "keep it as it is"}
MOST_ATTEMPTS = 3  # after which Enter leaves the trial out
SLOW, SLOW_BY_HAND = 1.6, 3.0  # recorded time over the expected time of a stroke
RESERVE_S = 1.5
LISTENING_S, SILENT_S = 1.0, 1.0
AT_ITS_LIMIT = "the load cell was at its limit: take a cell of a larger range, a smaller plate, or a lower gain"
FORCE_ALONE = "the trial is evaluated by its force alone, which assumes a stage of one speed"
LEAST_DRIFT_N, DRIFT_FRACTION = 0.02, 0.03  # of the largest force, by which the zero may move over a trial
GARBLED_FRACTION = 0.05
SINGLE_SPEED_BOUND = 0.12  # difference from the set speed that is remarked; the speed of one trial is less certain
MISSING_FRACTION = 0.15  # of the samples of a stroke
FLAT_SAMPLES = 8  # equal samples at the largest force: a cell that saturates without a message


def measure_all(bench: CellBench) -> None:
    """Measure every trial that is not in the notebook."""
    attempts = Counter[str]()
    steps = [
        OperatorStep(
            trial.key,
            partial(bench.stage.prepare, trial, bench.plan.trials),
            partial(measure, bench, trial, attempts),
        )
        for trial in bench.plan.list_trials()
    ]
    conduct_steps(steps, bench.notebook, bench.session.operator, bench.session.show, {"skipped": True})


def measure(bench: CellBench, trial: CellTrial, attempts: Counter[str]) -> Entry | None:
    """Measure a prepared trial. Return its entry for the notebook; nothing where the operator wants it again."""
    attempts[trial.key] += 1
    attempt = attempts[trial.key]
    entry, problems = record(bench, trial, attempt)
    for problem in problems:
        bench.report(f"{trial.key}: {problem}")
    if problems:
        offered = OFFERED_OFTEN if attempt >= MOST_ATTEMPTS else OFFERED
        answer = bench.ask(f"{trial.key} may be invalid. What now?", offered)
        if answer == KEEP:
            entry["kept_in_spite_of"] = problems
        elif answer == SKIP or (answer == GO_ON and attempt >= MOST_ATTEMPTS):
            entry |= {"skipped": True, "why": problems}
        else:
            return None
    del attempts[trial.key]
    return entry


def record(bench: CellBench, trial: CellTrial, attempt: int) -> tuple[Entry, list[str]]:
    """Record one stroke; return its entry for the notebook, and its problems."""
    stage, settings, folder = bench.stage, bench.plan.settings, bench.session.folder
    _await_encoder(bench)
    before = bench.tare()
    if before.is_averaged and trial.number == attempt == 1:
        bench.report(f"{trial.key}: {AVERAGED}")
    slow = SLOW_BY_HAND if bench.encoder else SLOW
    longest_s = slow * settings.shear_path_m / settings.speed_m_s
    if trial.kind == INSERTION:
        longest_s = 2.0 * slow * settings.depth_m / settings.speed_m_s + settings.hold_s + RESERVE_S
    else:
        stage.lower()
    stage.start(trial)
    stroke = bench.record(before.noise_n, stage.patience_s, longest_s)
    name = _unused_name(folder, trial)
    write_rows(folder / f"{name}.csv", FORCES, stroke.samples)
    stage.lift()
    after = bench.tare()
    entry: Entry = trial._asdict() | {
        "file": f"{name}.csv",
        "zero_before_n": before.force_n,
        "zero_after_n": after.force_n,
        "noise_n": before.noise_n,
        "rate_hz": bench.port.line.clock.rate_hz,
        "samples": len(stroke.samples),
        **stroke.problems,
        "calibration": bench.port.calibration._asdict(),
    }
    if bench.encoder is not None:
        rate_hz = bench.encoder.line.clock.rate_hz
        counts = {"places": len(stroke.positions), "rate_hz": rate_hz, **stroke.position_problems}
        entry["position"] = {"file": f"{name}_position.csv", **counts}
        write_rows(folder / f"{name}_position.csv", POSITIONS, stroke.positions)
    analysed = analyse_trial(load_recorded(folder, trial.key, entry, settings))
    if remark := speed_remark(analysed, SINGLE_SPEED_BOUND):
        bench.report(f"{trial.key}: {remark}")  # the trial is valid; the stage can be set for the next one
    return entry, list_problems(analysed, stroke, abs(after.force_n - before.force_n))


def _unused_name(folder: Path, trial: CellTrial) -> str:
    """Return a name for the files of a trial, without their ending: those of earlier recordings stay."""
    names = (f"{RAW}/{file_part(trial.key)}_{number}" for number in count(1))
    return next(name for name in names if not (folder / f"{name}.csv").exists())


def _await_encoder(bench: CellBench) -> None:
    """Wait for an encoder that is unplugged or silent, or go on without it."""
    for attempt in count(1):
        encoder = bench.encoder
        if encoder is None:
            return
        if not encoder.line.is_there:
            path = encoder.settings.path
            bench.report(f"the stage's encoder is unplugged ({encoder.last_problem}): plug {path} in again")
        elif encoder.silent_for_s(bench.clock.now_s()) > SILENT_S:
            path = encoder.settings.path
            bench.report(f"no count arrives from the stage's encoder on {path}: check its power and cable")
        else:
            return
        answers = {GO_ON: "check again", WITHOUT: "use the force alone"}
        if attempt > MOST_ATTEMPTS or bench.ask("Does the encoder send again?", answers) == WITHOUT:
            encoder.close()
            bench.encoder = None
            bench.report(
                "going on without the position: the next trials need a stage of one speed, not one pushed by hand"
            )
        bench.listen(LISTENING_S)


# checks


def list_problems(analysed: AnalysedTrial, stroke: StrokeRecording, moved_n: float) -> list[str]:
    """Return messages on everything that may make a trial invalid. `moved_n` is the motion of the zero."""
    recorded, problems = analysed.recorded, stroke.problems
    garbled, lines = problems["garbled_lines"], len(stroke.samples) + problems["garbled_lines"]
    missing = max((fraction for _, fraction in _strokes(analysed)), default=0.0)
    sizes_n = np.abs(recorded.forces_n - recorded.zero_n)
    largest_n = float(np.max(sizes_n, initial=0.0))
    checks = [
        (problems["unpluggings"], "the load cell was unplugged during the trial"),
        (problems["overloads"] or is_clipped(sizes_n), AT_ITS_LIMIT),
        (garbled > GARBLED_FRACTION * lines, f"{garbled} of {lines} lines were garbled: check cable and ground"),
        (analysed.problem, analysed.problem),
        (analysed.remark, analysed.remark),
        *_position_checks(analysed, stroke),
        (
            moved_n > max(LEAST_DRIFT_N, DRIFT_FRACTION * largest_n),
            f"the zero moved by {moved_n:.3f} N: wipe the plate, check the mounting, let the amplifier warm up",
        ),
        (
            missing > MISSING_FRACTION,
            f"{100.0 * missing:.0f} % of the samples of its strokes are missing: check cable and connectors",
        ),
    ]
    return [message for is_wrong, message in checks if is_wrong]


def _position_checks(analysed: AnalysedTrial, stroke: StrokeRecording) -> Iterator[tuple[bool, str]]:
    problems = stroke.position_problems
    if not problems:
        return
    if problems["breaks"]:
        yield True, f"the stage's encoder was unplugged or restarted during the trial: {FORCE_ALONE}"
    elif not stroke.positions:
        yield True, f"the stage's encoder sent no position: {FORCE_ALONE}"
    elif analysed.positions_m is not None:
        unknown = max(np.mean(np.isnan(analysed.positions_m[inside])) for inside, _ in _strokes(analysed))
        yield (
            bool(unknown > MISSING_FRACTION),
            f"the stage's position is unknown for {100.0 * unknown:.0f} % of its strokes ({problems['garbled_lines']} "
            f"garbled lines, {problems['drop_outs']} gaps): check the encoder's cable and connectors",
        )


def is_clipped(forces_n: Array) -> bool:
    """Return whether the largest force repeats exactly, many times in a row, in a cell that is not always still."""
    if len(forces_n) < FLAT_SAMPLES or len(np.unique(forces_n)) < FLAT_SAMPLES:
        return False
    at_peak = forces_n == np.max(forces_n)
    return any(np.all(at_peak[i : i + FLAT_SAMPLES]) for i in np.flatnonzero(at_peak[: 1 - FLAT_SAMPLES]))


def _strokes(analysed: AnalysedTrial) -> Iterator[tuple[Mask, float]]:
    """Yield which samples belong to each stroke, and the fraction that is missing."""
    times_s = analysed.profile.times_s
    for stroke in analysed.strokes.values():
        inside, period_s = (times_s >= stroke.begin_s) & (times_s < stroke.end_s), float(np.median(np.diff(times_s)))
        yield inside, 1.0 - (np.count_nonzero(inside) + 1) * period_s / (stroke.end_s - stroke.begin_s)
