"""`mudskipper experiment loadcell`: plan, port or emulated bench, tables."""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Any

from command_line.experiments.conduct import conduct_bench, refuse
from drivers.load_cell.calibration import LoadCellCalibration
from drivers.load_cell.line_formats import AUTO, COUNTS, NUMBER, UNITS, LineFormat
from drivers.load_cell.load_cell_port import LoadCellPort
from drivers.load_cell.stage_encoder import StageEncoder, StageEncoderSettings
from drivers.serial.serial_line import SerialLineError
from experiments.estimation.evaluation import SINGLE_WATERS
from experiments.loadcell.comparison import CompareError, load_flipper
from experiments.loadcell.measurement import (
    CellSettings,
    conclude,
    measure,
    plan_of_notebook,
    report_of,
)
from experiments.loadcell.motion import StageSettings
from experiments.loadcell.raw import RAW
from experiments.loadcell.recording import BenchClock, CellRecorder, WallClock
from experiments.loadcell.report import TITLE, sections_of, text_of
from experiments.loadcell.stage import AttendedStage, SimulatedStage, Stage
from experiments.loadcell.trial_checks import OR_WITHOUT
from experiments.loadcell.trials import TrialBench, TrialPlan
from experiments.loadcell.truth import clay_truth, truth_rows
from experiments.reports.report_page import Section
from experiments.reports.text_tables import text_of_tables
from experiments.robot.bench_robot import BenchError
from experiments.trials.notebook import Notebook
from experiments.trials.session import Finding, Session
from simulation.test_rig.load_cell_bench import EmulatedBench, clay_plate, position_link
from simulation.test_rig.load_cell_emulator import AmplifierParameters
from simulation.test_rig.plate_stage import StageParameters
from simulation.test_rig.stage_encoder_emulator import StageEncoderParameters
from simulation.test_rig.stage_motion import HandParameters

TRUTH = "The same plate in even motion, without stage, cell and noise"
MIXED = "mud"  # the name of one that nobody named
SIMULATED_STEP_UM = 10.0
StageOf = Callable[[CellRecorder], Stage]


def loadcell(options: argparse.Namespace) -> int:
    if not options.simulated and options.port is None:
        return refuse("name the serial port of the load cell with --port, or use --simulated")
    try:
        plan, cell = plan_of(options), cell_of(options)
        encoder_of(options, "")
        flipper = None if options.compare is None else load_flipper(options.compare)
    except (ValueError, CompareError) as problem:
        return refuse(str(problem))
    return conduct_bench(options, "trials", lambda session: _found(options, session, plan, cell, flipper))


def plan_of(options: argparse.Namespace) -> TrialPlan:
    """Raises ValueError for what cannot be."""
    width_cm, height_cm, thickness_cm = options.plate
    settings = StageSettings(
        depth_m=options.depth / 100.0,
        speed_m_s=options.speed,
        plate_width_m=width_cm / 100.0,
        plate_height_m=height_cm / 100.0,
        plate_thickness_m=thickness_cm / 100.0,
    )
    if settings.depth_m > settings.plate_height_m:
        raise ValueError(f"the depth of {options.depth:g} cm is more than the plate's height of {height_cm:g} cm")
    named = options.mud or ([f"{water:g}" for water in SINGLE_WATERS] if options.simulated else [MIXED])
    if len({name.lower() for name in named}) < len(named):
        raise ValueError("two muds have the same name")
    if options.simulated:
        for name in named:
            _water(name)
    return TrialPlan(tuple(named), options.trials, settings, options.depth_error / 1000.0)


def _water(name: str) -> float:
    """Raises ValueError where it is no water content that there is a mud for."""
    try:
        water = float(name)
    except ValueError:
        raise ValueError(f"mud {name!r}: a simulated one is a water content in percent, such as 48.6") from None
    clay_plate(water)
    return water


def cell_of(options: argparse.Namespace) -> CellSettings:
    """Raises ValueError."""
    if options.format != AUTO:
        LineFormat(options.format)
    if options.unit and options.unit.lower() not in UNITS:
        raise ValueError(f"unit {options.unit!r}: must be one of {', '.join(UNITS)}")
    return CellSettings(options.format, options.unit.lower(), options.scale, options.calibration)


def encoder_of(options: argparse.Namespace, emulated: str) -> StageEncoderSettings | None:
    """None where the stage has none; `emulated` is the port of a simulated one. Raises ValueError."""
    if options.position is None:
        return None
    if not options.simulated and not options.position:
        raise ValueError("name the serial port of the stage's encoder: --position PATH")
    if not options.simulated and os.path.realpath(options.position) == os.path.realpath(options.port):
        raise ValueError(f"load cell and encoder cannot both be on {options.port}: they are two ports")
    if not options.simulated and options.position_step is None:
        raise ValueError("--position needs --position-step: the stage's way per count of its encoder, in micrometres")
    path, step_um = emulated if options.simulated else options.position, options.position_step or SIMULATED_STEP_UM
    return StageEncoderSettings(path, step_um * 1e-6, options.position_baud, options.position_label)


def _found(
    options: argparse.Namespace, session: Session, plan: TrialPlan, cell: CellSettings, flipper: dict[str, Any] | None
) -> Finding:
    bench_name = "simulated" if options.simulated else "load cell"
    notebook = Notebook(session.folder, plan_of_notebook(plan.settings) | {"bench": bench_name})
    missing = [trial for trial in plan.list_trials() if trial.key not in notebook.entries]
    if notebook.begun:
        session.operator.report(
            f"{len(notebook.entries)} trials are in {session.folder} already, {len(missing)} are left"
        )
        without = sum("file" in entry and "position" not in entry for entry in notebook.entries.values())
        if options.position is not None and without:
            session.operator.report(f"{without} of them have no position, and keep the depth that the force tells")
    described = {"bench": bench_name, "port": options.port, "baud": options.baud, "format": options.format}
    if missing:
        with ExitStack() as stack:
            described |= _measured(options, session, plan, cell, notebook, stack)
    results = conclude(session.folder, notebook, plan, flipper, session.show)
    if not results.trials:
        raise BenchError("no trial was kept, so there is nothing to conclude")
    truths = {mud: clay_truth(_water(mud), plan.settings) for mud in results.muds} if options.simulated else {}
    report = report_of(results, notebook, plan, described)
    report["truth"] = {mud: truth._asdict() for mud, truth in truths.items()}
    sections, tables = sections_of(results, plan), text_of(results)
    if truths:
        rows = truth_rows(results.muds, truths)
        sections = [*sections, Section("The simulated muds themselves", f"{TRUTH}.", rows=rows)]
        tables.append((TRUTH, rows))
    text = "\n\n".join([text_of_tables(tables), *results.remarks])
    return Finding(report, TITLE, sections, text, [session.folder / RAW])


def _measured(
    options: argparse.Namespace,
    session: Session,
    plan: TrialPlan,
    cell: CellSettings,
    notebook: Notebook,
    stack: ExitStack,
) -> dict[str, Any]:
    """All trials that are missing; what the cell turned out to be."""
    path, clock, stage_of = (_emulated if options.simulated else _real)(options, session, plan, stack)
    port = _open(path, options.baud, cell)
    stack.callback(port.close)
    settings = encoder_of(options, str(position_link(Path(path))))
    encoder = None if settings is None else _open_encoder(settings)
    if encoder is not None:
        stack.callback(encoder.close)
    recorder = CellRecorder(port, clock, session.operator.report, encoder)
    bench = TrialBench(recorder, stage_of(recorder), session.operator, notebook, session.folder, session.show)
    measure(bench, plan, cell)
    return {
        "port": path,
        "format": port.line_format.name,
        "rate_hz": port.rate_hz,
        "lines": port.lines,
        "garbled_lines": port.garbled_lines,
        "last_garbled": port.last_garbled,
        "calibration": port.calibration._asdict(),
        "position": None if encoder is None or settings is None else _reported_of(encoder, settings),
    }


def _reported_of(encoder: StageEncoder, settings: StageEncoderSettings) -> dict[str, Any]:
    counted = {"rate_hz": encoder.rate_hz, "garbled_lines": encoder.counts.garbled, "breaks": encoder.breaks}
    return asdict(settings) | {"counts": encoder.counts.believed} | counted


def _real(
    options: argparse.Namespace, session: Session, plan: TrialPlan, stack: ExitStack
) -> tuple[str, BenchClock, StageOf]:
    return options.port, WallClock(), lambda recorder: AttendedStage(plan.settings, session.operator, recorder.drain)


def _emulated(
    options: argparse.Namespace, session: Session, plan: TrialPlan, stack: ExitStack
) -> tuple[str, BenchClock, StageOf]:
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mudskipper-")))
    plates = {mud: clay_plate(_water(mud), plan.settings.plate) for mud in plan.muds}
    amplifier = AmplifierParameters(baud=options.baud)
    settings = encoder_of(options, "")
    encoder, stage = None, None
    if settings is not None:  # whoever has an encoder need not have a motor
        step_m, baud, label = settings.metres_per_count, settings.baud, settings.label
        encoder = StageEncoderParameters(metres_per_count=step_m, baud=baud, label=label)
        stage = StageParameters(hand=HandParameters(), seed=options.seed)
    cell = folder / "load_cell"
    bench = EmulatedBench(next(iter(plates.values())), cell, amplifier, stage, options.seed, encoder)
    stack.callback(bench.close)
    return str(cell), bench, lambda _: SimulatedStage(plan.settings, bench, plates, options.seed)


def _open(path: str, baud: int, cell: CellSettings) -> LoadCellPort:
    """As it comes; what it sends is examined next."""
    line_format = LineFormat(NUMBER if cell.format_name == AUTO else cell.format_name)
    try:
        return LoadCellPort(path, baud, line_format, LoadCellCalibration(cell.unit or COUNTS, 1.0))
    except SerialLineError as problem:
        raise BenchError(str(problem)) from problem


def _open_encoder(settings: StageEncoderSettings) -> StageEncoder:
    try:
        return StageEncoder(settings)
    except SerialLineError as problem:
        raise BenchError(f"the stage's encoder: {problem}; {OR_WITHOUT}") from problem
