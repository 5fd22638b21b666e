"""Checks and calibration of the load cell before the first trial, with advice where something is wrong."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from drivers.load_cell.calibration import (
    CalibrationError,
    LoadCellCalibration,
    calibrate,
    calibration_of_unit,
    read_calibration,
    remarks_about,
    weigh,
    write_calibration,
)
from drivers.load_cell.line_formats import AUTO, COUNTS, LineFormat, find_format
from drivers.load_cell.load_cell_port import LoadCellPort
from drivers.load_cell.stage_encoder import StageEncoderSettings
from drivers.serial.serial_line import SerialLine, text_fraction
from experiments.loadcell.recording import CellBench
from experiments.robot.bench_errors import BenchError
from experiments.study.prompt import GO_ON

CALIBRATION = "calibration.json"
WEIGHING_S = 2.0
LEAST_SAMPLES, LEAST_POSITIONS = 12, 12  # of an insertion
STOP = "q"
LISTENING_S, STARTING_S = 2.0, 4.0  # a board that restarts when its port is opened needs the longer time
TEXT_FRACTION = 0.8  # less readable text means another baud rate
READABLE_FRACTION = 0.6  # fewer decoded lines mean another format
CHOOSE = (
    "Choose the column of the load with --format column1 to column9, or give a regular expression with (?P<value>...) "
    "that fits a whole line of the amplifier"
)
OR_WITHOUT = "or continue without --position"


@dataclass(frozen=True)
class CellSettings:
    """The options for the devices; an empty unit is that of the lines. Without a port the devices are emulated."""

    port: str | None = None
    baud: int = 115200
    format_name: str = AUTO
    unit: str = ""
    scale_n: float | None = None  # newtons per unit
    calibration: Path | None = None
    encoder: StageEncoderSettings | None = None
    seed: int = 1  # of the emulated devices
    practises: bool = False  # a person answers the prompts, which the emulated stage obeys


def prepare_cell(bench: CellBench, cell: CellSettings) -> None:
    """Find the format of the lines, check the encoder, calibrate, check the rate. Raises BenchError."""
    port = bench.port
    bench.report(f"listening to {port.line.path} at {port.line.baud} baud")
    port.line_format = LineFormat(examine_lines(bench, cell.format_name))
    examine_encoder(bench)
    port.calibration = _find_calibration(bench, cell)
    _check_rate(bench)


# lines


def examine_lines(bench: CellBench, name: str) -> str:
    """Return the name of the format that reads the lines; `name` is the wanted one or "auto". Raises BenchError."""
    port = bench.port
    bench.listen(LISTENING_S)
    _require_text(bench, port.line, "amplifier", "--baud")
    lines, readable = list(port.line.recent), port.readable_fraction
    found = find_format(lines)
    if name != AUTO and readable >= READABLE_FRACTION:
        return name
    if name == AUTO and found is not None:
        return found.name
    read = "no named format reads these lines" if name == AUTO else f"{name!r} reads {100.0 * readable:.0f} % of lines"
    raise BenchError(f"{read} such as {_quote(lines)}. {f'--format {found.name} does' if found else CHOOSE}")


def examine_encoder(bench: CellBench) -> None:
    """Check that counts arrive, and often enough for the stroke. Raises BenchError."""
    encoder, settings = bench.encoder, bench.plan.settings
    if encoder is None:
        return
    _require_text(bench, encoder.line, "encoder", "--position-baud", f"; {OR_WITHOUT}")
    if encoder.readable_fraction < READABLE_FRACTION:
        label = encoder.settings.label
        expected = f"a label {label!r} and a whole number" if label else "a whole number"
        raise BenchError(
            f"the lines on {encoder.settings.path} are not {expected}, but such as {_quote(encoder.line.recent)}: give "
            f"their first characters as --position-label, make the counter send its count alone, {OR_WITHOUT}"
        )
    rate_hz = encoder.line.clock.rate_hz or 0.0
    between_m = settings.speed_m_s / (rate_hz or 1.0)
    if LEAST_POSITIONS * between_m > settings.depth_m:
        bench.report(
            f"the encoder sends {rate_hz:.0f} lines/s, one per {1000.0 * between_m:.1f} mm of travel: "
            f"make it send faster, for at least {LEAST_POSITIONS} lines in an insertion"
        )


def _quote(lines: Iterable[bytes]) -> str:
    return " and ".join(repr(line.decode("ascii", "replace").strip()[:60]) for line in [*lines][-2:])


def _require_text(bench: CellBench, line: SerialLine, device: str, option: str, otherwise: str = "") -> None:
    """Raises BenchError where nothing arrives, or bytes of another baud rate."""
    if not line.recent:
        bench.listen(STARTING_S)
    if not line.recent:
        raise BenchError(
            f"nothing arrives on {line.path} at {line.baud} baud: check the {device}'s power and cable, that it sends "
            f"without being asked, and that this is its port{otherwise}"
        )
    if text_fraction(line.recent) < TEXT_FRACTION:
        raise BenchError(
            f"no text arrives on {line.path} at {line.baud} baud: give the {device}'s own rate with {option}, often "
            f"9600, 57600 or 115200{otherwise}"
        )


# calibration


def _find_calibration(bench: CellBench, cell: CellSettings) -> LoadCellCalibration:
    """Take the given file, the unit's own scale or the folder's file, or calibrate now. Raises BenchError."""
    unit, file = cell.unit or _unit_of_lines(bench.port), bench.session.folder / CALIBRATION
    try:
        if cell.calibration is not None:
            return read_calibration(cell.calibration)
        known = calibration_of_unit(unit, cell.scale_n)
        if known is not None:
            return known
        if file.exists():
            bench.report(f"calibration from {file}; remove it to calibrate again")
            return read_calibration(file)
    except CalibrationError as problem:
        raise BenchError(str(problem)) from problem
    return _calibrate_now(bench, unit, file)


def _unit_of_lines(port: LoadCellPort) -> str:
    """Return the unit of most lines."""
    readings = filter(None, map(port.line_format.decode, port.line.recent))
    ((unit, _),) = Counter(reading.unit for reading in readings if reading.unit).most_common(1) or [(COUNTS, 0)]
    return unit


def _calibrate_now(bench: CellBench, unit: str, file: Path) -> LoadCellCalibration:
    """Weigh two known weights, again until they give a span or the operator stops."""
    bench.port.calibration = LoadCellCalibration(unit, 1.0)
    while True:
        try:
            weighings = [weigh(bench.stage.weigh(which), _read_weight(bench)) for which in (0, 1)]
            calibration = calibrate(unit, *weighings)
        except CalibrationError as problem:
            bench.report(str(problem))
            if bench.ask("Calibrate again?", {GO_ON: "yes", STOP: "stop"}) == STOP:
                raise BenchError("the load cell is not calibrated") from problem
            continue
        for remark in remarks_about(calibration, *weighings):
            bench.report(remark)
        write_calibration(file, calibration)
        bench.report(
            f"calibrated: {calibration.per_newton:.6g} {unit} per N, ± {100.0 * calibration.relative_error:.2g} %; "
            f"saved in {file}"
        )
        return calibration


def _read_weight(bench: CellBench) -> list[float]:
    """Raises CalibrationError where the weight overloads the cell."""
    bench.drain()
    samples = bench.listen(WEIGHING_S)
    readings = [sample.force_n for sample in samples if not sample.overloaded]
    if len(readings) < len(samples) / 2.0:
        raise CalibrationError("the load cell is overloaded by this weight: take a lighter one, or check its wires")
    return readings


def _check_rate(bench: CellBench) -> None:
    """Warn of an amplifier that is too slow for the stroke. Raises BenchError where the operator stops."""
    rate_hz, settings = bench.port.line.clock.rate_hz, bench.plan.settings
    if rate_hz is None:
        raise BenchError("too few lines arrive to measure their rate: check the amplifier")
    duration_s = settings.depth_m / settings.speed_m_s
    samples = rate_hz * duration_s
    if samples < LEAST_SAMPLES:
        slower_m_s = settings.speed_m_s * samples / LEAST_SAMPLES
        bench.report(
            f"the amplifier sends {rate_hz:.0f} lines/s: an insertion of {duration_s:.2g} s has {samples:.0f} samples "
            f"and needs {LEAST_SAMPLES}. Choose a faster rate (an HX711's RATE pin high), or --speed {slower_m_s:.2g}"
        )
        if bench.ask("Continue with this amplifier?", {GO_ON: "yes", STOP: "stop"}) == STOP:
            raise BenchError("stopped: the amplifier is too slow for the stroke")
