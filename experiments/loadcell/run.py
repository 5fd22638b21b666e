"""Measures the true coefficients of a mud with a load cell on a linear stage (the paper's section II-E).

A plate is dragged 20 cm through the mud at a depth of 3 cm. In other trials it goes down 3 cm, holds for 3 s and comes
out again. The stage moves at 0.1 m/s, and each kind of trial is repeated five times. The cell's amplifier and,
optionally, a position encoder of the stage are serial ports; the operator moves the stage.
"""

import tempfile
from collections.abc import Mapping
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from drivers.load_cell.calibration import LoadCellCalibration
from drivers.load_cell.line_formats import AUTO, COUNTS, NUMBER, LineFormat
from drivers.load_cell.load_cell_port import LoadCellPort
from drivers.load_cell.stage_encoder import StageEncoder, StageEncoderSettings
from drivers.serial.serial_line import SerialLineError
from experiments.loadcell.comparison import truth_rows
from experiments.loadcell.evaluation import evaluate_muds, make_report
from experiments.loadcell.preparation import OR_WITHOUT, CellSettings, prepare_cell
from experiments.loadcell.recording import RAW, CellRecorder, WallClock
from experiments.loadcell.report import TITLE, make_sections, make_tables
from experiments.loadcell.stage import ManualStage, SimulatedStage, clay_truth, water_of
from experiments.loadcell.strokes import StageSettings
from experiments.loadcell.trials import TrialBench, TrialPlan, measure_all
from experiments.reports.report_page import Section, to_json
from experiments.reports.text_tables import text_of_tables
from experiments.robot.bench_errors import BenchError
from experiments.study.notebook import Notebook
from experiments.trials.session import Finding, Session
from simulation.test_rig.emulated_instruments import AmplifierParameters, StageEncoderParameters
from simulation.test_rig.load_cell import LoadCell
from simulation.test_rig.load_cell_bench import EmulatedBench, clay_plate
from simulation.test_rig.plate_stage import StageParameters
from simulation.test_rig.stage_motion import ManualMotionParameters

TRUTH = "The same plate in even motion, without stage, cell and noise"


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


def run_loadcell(session: Session, plan: TrialPlan, bench: BenchSettings, flipper: Mapping[str, Any] | None) -> Finding:
    """Measure the missing trials and evaluate all of them. Raises BenchError with what to do.

    `flipper` is the summary of a flipper experiment to compare with.
    """
    simulated = {"simulated_seed": bench.seed} if bench.port is None else {}
    same = {**notebook_plan(plan.settings), "bench": bench.name, **simulated, **session.program}
    notebook = Notebook(session.folder, same)
    missing = [trial for trial in plan.list_trials() if trial.key not in notebook.entries]
    _report_progress(session, notebook, len(missing), bench.encoder is not None)
    cell = {"bench": bench.name, "port": bench.port, "baud": bench.baud, "format": bench.cell.format_name}
    if missing:
        cell |= _measure(session, plan, bench, notebook)
    results = evaluate_muds(session.folder, notebook, plan, flipper, session.show)
    if not results.trials:
        raise BenchError("no trial counts, so there is nothing to evaluate")
    sections, tables, truth = make_sections(results, plan, flipper or {}), make_tables(results), {}
    if bench.port is None:
        truth = {mud: clay_truth(water_of(mud), plan.settings) for mud in results.muds}
        rows = truth_rows(results.muds, truth)
        sections.append(Section("The simulated muds themselves", f"{TRUTH}.", rows=rows))
        tables.append((TRUTH, rows))
    text = "\n\n".join([text_of_tables(tables), *results.remarks])
    return Finding(make_report(results, notebook, plan, cell, truth), TITLE, sections, text, [session.folder / RAW])


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
        port, encoder = _open_ports(bench, emulated, devices)
        recorder = CellRecorder(port, emulated or WallClock(), session.operator.report, encoder)
        stage = (
            SimulatedStage(plan.settings, emulated, {mud: _plate(mud, plan) for mud in plan.muds}, bench.seed)
            if emulated
            else ManualStage(plan.settings, session.operator, recorder.drain)
        )
        trial_bench = TrialBench(recorder, stage, session.operator, notebook, session.folder, session.show)
        prepare_cell(trial_bench, plan.settings, bench.cell)
        measure_all(trial_bench, plan)
        return _describe_cell(port, encoder)


def _plate(mud: str, plan: TrialPlan) -> LoadCell:
    return clay_plate(water_of(mud), plan.settings.plate)


def _emulate(plan: TrialPlan, bench: BenchSettings, devices: ExitStack) -> EmulatedBench:
    """Start the emulated devices."""
    link = Path(devices.enter_context(tempfile.TemporaryDirectory(prefix="mudskipper-"))) / "load_cell"
    encoder, stage, settings = None, None, bench.encoder
    if settings is not None:  # a stage with an encoder is pushed by hand
        encoder = StageEncoderParameters(
            metres_per_count=settings.metres_per_count, baud=settings.baud, label=settings.label
        )
        stage = StageParameters(manual=ManualMotionParameters(), seed=bench.seed)
    amplifier = AmplifierParameters(baud=bench.baud)
    emulated = EmulatedBench(_plate(plan.muds[0], plan), link, amplifier, stage, bench.seed, encoder)
    return devices.enter_context(closing(emulated))


def _open_ports(
    bench: BenchSettings, emulated: EmulatedBench | None, devices: ExitStack
) -> tuple[LoadCellPort, StageEncoder | None]:
    """Open the load cell's port with an assumed format, since its lines are examined next, and the encoder's."""
    name, settings = bench.cell.format_name, bench.encoder
    path = bench.port or str(emulated.amplifier.link if emulated else "")
    line_format = LineFormat(NUMBER if name == AUTO else name)
    try:
        port = LoadCellPort(path, bench.baud, line_format, LoadCellCalibration(bench.cell.unit or COUNTS, 1.0))
    except SerialLineError as problem:
        raise BenchError(str(problem)) from problem
    devices.enter_context(closing(port))
    if settings is None:
        return port, None
    if emulated and emulated.encoder:
        settings = replace(settings, path=str(emulated.encoder.link))
    try:
        return port, devices.enter_context(closing(StageEncoder(settings)))
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
