"""Measures the true coefficients of a mud with a load cell on a linear stage (the paper's section II-E).

A plate is dragged 20 cm through the mud at a depth of 3 cm. In other trials it goes down 3 cm, holds for 3 s and comes
out again. The stage moves at 0.1 m/s, and each kind of trial is repeated five times. The cell's amplifier and,
optionally, a position encoder of the stage are serial ports; the operator moves the stage.
"""

import os
from argparse import ArgumentTypeError
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from drivers.load_cell.line_formats import AUTO, UNITS, LineFormat
from drivers.load_cell.stage_encoder import StageEncoderSettings
from experiments.loadcell.devices import describe_cell, open_bench
from experiments.loadcell.preparation import CellSettings, prepare_cell
from experiments.loadcell.recording import RAW
from experiments.loadcell.report import evaluate_muds, load_flipper, make_result
from experiments.loadcell.stage import TrialPlan, clay_truth, water_of
from experiments.loadcell.strokes import StageSettings
from experiments.loadcell.trials import measure_all
from experiments.reports.mud_names import file_part
from experiments.robot.bench_errors import BenchError
from experiments.study.notebook import Notebook
from experiments.study.option import Option, OptionError
from experiments.study.result import Result, to_json
from experiments.study.session import Session

HAS_ROBOT = False
SCHEMA = 2
UNNAMED = ("mud",)
SIMULATED_MUDS = ("47.6", "48.6", "49.5", "50.3", "51.2")  # figure 5 of the paper
SIMULATED_STEP_UM = 10.0
Plate = tuple[float, float, float]


def parse_plate(text: str) -> Plate:
    """Parse 3x3.5 or, with its thickness, 3x3.5x0.4. Raises ArgumentTypeError."""
    sides = text.lower().removesuffix("cm").split("x")
    if len(sides) not in (2, 3):
        raise ArgumentTypeError(f"{text}: must be width x height, or width x height x thickness, in cm")
    try:
        width, height, thickness = (float(side) for side in [*sides, "0.4"][:3])
    except ValueError:
        width = height = thickness = 0.0
    if not (0.2 <= width <= 50.0 and 0.2 <= height <= 50.0 and 0.02 <= thickness <= 10.0):
        raise ArgumentTypeError(f"{text}: width and height must be from 0.2 to 50, thickness from 0.02 to 10 cm")
    return width, height, thickness


Port = Annotated[str | None, Option("of the cell's amplifier; /dev/serial/by-id/... does not change", metavar="PATH")]
Baud = Annotated[int, Option("of its port", low=300, high=4_000_000)]


PAPER_PLATE_CM = (3.0, 3.5, 0.4)
PlateSizes = Annotated[Plate, Option("or WxHxT, in cm (default: 3x3.5x0.4)", metavar="WxH", parse=parse_plate)]
PositionStep = Annotated[float | None, Option("travel per count", low=0.01, high=10000.0, unit="um")]
PositionPort = Annotated[
    str | None,
    Option("port of an encoder of the stage, which may be pushed by hand then", metavar="PATH", without_value=""),
]


def study(
    session: Session,
    *,
    port: Port = None,
    baud: Baud = 115200,
    format: Annotated[str, Option("of its lines: auto, number, indicator, column2, or a pattern")] = AUTO,
    unit: Annotated[str, Option("of its numbers: counts, g, kg, N ... (default: that of the lines)", metavar="U")] = "",
    scale: Annotated[float | None, Option("newtons per unit, instead of a calibration", above=0.0)] = None,
    calibration: Annotated[Path | None, Option("an earlier one, instead of two weights")] = None,
    mud: Annotated[tuple[str, ...], Option("simulated: water content in percent")] = (),
    trials: Annotated[int, Option("of shear and of insertion", low=1, high=1000)] = 5,
    depth: Annotated[float, Option("of the plate's edge", above=0.0, high=20.0, unit="cm")] = 3.0,
    depth_error: Annotated[float, Option("one standard error of the set depth", low=0.0, high=20.0, unit="mm")] = 0.5,
    plate: PlateSizes = PAPER_PLATE_CM,
    speed: Annotated[float, Option("of the stage", low=0.001, high=1.0, unit="m/s")] = 0.1,
    position: PositionPort = None,
    position_step: PositionStep = None,
    position_baud: Baud = 115200,
    position_label: Annotated[str, Option("at the beginning of each of its lines", metavar="TEXT")] = "",
    compare: Annotated[Path | None, Option("summary.json of the flipper experiment")] = None,
    practise: Annotated[bool, Option("on a simulated bench, whose stage obeys the prompts")] = False,
    seed: Annotated[int, Option("of the simulation")] = 1,
) -> Result:
    """A mud's coefficients from a load cell on a linear stage."""
    session = session._replace(simulated=session.simulated or practise)
    if session.simulated:
        port, position = None, position if position is None else ""
        position_step = position_step or SIMULATED_STEP_UM
    muds = mud or (SIMULATED_MUDS if session.simulated else UNNAMED)
    _check_names(port, format, unit, muds, session.simulated)
    cell = CellSettings(
        port=port,
        baud=baud,
        format_name=format,
        unit=unit.lower(),
        scale_n=scale,
        calibration=calibration,
        encoder=_encoder(port, position, position_step, position_baud, position_label),
        seed=seed,
        practises=practise,
    )
    plan = TrialPlan(muds, trials, _stage_settings(plate, depth, speed), depth_error / 1000.0)
    result = _run(session, plan, cell, load_flipper(compare) if compare else {})
    return replace(result, title=f"{result.title} (practised)") if practise else result


def _check_names(port: str | None, format_name: str, unit: str, muds: tuple[str, ...], simulated: bool) -> None:
    if port is None and not simulated:
        raise OptionError("name the serial port of the load cell with --port, or use --simulated or --practise")
    if unit and unit.lower() not in UNITS:
        raise OptionError(f"unit {unit!r}: must be one of {', '.join(UNITS)}")
    if len({file_part(mud).lower() for mud in muds}) < len(muds):
        raise OptionError("two muds have the same name, or differ only in signs and capitals, as no files should")
    try:
        if format_name != AUTO:
            LineFormat(format_name)
        for mud in muds if simulated else ():
            water_of(mud)
    except ValueError as problem:
        raise OptionError(str(problem)) from problem


def _stage_settings(plate_cm: Plate, depth_cm: float, speed_m_s: float) -> StageSettings:
    width_m, height_m, thickness_m = (side_cm / 100.0 for side_cm in plate_cm)
    if depth_cm > plate_cm[1]:
        raise OptionError(f"the depth of {depth_cm:g} cm is more than the plate's height of {plate_cm[1]:g} cm")
    return StageSettings(
        depth_m=depth_cm / 100.0,
        speed_m_s=speed_m_s,
        plate_width_m=width_m,
        plate_height_m=height_m,
        plate_thickness_m=thickness_m,
    )


def _encoder(
    port: str | None, path: str | None, step_um: float | None, baud: int, label: str
) -> StageEncoderSettings | None:
    """Return nothing for a stage without an encoder."""
    if path is None:
        return None
    if port is not None and not path:
        raise OptionError("name the serial port of the stage's encoder: --position PATH")
    if port is not None and os.path.realpath(path) == os.path.realpath(port):
        raise OptionError(f"load cell and encoder cannot both be on {port}: they are two ports")
    if step_um is None:
        raise OptionError("--position needs --position-step: the stage's travel per encoder count, in micrometres")
    return StageEncoderSettings(path, step_um * 1e-6, baud, label)


def _run(session: Session, plan: TrialPlan, cell: CellSettings, flipper: dict[str, Any]) -> Result:
    """Measure the missing trials and evaluate all of them. Raises BenchError with what to do."""
    bench = {"bench": "simulated" if session.simulated else "load cell"}
    seed = {"simulated_seed": cell.seed} if session.simulated else {}
    notebook = Notebook(session.folder, {**notebook_plan(plan.settings), **bench, **seed, **session.program})
    missing = [trial for trial in plan.list_trials() if trial.key not in notebook.entries]
    if notebook.entries:
        report, done = session.operator.report, notebook.entries.values()
        report(f"{len(done)} trials are in {session.folder} already, {len(missing)} are left")
        without = sum("file" in entry and "position" not in entry for entry in done)
        if cell.encoder and without:
            report(f"{without} of them have no measured position; their depth is found from the force")
    used = {**bench, "port": cell.port, "baud": cell.baud, "format": cell.format_name}
    if missing:
        with open_bench(session, plan, cell, notebook) as opened:
            prepare_cell(opened, cell)
            measure_all(opened)
            used |= describe_cell(opened)
    results = evaluate_muds(session.folder, notebook, plan, session.show)
    if not results.trials:
        raise BenchError("no trial counts, so there is nothing to evaluate")
    truths = {mud: clay_truth(mud, plan.settings) for mud in results.muds} if session.simulated else {}
    result = make_result(results, notebook, plan, used, flipper, truths)
    return replace(result, logs=[session.folder / RAW])


def notebook_plan(settings: StageSettings) -> dict[str, Any]:
    """Return the options that must be the same in all trials of one folder; muds and trials may be added."""
    return {"experiment": "loadcell", **to_json(settings)}
