"""The trials of the load cell, one after the other: prepared, tared, recorded, judged, written down.

Samples are on the disk before anything is concluded from them, also those of a trial that is measured again; the
notebook says which file counts. Whoever starts the same experiment again goes on where it was.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from experiments.loadcell.analysis import analyse_trial
from experiments.loadcell.fits import INSERTION, KINDS, SINGLE_SPEED_BOUND, Analysed, Recorded, speed_remark
from experiments.loadcell.motion import Insertion, Shear, StageSettings, wide_pace
from experiments.loadcell.raw import load_recorded, raw_name, write_places, write_samples
from experiments.loadcell.recording import AVERAGED, CellRecorder, PlaceStretch, Stretch, Tare
from experiments.loadcell.stage import Stage, Trial
from experiments.robot.prompt import GO_ON, REDO, SKIP, Operator
from experiments.trials.notebook import Notebook
from experiments.trials.session import Show

KEEP, WITHOUT = "k", "w"
AT_ONE_SPEED = "what follows takes a stage of one speed, and none that a hand pushes"
ALONE = "its force counts alone, which takes a stage of one speed"
MOST_ATTEMPTS = 3  # after which Enter means to leave it
LEAST_DRIFT_N, DRIFT_FRACTION = 0.02, 0.03  # of the largest force, by which the zero may move over a trial
GARBLED_FRACTION = 0.05
MISSING_FRACTION = 0.15  # of the samples of a stroke
FLAT_SAMPLES = 8  # alike at the largest force: a cell that stops there without a word
SLOW, SLOW_BY_HAND = 1.6, 3.0  # times the duration of a stroke that is recorded at least
RESERVE_S = 1.5
LOOK_S, SILENT_S = 1.0, 1.0


@dataclass(frozen=True)
class TrialPlan:
    muds: tuple[str, ...]
    trials: int
    settings: StageSettings
    depth_error_m: float = 0.5e-3  # of a ruler, and of mud that is levelled by hand

    def list_trials(self) -> list[Trial]:
        numbers = range(1, self.trials + 1)
        return [Trial(mud, kind, number) for mud in self.muds for kind in KINDS for number in numbers]


@dataclass(frozen=True)
class TrialBench:
    """What the trials are made with."""

    recorder: CellRecorder
    stage: Stage
    operator: Operator
    notebook: Notebook
    folder: Path
    show: Show


def measure_all(bench: TrialBench, plan: TrialPlan) -> None:
    """All that is not in the notebook yet."""
    trials, place = plan.list_trials(), 0
    while place < len(trials):
        bench.show(place, len(trials))
        trial = trials[place]
        if trial.key in bench.notebook.entries:
            place += 1
            continue
        answer = bench.stage.prepare(trial, plan.trials)
        if answer == REDO and place > 0:
            place -= 1
            bench.notebook.forget(trials[place].key)
        elif answer == SKIP:
            bench.notebook.write(trial.key, {"skipped": True})
        elif answer == GO_ON:
            measure(bench, trial, plan)
    bench.show(len(trials), len(trials))


def measure(bench: TrialBench, trial: Trial, plan: TrialPlan) -> None:
    """Once, or again where it came to nothing; the plate is ready."""
    for attempt in count(1):
        entry, problems = record(bench, trial, plan, attempt)
        if not problems:
            return bench.notebook.write(trial.key, entry)
        for problem in problems:
            bench.operator.report(f"{trial.key}: {problem}")
        answer = bench.operator.ask(f"{trial.key} is in doubt. What now?", _answers(attempt), bench.recorder.drain)
        if answer == KEEP:
            return bench.notebook.write(trial.key, entry | {"kept_in_spite_of": problems})
        given_up = answer == SKIP or (answer == GO_ON and attempt >= MOST_ATTEMPTS)
        if given_up or bench.stage.prepare(trial, plan.trials) == SKIP:
            return bench.notebook.write(trial.key, entry | {"skipped": True, "why": problems})
    return None


def _answers(attempt: int) -> dict[str, str]:
    if attempt >= MOST_ATTEMPTS:
        return {GO_ON: "leave it out", REDO: "measure it again", KEEP: "keep it as it is"}
    return {GO_ON: "measure it again", KEEP: "keep it as it is", SKIP: "leave it out"}


def record(bench: TrialBench, trial: Trial, plan: TrialPlan, attempt: int) -> tuple[dict[str, Any], list[str]]:
    """What belongs into the notebook, and what is wrong with it."""
    recorder, stage = bench.recorder, bench.stage
    on_encoder(bench)
    before = recorder.tare()
    if before.is_averaged and trial.number == attempt == 1:
        bench.operator.report(f"{trial.key}: {AVERAGED}")
    if trial.kind != INSERTION:
        stage.lower()
    stage.start(trial)
    stretch = recorder.record(
        before.noise_n, stage.patience_s, stroke_s(trial.kind, plan.settings, bool(recorder.encoder))
    )
    name, place_name = raw_name(trial.key, attempt), raw_name(trial.key, attempt, "_position")
    write_samples(bench.folder / name, stretch.samples)
    if stretch.position is not None:
        write_places(bench.folder / place_name, stretch.position.places)
    stage.lift()
    after = recorder.tare()
    entry = _entry(trial, name, recorder, stretch, before, after)
    if stretch.position is not None:
        entry["position"] = _position_entry(place_name, recorder, stretch.position)
    recorded = load_recorded(bench.folder, trial.key, entry)
    analysed = analyse_trial(recorded, plan.settings, wide_pace(plan.settings))
    _on_speed(bench, analysed, plan.settings)
    return entry, evaluate(analysed, stretch, before, after)


def stroke_s(kind: str, settings: StageSettings, is_measured: bool = False) -> float:
    """How long is recorded from the contact on; a stage with an encoder may be pushed by a hand."""
    slow = SLOW_BY_HAND if is_measured else SLOW
    if kind == INSERTION:
        return 2.0 * slow * settings.depth_m / settings.speed_m_s + settings.hold_s + RESERVE_S
    return slow * settings.shear_path_m / settings.speed_m_s


def on_encoder(bench: TrialBench) -> None:
    """One that is gone or silent is looked after, or given up: a force says much by itself."""
    recorder, looks = bench.recorder, 0
    while recorder.encoder is not None and (trouble := _trouble_of(recorder)):
        bench.operator.report(trouble)
        answers = {GO_ON: "look again", WITHOUT: "go on by the force alone"}
        answer = bench.operator.ask("Is it back?", answers, recorder.drain) if looks < MOST_ATTEMPTS else WITHOUT
        if answer == WITHOUT:
            recorder.encoder.close()
            recorder.encoder = None
            bench.operator.report(
                f"going on without the position, until the same command is started again: {AT_ONE_SPEED}"
            )
        recorder.listen(LOOK_S)
        looks += 1


def _trouble_of(recorder: CellRecorder) -> str:
    encoder = recorder.encoder
    if encoder is None:
        return ""
    if not encoder.is_there:
        return f"the stage's encoder is gone ({encoder.last_problem}): plug {encoder.settings.path} in again"
    if encoder.silent_for_s(recorder.clock.now_s()) > SILENT_S:
        return f"no count comes from the stage's encoder on {encoder.settings.path}: check its power and cable"
    return ""


def _on_speed(bench: TrialBench, analysed: Analysed, settings: StageSettings) -> None:
    """Told while the stage can still be set; nothing to repeat the trial for."""
    remark = speed_remark(analysed.pace, settings, SINGLE_SPEED_BOUND) if analysed.pace is not None else ""
    if remark:
        bench.operator.report(f"{analysed.recorded.key}: {remark}")


def _entry(
    trial: Trial, name: str, recorder: CellRecorder, stretch: Stretch, before: Tare, after: Tare
) -> dict[str, Any]:
    return {
        "mud": trial.mud,
        "kind": trial.kind,
        "number": trial.number,
        "file": name,
        "zero_before_n": before.force_n,
        "zero_after_n": after.force_n,
        "noise_n": before.noise_n,
        "rate_hz": recorder.port.rate_hz,
        "samples": len(stretch.samples),
        "garbled_lines": stretch.garbled_lines,
        "drop_outs": stretch.drop_outs,
        "unpluggings": stretch.unpluggings,
        "overloads": stretch.overloads,
        "calibration": recorder.port.calibration._asdict(),
    }


def _position_entry(name: str, recorder: CellRecorder, reported: PlaceStretch) -> dict[str, Any]:
    encoder = recorder.encoder
    return {
        "file": name,
        "places": len(reported.places),
        "rate_hz": None if encoder is None else encoder.rate_hz,
        "garbled_lines": reported.garbled_lines,
        "drop_outs": reported.drop_outs,
        "breaks": reported.breaks,
    }


def evaluate(analysed: Analysed, stretch: Stretch, before: Tare, after: Tare) -> list[str]:
    """What a trial should not be kept with."""
    reported, recorded = list[str](), analysed.recorded
    if stretch.unpluggings:
        reported.append("the load cell was unplugged in the middle of it")
    if stretch.overloads or is_clipped(recorded.forces_n):
        reported.append(
            "the load cell was at its limit: the force is larger than it measures. Take a cell of a larger range, a "
            "smaller plate, or a lower gain of the amplifier"
        )
    lines = len(stretch.samples) + stretch.garbled_lines
    if stretch.garbled_lines > GARBLED_FRACTION * lines:
        reported.append(f"{stretch.garbled_lines} of {lines} lines were garbled: check cable and ground")
    reported += [each for each in (analysed.problem, analysed.remark) if each]
    if stretch.position is not None:
        reported += _evaluate_position(analysed, stretch.position)
    moved_n, largest_n = abs(after.force_n - before.force_n), _largest_n(recorded)
    if moved_n > max(LEAST_DRIFT_N, DRIFT_FRACTION * largest_n):
        reported.append(
            f"the zero moved by {moved_n:.3f} N over the trial: something slipped, mud clings to the plate, or the "
            "cell drifts. Wipe the plate, check the mounting, let the amplifier warm up"
        )
    missing = missing_fraction(analysed)
    if missing > MISSING_FRACTION:
        reported.append(
            f"{100.0 * missing:.0f} % of the samples of its strokes are missing: check cable and connectors"
        )
    return reported


def _evaluate_position(analysed: Analysed, reported: PlaceStretch) -> list[str]:
    if reported.breaks:
        return ["the stage's encoder was unplugged or began anew in the middle of it: kept, " + ALONE]
    if not reported.places:
        return ["the stage's encoder told no place: kept, " + ALONE]
    missing = _fraction_without_place(analysed)
    if missing > MISSING_FRACTION:
        return [
            f"for {100.0 * missing:.0f} % of its strokes the stage's place is not known "
            f"({reported.garbled_lines} lines garbled, {reported.drop_outs} gaps): check the encoder's cable "
            "and connectors"
        ]
    return []


def _fraction_without_place(analysed: Analysed) -> float:
    if analysed.positions_m is None or analysed.profile is None:
        return 0.0
    times_s, fractions = analysed.profile.times_s, [0.0]
    for begin_s, end_s in _strokes(analysed):
        inside = (times_s >= begin_s) & (times_s < end_s)
        fractions.append(float(np.mean(np.isnan(analysed.positions_m[inside]))) if np.any(inside) else 0.0)
    return max(fractions)


def _largest_n(recorded: Recorded) -> float:
    return float(np.max(np.abs(recorded.forces_n - recorded.zero_n), initial=0.0))


def is_clipped(forces_n: np.ndarray[Any, np.dtype[np.float64]]) -> bool:
    """The largest force comes many times in a row, exactly, and the cell is not always still."""
    if len(forces_n) < FLAT_SAMPLES or len(np.unique(forces_n)) < FLAT_SAMPLES:
        return False
    ends = (forces_n == np.max(forces_n)) | (forces_n == np.min(forces_n))
    return any(np.all(ends[i : i + FLAT_SAMPLES]) for i in np.flatnonzero(ends))


def missing_fraction(analysed: Analysed) -> float:
    """Of the samples that the strokes should have, where it is worst."""
    if analysed.profile is None or analysed.motion is None:
        return 0.0
    times_s = analysed.profile.times_s
    period_s = float(np.median(np.diff(times_s)))
    fractions = []
    for begin_s, end_s in _strokes(analysed):
        inside = np.count_nonzero((times_s >= begin_s) & (times_s < end_s))
        fractions.append(1.0 - (inside + 1) * period_s / (end_s - begin_s))
    return max(fractions)


def _strokes(analysed: Analysed) -> Iterable[tuple[float, float]]:
    motion, extraction = analysed.motion, analysed.extraction
    if isinstance(motion, Shear):
        yield motion.begin_s, motion.steady_to_s
    if isinstance(motion, Insertion):
        yield motion.surface_s, motion.stop_s
    if extraction is not None:
        yield extraction.lift_s, extraction.out_s
