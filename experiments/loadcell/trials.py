"""The trials of the load cell, one after the other: prepared, tared, recorded, checked and written to the notebook.

Samples are on the disk before they are evaluated, and the files of a repeated trial stay there; the notebook names the
file that counts. The same command continues an interrupted experiment.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from experiments.loadcell.analysis.analyse import analyse_trial
from experiments.loadcell.analysis.coefficients import INSERTION, KINDS, SINGLE_SPEED_BOUND, speed_remark
from experiments.loadcell.analysis.force_motion import StageSettings, wide_pace
from experiments.loadcell.recording import (
    AVERAGED,
    CellRecorder,
    StrokeRecording,
    Tare,
    load_recorded,
    raw_name,
    write_positions,
    write_samples,
)
from experiments.loadcell.stage import Stage, Trial
from experiments.loadcell.trial_checks import list_problems
from experiments.robot.prompt import GO_ON, REDO, SKIP, Operator
from experiments.trials.notebook import Notebook
from experiments.trials.session import Show

KEEP, WITHOUT = "k", "w"
MOST_ATTEMPTS = 3  # after which Enter leaves the trial out
SLOW, SLOW_BY_HAND = 1.6, 3.0  # recorded time over the expected time of a stroke
RESERVE_S = 1.5
LISTENING_S, SILENT_S = 1.0, 1.0


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
    """The devices, the operator and the files of the trials."""

    recorder: CellRecorder
    stage: Stage
    operator: Operator
    notebook: Notebook
    folder: Path
    show: Show


def measure_all(bench: TrialBench, plan: TrialPlan) -> None:
    """Measure every trial that is not in the notebook."""
    trials, index = plan.list_trials(), 0
    while index < len(trials):
        bench.show(index, len(trials))
        trial = trials[index]
        if trial.key in bench.notebook.entries:
            index += 1
            continue
        answer = bench.stage.prepare(trial, plan.trials)
        if answer == REDO and index > 0:
            index -= 1
            bench.notebook.forget(trials[index].key)
        elif answer == SKIP:
            bench.notebook.write(trial.key, {"skipped": True})
        elif answer == GO_ON:
            measure(bench, trial, plan)
    bench.show(len(trials), len(trials))


def measure(bench: TrialBench, trial: Trial, plan: TrialPlan) -> None:
    """Measure a prepared trial, again where the operator wants it so."""
    for attempt in count(1):
        entry, problems = record(bench, trial, plan, attempt)
        if not problems:
            return bench.notebook.write(trial.key, entry)
        for problem in problems:
            bench.operator.report(f"{trial.key}: {problem}")
        answer = bench.operator.ask(
            f"{trial.key} may be invalid. What now?", _offer_answers(attempt), bench.recorder.drain
        )
        if answer == KEEP:
            return bench.notebook.write(trial.key, entry | {"kept_in_spite_of": problems})
        given_up = answer == SKIP or (answer == GO_ON and attempt >= MOST_ATTEMPTS)
        if given_up or bench.stage.prepare(trial, plan.trials) == SKIP:
            return bench.notebook.write(trial.key, entry | {"skipped": True, "why": problems})
    return None


def _offer_answers(attempt: int) -> dict[str, str]:
    if attempt >= MOST_ATTEMPTS:
        return {GO_ON: "leave it out", REDO: "measure it again", KEEP: "keep it as it is"}
    return {GO_ON: "measure it again", KEEP: "keep it as it is", SKIP: "leave it out"}


def record(bench: TrialBench, trial: Trial, plan: TrialPlan, attempt: int) -> tuple[dict[str, Any], list[str]]:
    """Record one stroke; return its entry for the notebook, and its problems."""
    recorder, stage = bench.recorder, bench.stage
    await_encoder(bench)
    before = recorder.tare()
    if before.is_averaged and trial.number == attempt == 1:
        bench.operator.report(f"{trial.key}: {AVERAGED}")
    if trial.kind != INSERTION:
        stage.lower()
    stage.start(trial)
    longest_s = stroke_s(trial.kind, plan.settings, bool(recorder.encoder))
    stroke = recorder.record(before.noise_n, stage.patience_s, longest_s)
    name, position_name = raw_name(trial.key, attempt), raw_name(trial.key, attempt, "_position")
    write_samples(bench.folder / name, stroke.samples)
    stage.lift()
    after = recorder.tare()
    entry = _make_entry(trial, name, recorder, stroke, before, after)
    if recorder.encoder is not None and stroke.position_problems is not None:
        write_positions(bench.folder / position_name, stroke.positions)
        entry["position"] = {
            "file": position_name,
            "places": len(stroke.positions),
            "rate_hz": recorder.encoder.line.clock.rate_hz,
            **stroke.position_problems._asdict(),
        }
    recorded = load_recorded(bench.folder, trial.key, entry)
    analysed = analyse_trial(recorded, plan.settings, wide_pace(plan.settings))
    if analysed.pace and (remark := speed_remark(analysed.pace, plan.settings, SINGLE_SPEED_BOUND)):
        bench.operator.report(f"{trial.key}: {remark}")  # the trial is valid; the stage can be set for the next one
    return entry, list_problems(analysed, stroke, before, after)


def stroke_s(kind: str, settings: StageSettings, is_measured: bool = False) -> float:
    """Return the time to record after the contact; a stage with an encoder may be pushed by hand."""
    slow = SLOW_BY_HAND if is_measured else SLOW
    if kind == INSERTION:
        return 2.0 * slow * settings.depth_m / settings.speed_m_s + settings.hold_s + RESERVE_S
    return slow * settings.shear_path_m / settings.speed_m_s


def await_encoder(bench: TrialBench) -> None:
    """Wait for an encoder that is unplugged or silent, or go on without it."""
    recorder, attempts = bench.recorder, 0
    while recorder.encoder is not None and (problem := _encoder_problem(recorder)):
        bench.operator.report(problem)
        answers = {GO_ON: "check again", WITHOUT: "use the force alone"}
        question = "Does the encoder send again?"
        answer = bench.operator.ask(question, answers, recorder.drain) if attempts < MOST_ATTEMPTS else WITHOUT
        if answer == WITHOUT:
            recorder.encoder.close()
            recorder.encoder = None
            bench.operator.report(
                "going on without the position, until the same command is started again: the next trials need a stage "
                "of one speed, not one that is pushed by hand"
            )
        recorder.listen(LISTENING_S)
        attempts += 1


def _encoder_problem(recorder: CellRecorder) -> str:
    encoder = recorder.encoder
    if encoder is None:
        return ""
    if not encoder.line.is_there:
        return f"the stage's encoder is unplugged ({encoder.last_problem}): plug {encoder.settings.path} in again"
    if encoder.silent_for_s(recorder.clock.now_s()) > SILENT_S:
        return f"no count arrives from the stage's encoder on {encoder.settings.path}: check its power and cable"
    return ""


def _make_entry(
    trial: Trial, name: str, recorder: CellRecorder, stroke: StrokeRecording, before: Tare, after: Tare
) -> dict[str, Any]:
    return {
        "mud": trial.mud,
        "kind": trial.kind,
        "number": trial.number,
        "file": name,
        "zero_before_n": before.force_n,
        "zero_after_n": after.force_n,
        "noise_n": before.noise_n,
        "rate_hz": recorder.port.line.clock.rate_hz,
        "samples": len(stroke.samples),
        "garbled_lines": stroke.problems.garbled_lines,
        "drop_outs": stroke.problems.drop_outs,
        "unpluggings": stroke.problems.breaks,
        "overloads": stroke.overloads,
        "calibration": recorder.port.calibration._asdict(),
    }
