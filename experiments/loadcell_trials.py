"""The trials of the load cell, one after the other: prepared, tared, recorded, judged, written down.

Samples are on the disk before anything is concluded from them, also those of a trial that is measured again; the
notebook says which file counts. Whoever starts the same experiment again goes on where it was.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from drivers.load_cell_port import Sample
from experiments.loadcell_analysis import analyse_trial
from experiments.loadcell_fits import (
    INSERTION,
    KINDS,
    SINGLE_SPEED_BOUND,
    Analysed,
    Recorded,
    speed_remark,
)
from experiments.loadcell_motion import Insertion, Shear, StageSettings, wide_pace
from experiments.loadcell_recording import CellRecorder, Stretch, Tare
from experiments.loadcell_stage import Stage, Trial
from experiments.notebook import Notebook
from experiments.person import GO_ON, REDO, SKIP, Person
from experiments.side_by_side import Show

RAW = "raw"
COLUMNS = ("t_s", "force_n", "overloaded")
KEEP = "k"
MOST_ATTEMPTS = 3  # after which Enter means to leave it
LEAST_DRIFT_N, DRIFT_SHARE = 0.02, 0.03  # of the largest force, by which the zero may move over a trial
GARBLED_SHARE = 0.05
MISSING_SHARE = 0.15  # of the samples of a stroke
FLAT_SAMPLES = 8  # alike at the largest force: a cell that stops there without a word
SLOW = 1.6  # times the duration of a stroke that is recorded at least
RESERVE_S = 1.5


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
    person: Person
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
            bench.person.tell(f"{trial.key}: {problem}")
        answer = bench.person.ask(f"{trial.key} is in doubt. What now?", _answers(attempt), bench.recorder.drain)
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
    before = recorder.tare()
    if trial.kind != INSERTION:
        stage.lower()
    stage.start(trial)
    stretch = recorder.record(before.noise_n, stage.patience_s, stroke_s(trial.kind, plan.settings))
    name = f"{RAW}/{_file_name(trial.key)}_{attempt}.csv"
    write_samples(bench.folder / name, stretch.samples)
    stage.lift()
    after = recorder.tare()
    entry = _entry(trial, name, recorder, stretch, before, after)
    recorded = load_recorded(bench.folder, trial.key, entry)
    analysed = analyse_trial(recorded, plan.settings, wide_pace(plan.settings))
    _heed_speed(bench, analysed, plan.settings)
    return entry, judge(analysed, stretch, before, after)


def stroke_s(kind: str, settings: StageSettings) -> float:
    """How long is recorded from the contact on."""
    if kind == INSERTION:
        return 2.0 * SLOW * settings.depth_m / settings.speed_m_s + settings.hold_s + RESERVE_S
    return SLOW * settings.shear_way_m / settings.speed_m_s


def _heed_speed(bench: TrialBench, analysed: Analysed, settings: StageSettings) -> None:
    """Told while the stage can still be set; nothing to repeat the trial for."""
    remark = speed_remark(analysed.pace, settings, SINGLE_SPEED_BOUND) if analysed.pace is not None else ""
    if remark:
        bench.person.tell(f"{analysed.recorded.key}: {remark}")


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


def judge(analysed: Analysed, stretch: Stretch, before: Tare, after: Tare) -> list[str]:
    """What a trial should not be kept with."""
    told, recorded = list[str](), analysed.recorded
    if stretch.unpluggings:
        told.append("the load cell was unplugged in the middle of it")
    if stretch.overloads or is_clipped(recorded.forces_n):
        told.append(
            "the load cell was at its limit: the force is larger than it measures. Take a cell of a larger range, a "
            "smaller plate, or a lower gain of the amplifier"
        )
    lines = len(stretch.samples) + stretch.garbled_lines
    if stretch.garbled_lines > GARBLED_SHARE * lines:
        told.append(f"{stretch.garbled_lines} of {lines} lines were garbled: check cable and ground")
    told += [each for each in (analysed.problem, analysed.remark) if each]
    moved_n, largest_n = abs(after.force_n - before.force_n), _largest_n(recorded)
    if moved_n > max(LEAST_DRIFT_N, DRIFT_SHARE * largest_n):
        told.append(
            f"the zero moved by {moved_n:.3f} N over the trial: something slipped, mud clings to the plate, or the "
            "cell drifts. Wipe the plate, check the mounting, let the amplifier warm up"
        )
    missing = missing_share(analysed)
    if missing > MISSING_SHARE:
        told.append(f"{100.0 * missing:.0f} % of the samples of its strokes are missing: check cable and connectors")
    return told


def _largest_n(recorded: Recorded) -> float:
    return float(np.max(np.abs(recorded.forces_n - recorded.zero_n), initial=0.0))


def is_clipped(forces_n: np.ndarray[Any, np.dtype[np.float64]]) -> bool:
    """The largest force comes many times in a row, exactly, and the cell is not always still."""
    if len(forces_n) < FLAT_SAMPLES or len(np.unique(forces_n)) < FLAT_SAMPLES:
        return False
    ends = (forces_n == np.max(forces_n)) | (forces_n == np.min(forces_n))
    return any(np.all(ends[i : i + FLAT_SAMPLES]) for i in np.flatnonzero(ends))


def missing_share(analysed: Analysed) -> float:
    """Of the samples that the strokes should have, where it is worst."""
    if analysed.course is None or analysed.motion is None:
        return 0.0
    times_s = analysed.course.times_s
    period_s = float(np.median(np.diff(times_s)))
    shares = []
    for begin_s, end_s in _strokes(analysed):
        inside = np.count_nonzero((times_s >= begin_s) & (times_s < end_s))
        shares.append(1.0 - (inside + 1) * period_s / (end_s - begin_s))
    return max(shares)


def _strokes(analysed: Analysed) -> Iterable[tuple[float, float]]:
    motion, extraction = analysed.motion, analysed.extraction
    if isinstance(motion, Shear):
        yield motion.begin_s, motion.steady_to_s
    if isinstance(motion, Insertion):
        yield motion.surface_s, motion.stop_s
    if extraction is not None:
        yield extraction.lift_s, extraction.out_s


def _file_name(key: str) -> str:
    return re.sub(r"[^\w.]+", "_", key)


def write_samples(path: Path, samples: Iterable[Sample]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows((f"{s.stamp_s:.6f}", f"{s.force_n:.6f}", int(s.overloaded)) for s in samples)


def load_recorded(folder: Path, key: str, entry: dict[str, Any]) -> Recorded:
    """From the disk. Raises OSError, ValueError where the file is none of these."""
    with (folder / entry["file"]).open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["overloaded"] == "0"]
    times_s = np.array([float(row["t_s"]) for row in rows])
    forces_n = np.array([float(row["force_n"]) for row in rows])
    zero_n = (entry["zero_before_n"] + entry["zero_after_n"]) / 2.0
    return Recorded(key, entry["mud"], entry["kind"], times_s, forces_n, zero_n)


def load_all(folder: Path, notebook: Notebook) -> list[Recorded]:
    """The trials that count."""
    counted = {key: entry for key, entry in notebook.entries.items() if "file" in entry and not entry.get("skipped")}
    return [load_recorded(folder, key, entry) for key, entry in counted.items()]
