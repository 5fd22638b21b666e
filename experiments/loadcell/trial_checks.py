"""What a serial port sends, examined before anything is measured with it, and what to do where it is something else."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.load_cell.line_formats import LineFormat, find_format
from drivers.serial.serial_line import COMMON_BAUDS, SerialLine, SerialLineError, text_fraction
from experiments.loadcell.motion import StageSettings
from experiments.loadcell.recording import POLL_S, BenchClock, CellRecorder
from experiments.robot.bench_robot import BenchError
from experiments.robot.prompt import Operator

LISTENING_S, STARTING_S = 2.0, 4.0
PROBE_S = 0.8
TEXT_FRACTION, READABLE_FRACTION = 0.8, 0.6  # below it, it is another baud rate; another format
LEAST_PLACES = 12  # of an insertion
OR_WITHOUT = "or go on without --position"


def examine_lines(recorder: CellRecorder, name: str) -> str:
    """Whether what arrives is what was expected: the name of a format that reads it. Raises BenchError with what to do.

    `name`: of the wanted format, or "auto".
    """
    port = recorder.port
    recorder.listen(LISTENING_S)
    if not port.recent_lines:  # a board that starts anew when its port is opened takes its time
        recorder.listen(STARTING_S)
    arrivals, lines = port.arrivals, port.recent_lines
    if not lines:
        raise BenchError(
            f"nothing arrives on {port.path} at {port.baud} baud: check the amplifier's power and cable, that it sends "
            "by itself and not only when asked, and that this is its port"
        )
    if arrivals.text < TEXT_FRACTION:
        raise BenchError(wrong_baud(port.line, recorder, "--baud", "a load cell's amplifier"))
    if name == "auto":
        found = find_format(lines)
        if found is None:
            raise BenchError(f"no named format reads these lines: {shown(lines)}. {_columns_reported(lines)}")
        return found.name
    if arrivals.readable < READABLE_FRACTION:
        found = find_format(lines)
        advice = f"--format {found.name} does" if found else _columns_reported(lines)
        raise BenchError(
            f"the format {name!r} reads {100.0 * arrivals.readable:.0f} % of the lines, such as {shown(lines)}; "
            + advice
        )
    return name


def examine_encoder(recorder: CellRecorder, operator: Operator, settings: StageSettings) -> None:
    """Whether counts arrive, often enough for the stroke. Raises BenchError with what to do."""
    encoder = recorder.encoder
    if encoder is None:
        return
    if not encoder.line.recent:
        recorder.listen(STARTING_S)
    arrivals, path = encoder.arrivals, encoder.settings.path
    if not arrivals.lines:
        raise BenchError(
            f"nothing arrives on {path} at {encoder.settings.baud} baud: check the encoder's power and cable, that it "
            f"sends by itself, and that this is its port; {OR_WITHOUT}"
        )
    if arrivals.text < TEXT_FRACTION:
        message = wrong_baud(encoder.line, recorder, "--position-baud", "an encoder's counter")
        raise BenchError(f"{message}; {OR_WITHOUT}")
    if arrivals.readable < READABLE_FRACTION:
        label = encoder.settings.label
        reported = f"a label {label!r} and a whole number" if label else "a whole number"
        raise BenchError(
            f"the lines on {path} are not {reported}, but such as {shown(list(encoder.line.recent))}: give what they "
            f"begin with as --position-label, make the counter send its count alone, {OR_WITHOUT}"
        )
    between_m = settings.speed_m_s / (encoder.rate_hz or 1.0)
    if LEAST_PLACES * between_m > settings.depth_m:
        operator.report(
            f"the encoder sends {encoder.rate_hz or 0.0:.0f} lines/s, one in {1000.0 * between_m:.1f} mm of way: what "
            f"lies between is guessed. For {LEAST_PLACES} in an insertion make it send faster"
        )


def shown(lines: Sequence[bytes]) -> str:
    return " and ".join(repr(line.decode("ascii", "replace").strip()[:60]) for line in lines[-2:])


def _columns_reported(lines: Sequence[bytes]) -> str:
    readable = [column for column in range(1, 10) if _reads(f"column{column}", lines)]
    if readable:
        names = " or ".join(f"--format column{column}" for column in readable)
        return f"Choose the column of the load with {names}"
    return (
        "Is it a load cell's amplifier? Give --format a regular expression with (?P<value>...) that fits a whole line"
    )


def _reads(name: str, lines: Sequence[bytes]) -> bool:
    line_format = LineFormat(name)
    return sum(line_format.decode(line) is not None for line in lines) > 0.8 * len(lines)


def wrong_baud(line: SerialLine, recorder: CellRecorder, option: str, what: str) -> str:
    """A sentence, with the rate at which it is text, where there is one: every common one is tried."""
    recorder.report(f"what arrives on {line.path} at {line.baud} baud is no text: other rates are tried")
    line.close()
    for baud in COMMON_BAUDS:
        if baud != line.baud and _is_text(line, baud, recorder.clock):
            return f"{line.baud} is not the baud rate of {line.path}: at {baud} it sends text. Use {option} {baud}"
    return (
        f"what arrives on {line.path} is no text at {line.baud} baud, nor at any common rate: is it {what} that sends "
        "lines of text?"
    )


def _is_text(line: SerialLine, baud: int, clock: BenchClock) -> bool:
    try:
        tried = SerialLine(line.path, baud, open_device=line.open_device)
    except SerialLineError:
        return False
    end_s = clock.now_s() + PROBE_S
    while clock.now_s() < end_s:
        clock.pass_time(POLL_S)
        tried.read(clock.now_s())
    tried.close()
    return text_fraction(tried.recent) > TEXT_FRACTION
