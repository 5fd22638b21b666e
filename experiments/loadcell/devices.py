"""The devices of the load cell's bench, on serial ports or emulated: the cell's amplifier and the stage's encoder."""

import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from drivers.load_cell.calibration import LoadCellCalibration
from drivers.load_cell.line_formats import AUTO, COUNTS, NUMBER, LineFormat
from drivers.load_cell.load_cell_port import LoadCellPort
from drivers.load_cell.stage_encoder import StageEncoder
from drivers.serial.serial_line import SerialLineError
from experiments.loadcell.preparation import OR_WITHOUT, CellSettings
from experiments.loadcell.recording import CellBench, WallClock
from experiments.loadcell.stage import SimulatedStage, Stage, TrialPlan, water_of
from experiments.robot.bench_errors import BenchError
from experiments.study.notebook import Notebook
from experiments.study.prompt import AutomaticOperator
from experiments.study.session import Session
from simulation.test_rig.emulated_instruments import AmplifierParameters, StageEncoderParameters
from simulation.test_rig.load_cell_bench import EmulatedBench, clay_plate
from simulation.test_rig.plate_stage import StageParameters
from simulation.test_rig.stage_motion import ManualMotionParameters


@contextmanager
def open_bench(session: Session, plan: TrialPlan, cell: CellSettings, notebook: Notebook) -> Iterator[CellBench]:
    """Open the devices and close them in the end. Raises BenchError where one does not open."""
    with ExitStack() as devices:
        emulated = devices.enter_context(_emulated(plan, cell)) if cell.port is None else None
        path = cell.port or str(emulated.amplifier.link if emulated else "")
        encoder_settings, otherwise = cell.encoder, ""
        if encoder_settings and emulated and emulated.encoder:
            encoder_settings = replace(encoder_settings, path=str(emulated.encoder.link))
        # a format is assumed, since the lines are examined next
        line_format = LineFormat(NUMBER if cell.format_name == AUTO else cell.format_name)
        try:
            port = LoadCellPort(path, cell.baud, line_format, LoadCellCalibration(cell.unit or COUNTS, 1.0))
            devices.enter_context(closing(port))
            otherwise = f"; {OR_WITHOUT}"
            encoder = devices.enter_context(closing(StageEncoder(encoder_settings))) if encoder_settings else None
        except SerialLineError as problem:
            raise BenchError(f"the stage's encoder: {problem}{otherwise}" if otherwise else str(problem)) from problem
        bench = CellBench(
            session=session,
            plan=plan,
            notebook=notebook,
            port=port,
            clock=emulated or WallClock(),
            encoder=encoder,
        )
        bench.stage = Stage(plan.settings, session.operator, bench.drain)
        if emulated:
            operator = session.operator if cell.practises else AutomaticOperator(lambda message: None)
            bench.stage = SimulatedStage(plan.settings, operator, bench.drain, emulated, plan.muds, cell.seed)
        yield bench


@contextmanager
def _emulated(plan: TrialPlan, cell: CellSettings) -> Iterator[EmulatedBench]:
    """Emulate the amplifier, and an encoder on a stage that is pushed by hand."""
    encoder, stage, amplifier = None, None, AmplifierParameters(baud=cell.baud)
    if cell.encoder is not None:
        settings = cell.encoder
        encoder = StageEncoderParameters(
            metres_per_count=settings.metres_per_count, baud=settings.baud, label=settings.label
        )
        stage = StageParameters(manual=ManualMotionParameters(), seed=cell.seed)
    plate = clay_plate(water_of(plan.muds[0]), plan.settings.plate)
    with (
        tempfile.TemporaryDirectory(prefix="mudskipper-") as folder,
        closing(EmulatedBench(plate, Path(folder) / "load_cell", amplifier, stage, cell.seed, encoder)) as emulated,
    ):
        yield emulated


def describe_cell(bench: CellBench) -> dict[str, Any]:
    port, encoder = bench.port, bench.encoder
    position = encoder and asdict(encoder.settings) | {
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
