"""Measures the true coefficients of a mud with a load cell on a linear stage (the paper's section II-E).

A plate is dragged 20 cm through the mud at a depth of 3 cm. In other trials it goes down 3 cm, holds for 3 s and comes
out again. The stage moves at 0.1 m/s, and each kind of trial is repeated five times. The cell's amplifier and,
optionally, a position encoder of the stage are serial ports; the operator moves the stage.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from drivers.load_cell.calibration import LoadCellCalibration
from drivers.load_cell.line_formats import AUTO, COUNTS, NUMBER, LineFormat
from drivers.load_cell.load_cell_port import LoadCellPort
from drivers.load_cell.stage_encoder import StageEncoder, StageEncoderSettings
from drivers.serial.serial_line import SerialLineError
from experiments.loadcell.analysis.analyse import analyse
from experiments.loadcell.analysis.coefficients import (
    COEFFICIENTS,
    AnalysedTrial,
    MudCoefficient,
    bench_uncertainty,
    gather_trials,
    speed_remark,
)
from experiments.loadcell.analysis.force_motion import StageSettings
from experiments.loadcell.comparison import Compared, compare_muds
from experiments.loadcell.preparation import OR_WITHOUT, CellSettings, prepare_cell
from experiments.loadcell.recording import CellRecorder, WallClock, load_counted
from experiments.loadcell.stage import ManualStage, SimulatedStage, Stage, clay_truth, water_of
from experiments.loadcell.trials import TrialBench, TrialPlan, measure_all
from experiments.reports.report_page import to_json
from experiments.robot.bench_errors import BenchError
from experiments.trials.notebook import Entry, Notebook
from experiments.trials.session import Session, Show
from simulation.test_rig.emulated_instruments import AmplifierParameters, StageEncoderParameters
from simulation.test_rig.load_cell_bench import EmulatedBench, clay_plate, position_link
from simulation.test_rig.plate_stage import StageParameters
from simulation.test_rig.stage_motion import ManualMotionParameters


@dataclass(frozen=True)
class BenchSettings:
    """The devices of the bench. Without a port they are emulated."""

    port: str | None
    baud: int
    cell: CellSettings
    encoder: StageEncoderSettings | None
    seed: int  # of the emulated devices

    @property
    def name(self) -> str:
        return "simulated" if self.port is None else "load cell"


class Results(NamedTuple):
    trials: list[AnalysedTrial]
    muds: dict[str, dict[str, MudCoefficient]]  # by mud and coefficient
    remarks: list[str]
    compared: list[Compared]
    flipper: Mapping[str, Any]  # summary of the flipper experiment; empty where there is none


@dataclass(frozen=True)
class LoadcellReport:
    settings: Mapping[str, float]
    cell: Mapping[str, Any]
    stage: Mapping[str, float | None]
    muds: Sequence[Mapping[str, Any]]
    trials: Sequence[Mapping[str, Any]]
    left_out: Mapping[str, Entry]
    remarks: Sequence[str]
    compared: Sequence[Mapping[str, Any]]
    truth: Mapping[str, Any]  # of simulated muds
    experiment: str = "loadcell"


def measure_muds(
    session: Session, plan: TrialPlan, bench: BenchSettings, flipper: Mapping[str, Any] | None
) -> tuple[Results, LoadcellReport]:
    """Measure the missing trials and evaluate all of them. Raises BenchError with what to do."""
    notebook = Notebook(session.folder, notebook_plan(plan.settings) | {"bench": bench.name})
    missing = [trial for trial in plan.list_trials() if trial.key not in notebook.entries]
    _report_progress(session, notebook, len(missing), bench.encoder is not None)
    cell: dict[str, Any] = {
        "bench": bench.name,
        "port": bench.port,
        "baud": bench.baud,
        "format": bench.cell.format_name,
    }
    if missing:
        cell |= _measure(session, plan, bench, notebook)
    results = evaluate_muds(session.folder, notebook, plan, flipper, session.show)
    if not results.trials:
        raise BenchError("no trial counts, so there is nothing to evaluate")
    truth = {mud: clay_truth(water_of(mud), plan.settings) for mud in results.muds} if bench.port is None else {}
    return results, make_report(results, notebook, plan, cell, truth)


def notebook_plan(settings: StageSettings) -> dict[str, Any]:
    """Return the options that must be the same in all trials of one folder; muds and trials may be added."""
    return {"experiment": "loadcell", **to_json(settings)}


def _report_progress(session: Session, notebook: Notebook, missing: int, has_encoder: bool) -> None:
    if not notebook.entries:
        return
    report = session.operator.report
    report(f"{len(notebook.entries)} trials are in {session.folder} already, {missing} are left")
    without = sum("file" in entry and "position" not in entry for entry in notebook.entries.values())
    if has_encoder and without:
        report(f"{without} of them have no measured position; their depth is found from the force")


def _measure(session: Session, plan: TrialPlan, bench: BenchSettings, notebook: Notebook) -> dict[str, Any]:
    """Measure the missing trials; return a description of the load cell."""
    with ExitStack() as devices:
        emulated = _emulate(plan, bench, devices) if bench.port is None else None
        path = bench.port or str(emulated[1] if emulated else "")
        port = _open_cell(path, bench)
        devices.callback(port.close)
        encoder = None if bench.encoder is None else _open_encoder(bench.encoder, None if bench.port else path)
        if encoder is not None:
            devices.callback(encoder.close)
        clock = emulated[0] if emulated else WallClock()
        recorder = CellRecorder(port, clock, session.operator.report, encoder)
        stage: Stage = ManualStage(plan.settings, session.operator, recorder.drain)
        if emulated is not None:
            plates = {mud: clay_plate(water_of(mud), plan.settings.plate) for mud in plan.muds}
            stage = SimulatedStage(plan.settings, emulated[0], plates, bench.seed)
        trial_bench = TrialBench(recorder, stage, session.operator, notebook, session.folder, session.show)
        prepare_cell(trial_bench, plan.settings, bench.cell)
        measure_all(trial_bench, plan)
        return _describe_cell(port, encoder)


def _emulate(plan: TrialPlan, bench: BenchSettings, devices: ExitStack) -> tuple[EmulatedBench, Path]:
    """Start the emulated devices; return them and the path of the load cell's port."""
    link = Path(devices.enter_context(tempfile.TemporaryDirectory(prefix="mudskipper-"))) / "load_cell"
    plate = clay_plate(water_of(plan.muds[0]), plan.settings.plate)
    amplifier = AmplifierParameters(baud=bench.baud)
    encoder, stage = None, None
    if bench.encoder is not None:  # a stage with an encoder is pushed by hand
        settings = bench.encoder
        encoder = StageEncoderParameters(
            metres_per_count=settings.metres_per_count, baud=settings.baud, label=settings.label
        )
        stage = StageParameters(manual=ManualMotionParameters(), seed=bench.seed)
    emulated = EmulatedBench(plate, link, amplifier, stage, bench.seed, encoder)
    devices.callback(emulated.close)
    return emulated, link


def _open_cell(path: str, bench: BenchSettings) -> LoadCellPort:
    """Open the port with an assumed format; its lines are examined next."""
    cell = bench.cell
    line_format = LineFormat(NUMBER if cell.format_name == AUTO else cell.format_name)
    try:
        return LoadCellPort(path, bench.baud, line_format, LoadCellCalibration(cell.unit or COUNTS, 1.0))
    except SerialLineError as problem:
        raise BenchError(str(problem)) from problem


def _open_encoder(settings: StageEncoderSettings, emulated_cell: str | None) -> StageEncoder:
    if emulated_cell is not None:
        settings = replace(settings, path=str(position_link(Path(emulated_cell))))
    try:
        return StageEncoder(settings)
    except SerialLineError as problem:
        raise BenchError(f"the stage's encoder: {problem}; {OR_WITHOUT}") from problem


def _describe_cell(port: LoadCellPort, encoder: StageEncoder | None) -> dict[str, Any]:
    position = None
    if encoder is not None:
        position = asdict(encoder.settings) | {
            "counts": encoder.counts.accepted,
            "rate_hz": encoder.line.clock.rate_hz,
            "garbled_lines": encoder.counts.malformed,
            "breaks": encoder.breaks,
        }
    return {
        "port": port.line.path,
        "format": port.line_format.name,
        "rate_hz": port.line.clock.rate_hz,
        "lines": port.lines,
        "garbled_lines": port.malformed_lines,
        "last_garbled": port.last_malformed,
        "calibration": port.calibration._asdict(),
        "position": position,
    }


def evaluate_muds(
    folder: Path, notebook: Notebook, plan: TrialPlan, flipper: Mapping[str, Any] | None, show: Show
) -> Results:
    """Evaluate the recorded trials of a folder."""
    trials = analyse(load_counted(folder, notebook), plan.settings, show)
    muds = {}
    for mud in dict.fromkeys(trial.recorded.mud for trial in trials):
        own = [trial for trial in trials if trial.recorded.mud == mud]
        errors = _bench_errors(own, notebook, plan)
        muds[mud] = {name: gather_trials(own, name, errors[name]) for name in COEFFICIENTS}
    return Results(trials, muds, list_remarks(trials, plan.settings), compare_muds(flipper, muds), flipper or {})


def _bench_errors(trials: Sequence[AnalysedTrial], notebook: Notebook, plan: TrialPlan) -> dict[str, float]:
    """Return the fraction by which the bench may err alike in all trials of a mud, by coefficient."""
    calibrations = [notebook.entries[trial.recorded.key]["calibration"] for trial in trials]
    calibration_error = max(LoadCellCalibration(**calibration).relative_error for calibration in calibrations)
    depth_errors_m = dict.fromkeys(COEFFICIENTS, plan.depth_error_m)
    if all(trial.is_measured for trial in trials if trial.coefficients):
        depth_errors_m |= {"k_p": 0.0, "k_e": 0.0}  # a shear keeps the depth that the operator set
    return {
        name: bench_uncertainty(name, plan.settings, depth_errors_m[name], calibration_error) for name in COEFFICIENTS
    }


def list_remarks(trials: Sequence[AnalysedTrial], settings: StageSettings) -> list[str]:
    remarks = [f"{trial.recorded.key}: {text}" for trial in trials for text in (trial.problem, trial.remark) if text]
    paced = [(trial.recorded.key, trial.pace) for trial in trials if trial.pace is not None]
    by_trial = {key: remark for key, pace in paced if (remark := speed_remark(pace, settings))}
    if len(by_trial) > 3:
        remarks.append(f"in {len(by_trial)} trials {next(iter(by_trial.values()))}")
    else:
        remarks += [f"{key}: {remark}" for key, remark in by_trial.items()]
    turned = sum(trial.profile is not None and trial.profile.turned for trial in trials)
    if turned:
        remarks.append(f"in {turned} trials the cell measured with the opposite sign; their forces are turned")
    return remarks


def make_report(
    results: Results, notebook: Notebook, plan: TrialPlan, cell: Mapping[str, Any], truth: Mapping[str, Any]
) -> LoadcellReport:
    paces = [trial.pace for trial in results.trials if trial.pace is not None]
    return LoadcellReport(
        settings=to_json(plan.settings) | {"depth_error_m": plan.depth_error_m},
        cell=cell,
        stage={
            "speed_m_s": sum(pace.speed_m_s for pace in paces) / len(paces) if paces else None,
            "acceleration_m_s2": sum(pace.acceleration_m_s2 for pace in paces) / len(paces) if paces else None,
        },
        muds=[
            {"mud": mud} | {name: each._asdict() | {"std_error": each.std_error} for name, each in coefficients.items()}
            for mud, coefficients in results.muds.items()
        ],
        trials=[_trial_entries(trial, notebook.entries[trial.recorded.key]) for trial in results.trials],
        left_out=notebook.left_out,
        remarks=results.remarks,
        compared=[
            row._asdict() | {"ratio": row.ratio, "ratio_std_error": row.ratio_std_error} for row in results.compared
        ],
        truth=truth,
    )


def _trial_entries(trial: AnalysedTrial, entry: Entry) -> dict[str, Any]:
    """Join the notebook's entry of a trial and its results, by the names that programs read."""
    return {"key": trial.recorded.key, **entry, **trial.coefficients} | {
        "speed_m_s": trial.speed_m_s,
        "is_measured": trial.is_measured,
        "place_error_m": trial.position_error_m if trial.is_measured else None,
        "alignment": trial.alignment,
        "problem": trial.problem,
        "remark": trial.remark,
    }
