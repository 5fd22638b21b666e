"""The devices of the load cell's bench, on serial ports or emulated: the cell's amplifier and the stage's encoder."""

import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from drivers.load_cell.calibration import LoadCellCalibration
from drivers.load_cell.line_formats import AUTO, COUNTS, NUMBER, LineFormat
from drivers.load_cell.load_cell_port import LoadCellPort
from drivers.load_cell.stage_encoder import StageEncoder, StageEncoderSettings
from drivers.serial.serial_line import SerialLineError
from experiments.loadcell.preparation import OR_WITHOUT, CellSettings
from experiments.loadcell.recording import CellRecorder, WallClock
from experiments.loadcell.stage import ManualStage, SimulatedStage, water_of
from experiments.loadcell.trials import TrialBench, TrialPlan
from experiments.robot.bench_errors import BenchError
from experiments.study.notebook import Notebook
from experiments.study.session import Session
from simulation.test_rig.emulated_instruments import AmplifierParameters, StageEncoderParameters
from simulation.test_rig.load_cell_bench import EmulatedBench, clay_plate
from simulation.test_rig.plate_stage import StageParameters
from simulation.test_rig.stage_motion import ManualMotionParameters


@dataclass(frozen=True)
class DeviceSettings:
    """Without a port the devices are emulated."""

    port: str | None
    baud: int
    cell: CellSettings
    encoder: StageEncoderSettings | None
    seed: int  # of the emulated devices

    @property
    def bench(self) -> str:
        return "simulated" if self.port is None else "load cell"


@contextmanager
def open_bench(session: Session, plan: TrialPlan, settings: DeviceSettings, notebook: Notebook) -> Iterator[TrialBench]:
    """Open the devices and close them in the end. Raises BenchError where one does not open."""
    with ExitStack() as devices:
        emulated = devices.enter_context(_emulated(plan, settings)) if settings.port is None else None
        port, encoder = _open_ports(settings, emulated, devices)
        recorder = CellRecorder(port, emulated or WallClock(), session.operator.report, encoder)
        stage = (
            SimulatedStage(plan.settings, emulated, plan.muds, settings.seed)
            if emulated
            else ManualStage(plan.settings, session.operator, recorder.drain)
        )
        yield TrialBench(
            recorder=recorder,
            stage=stage,
            operator=session.operator,
            notebook=notebook,
            folder=session.folder,
            show=session.show,
        )


@contextmanager
def _emulated(plan: TrialPlan, settings: DeviceSettings) -> Iterator[EmulatedBench]:
    """Emulate the amplifier, and an encoder on a stage that is pushed by hand."""
    encoder, stage, amplifier = None, None, AmplifierParameters(baud=settings.baud)
    if settings.encoder is not None:
        encoder = StageEncoderParameters(
            metres_per_count=settings.encoder.metres_per_count,
            baud=settings.encoder.baud,
            label=settings.encoder.label,
        )
        stage = StageParameters(manual=ManualMotionParameters(), seed=settings.seed)
    plate = clay_plate(water_of(plan.muds[0]), plan.settings.plate)
    with (
        tempfile.TemporaryDirectory(prefix="mudskipper-") as folder,
        closing(EmulatedBench(plate, Path(folder) / "load_cell", amplifier, stage, settings.seed, encoder)) as emulated,
    ):
        yield emulated


def _open_ports(
    settings: DeviceSettings, emulated: EmulatedBench | None, devices: ExitStack
) -> tuple[LoadCellPort, StageEncoder | None]:
    """Open the load cell's port with an assumed format, since its lines are examined next, and the encoder's."""
    cell, encoder = settings.cell, settings.encoder
    path = settings.port or str(emulated.amplifier.link if emulated else "")
    line_format = LineFormat(NUMBER if cell.format_name == AUTO else cell.format_name)
    try:
        port = LoadCellPort(path, settings.baud, line_format, LoadCellCalibration(cell.unit or COUNTS, 1.0))
    except SerialLineError as problem:
        raise BenchError(str(problem)) from problem
    devices.enter_context(closing(port))
    if encoder is None:
        return port, None
    if emulated and emulated.encoder:
        encoder = replace(encoder, path=str(emulated.encoder.link))
    try:
        return port, devices.enter_context(closing(StageEncoder(encoder)))
    except SerialLineError as problem:
        raise BenchError(f"the stage's encoder: {problem}; {OR_WITHOUT}") from problem


def describe_cell(port: LoadCellPort, encoder: StageEncoder | None) -> dict[str, Any]:
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
