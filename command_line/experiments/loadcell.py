"""`mudskipper experiment loadcell`: from its options to a plan and the settings of the bench."""

import argparse
import os

from command_line.experiments.conduct import conduct_bench, refuse
from drivers.load_cell.line_formats import AUTO, UNITS, LineFormat
from drivers.load_cell.stage_encoder import StageEncoderSettings
from experiments.loadcell.comparison import load_flipper
from experiments.loadcell.preparation import CellSettings
from experiments.loadcell.run import BenchSettings, run_loadcell
from experiments.loadcell.stage import water_of
from experiments.loadcell.strokes import StageSettings
from experiments.loadcell.trials import TrialPlan
from experiments.robot.bench_errors import BenchError
from experiments.studies.estimation import SINGLE_WATERS

UNNAMED = "mud"
SIMULATED_STEP_UM = 10.0


def loadcell(options: argparse.Namespace) -> int:
    if not options.simulated and options.port is None:
        return refuse("name the serial port of the load cell with --port, or use --simulated")
    try:
        plan = plan_of(options)
        port = None if options.simulated else options.port
        bench = BenchSettings(port, options.baud, cell_of(options), encoder_of(options), options.seed)
        flipper = None if options.compare is None else load_flipper(options.compare)
    except (ValueError, BenchError) as problem:
        return refuse(str(problem))
    return conduct_bench(
        options, "trials", lambda session: run_loadcell(session, plan, bench, flipper), run_loadcell.__module__
    )


def plan_of(options: argparse.Namespace) -> TrialPlan:
    """Raises ValueError for an impossible plan."""
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
    muds = options.mud or ([f"{water:g}" for water in SINGLE_WATERS] if options.simulated else [UNNAMED])
    if len({mud.lower() for mud in muds}) < len(muds):
        raise ValueError("two muds have the same name")
    if options.simulated:
        for mud in muds:
            water_of(mud)
    return TrialPlan(tuple(muds), options.trials, settings, options.depth_error / 1000.0)


def cell_of(options: argparse.Namespace) -> CellSettings:
    """Raises ValueError for an unknown format or unit."""
    if options.format != AUTO:
        LineFormat(options.format)
    if options.unit and options.unit.lower() not in UNITS:
        raise ValueError(f"unit {options.unit!r}: must be one of {', '.join(UNITS)}")
    return CellSettings(options.format, options.unit.lower(), options.scale, options.calibration)


def encoder_of(options: argparse.Namespace) -> StageEncoderSettings | None:
    """Return nothing for a stage without an encoder. Raises ValueError for missing options."""
    if options.position is None:
        return None
    if not options.simulated and not options.position:
        raise ValueError("name the serial port of the stage's encoder: --position PATH")
    if not options.simulated and os.path.realpath(options.position) == os.path.realpath(options.port):
        raise ValueError(f"load cell and encoder cannot both be on {options.port}: they are two ports")
    if not options.simulated and options.position_step is None:
        raise ValueError("--position needs --position-step: the stage's travel per encoder count, in micrometres")
    step_um = options.position_step or SIMULATED_STEP_UM
    path = "" if options.simulated else options.position
    return StageEncoderSettings(path, step_um * 1e-6, options.position_baud, options.position_label)
