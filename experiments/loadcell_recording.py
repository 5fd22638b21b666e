"""Recording a load cell at the bench: time that passes, samples that come or do not, and what is said about it.

Everything goes through the port and a clock, so that an emulated amplifier at an emulated stage is recorded as a real
one is, through its bytes and its tty, only faster.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from drivers.load_cell_lines import NUMBER, LineFormat, find_format
from drivers.load_cell_port import COMMON_BAUDS, LoadCellPort, LoadCellPortError, Sample
from experiments.bench_robot import BenchError
from experiments.loadcell_contact import CONTACT_NOISES, LEAST_FORCE_N, LEAST_NOISE_N, QUIET_S

POLL_S = 0.01
LISTENING_S, STARTING_S = 2.0, 4.0
TARE_S = 1.0
PROBE_S = 0.8
TEXT_SHARE, READABLE_SHARE = 0.8, 0.6  # below it, it is another baud rate; another format
ABSENCE_S = 300.0  # for which an adapter may be away
CONTACT_SAMPLES = 3
FOLLOWING = 0.01  # of a zero that drifts while nobody starts, per sample


class BenchClock(Protocol):
    def now_s(self) -> float: ...

    def pass_time(self, duration_s: float) -> None: ...


class WallClock:
    def now_s(self) -> float:
        return time.monotonic()

    def pass_time(self, duration_s: float) -> None:
        time.sleep(duration_s)


class Tare(NamedTuple):
    """With the plate clear of the mud."""

    force_n: float
    noise_n: float
    samples: int


class Stretch(NamedTuple):
    """What was recorded of a stroke, and what became of the lines meanwhile."""

    samples: list[Sample]
    garbled_lines: int
    drop_outs: int
    unpluggings: int

    @property
    def overloads(self) -> int:
        return sum(sample.overloaded for sample in self.samples)


class CellRecorder:
    """Owns nothing but its port and its clock; `tell` says what a person should know at once."""

    def __init__(self, port: LoadCellPort, clock: BenchClock, tell: Callable[[str], None]) -> None:
        self.port, self.clock, self.tell = port, clock, tell

    def drain(self) -> None:
        """What comes while nobody wants it."""
        self.port.read(self.clock.now_s())

    def listen(self, duration_s: float) -> list[Sample]:
        self.await_port()
        samples, end_s = list[Sample](), self.clock.now_s() + duration_s
        while self.clock.now_s() < end_s:
            samples += self.poll()
        return samples

    def poll(self) -> list[Sample]:
        self.clock.pass_time(POLL_S)
        return self.port.read(self.clock.now_s())

    def await_port(self) -> None:
        """An adapter that was pulled out is waited for. Raises BenchError after a while."""
        if self.port.is_there:
            return
        self.tell(f"the load cell is gone ({self.port.last_problem}): plug {self.port.path} in again")
        end_s = self.clock.now_s() + ABSENCE_S
        while not self.port.is_there:
            if self.clock.now_s() > end_s:
                raise BenchError(f"the load cell did not come back: {self.port.last_problem}")
            self.poll()
        self.tell("the load cell is back")

    def tare(self) -> Tare:
        """Raises BenchError where nothing comes."""
        forces_n = self._steady_forces_n()
        if len(forces_n) < 4 and not self.port.is_there:
            forces_n = self._steady_forces_n()
        if len(forces_n) < 4:
            raise BenchError(self._silence())
        middle_n = float(np.median(forces_n))
        noise_n = max(1.4826 * float(np.median(np.abs(np.array(forces_n) - middle_n))), LEAST_NOISE_N)
        return Tare(float(np.mean(forces_n)), noise_n, len(forces_n))

    def _steady_forces_n(self) -> list[float]:
        self.drain()
        return [sample.force_n for sample in self.listen(TARE_S) if not sample.overloaded]

    def _silence(self) -> str:
        if self.port.overloads and self.port.arrivals.readable > 0.5:
            return "the load cell says that it is overloaded with nothing on it: check its mounting and its wires"
        return (
            f"no samples come from {self.port.path}: check the amplifier's power and cable, and that it sends by "
            "itself and not only when asked"
        )

    def record(self, noise_n: float, patience_s: float, stroke_s: float) -> Stretch:
        """Until `stroke_s` after the force has left its zero, or until the patience is at an end."""
        self.await_port()
        self.drain()
        port = self.port
        garbled, drop_outs, unpluggings = port.garbled_lines, port.clock.drop_outs, port.unpluggings
        samples, begin_s = list[Sample](), self.clock.now_s()
        contact = _Contact(noise_n)
        end_s = begin_s + patience_s
        while self.clock.now_s() < end_s and port.is_there:
            fresh = self.poll()
            samples += fresh
            if contact.heed(fresh):
                end_s = self.clock.now_s() + stroke_s
        self.await_port()
        return Stretch(
            samples, port.garbled_lines - garbled, port.clock.drop_outs - drop_outs, port.unpluggings - unpluggings
        )


class _Contact:
    """Owns the level of a stroke's beginning, and whether the force has left it."""

    def __init__(self, noise_n: float) -> None:
        self._bound_n = max(2.0 * CONTACT_NOISES * noise_n, LEAST_FORCE_N)
        self._quiet_n: list[float] = []
        self._first_s: float | None = None
        self._level_n: float | None = None
        self._away = 0
        self._seen = False

    def heed(self, samples: Sequence[Sample]) -> bool:
        """True once, when there is contact."""
        for sample in samples:
            if not self._seen and self._is_away(sample):
                self._seen = True
                return True
        return False

    def _is_away(self, sample: Sample) -> bool:
        if self._first_s is None:
            self._first_s = sample.stamp_s
        if self._level_n is None:
            self._quiet_n += [] if sample.overloaded else [sample.force_n]
            if sample.stamp_s > self._first_s + QUIET_S and self._quiet_n:
                self._level_n = float(np.median(self._quiet_n))
            return False
        far = sample.overloaded or abs(sample.force_n - self._level_n) > self._bound_n
        self._away = self._away + 1 if far else 0
        if not far:
            self._level_n += FOLLOWING * (sample.force_n - self._level_n)
        return self._away >= CONTACT_SAMPLES


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
    if arrivals.text < TEXT_SHARE:
        raise BenchError(_wrong_baud(recorder))
    if name == "auto":
        found = find_format(lines)
        if found is None:
            raise BenchError(f"no named format reads these lines: {_shown(lines)}. {_columns_told(lines)}")
        return found.name
    if arrivals.readable < READABLE_SHARE:
        found = find_format(lines)
        advice = f"--format {found.name} does" if found else _columns_told(lines)
        raise BenchError(
            f"the format {name!r} reads {100.0 * arrivals.readable:.0f} % of the lines, such as {_shown(lines)}; "
            + advice
        )
    return name


def _shown(lines: Sequence[bytes]) -> str:
    return " and ".join(repr(line.decode("ascii", "replace").strip()[:60]) for line in lines[-2:])


def _columns_told(lines: Sequence[bytes]) -> str:
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


def _wrong_baud(recorder: CellRecorder) -> str:
    """With the rate at which it is text, where there is one: every common one is tried."""
    port = recorder.port
    recorder.tell(f"what arrives at {port.baud} baud is no text: other rates are tried")
    path, calibration, open_line = port.path, port.calibration, port.open_line
    port.close()
    for baud in COMMON_BAUDS:
        if baud == port.baud:
            continue
        try:
            tried = LoadCellPort(path, baud, LineFormat(NUMBER), calibration, open_line)
        except LoadCellPortError:
            continue
        CellRecorder(tried, recorder.clock, recorder.tell).listen(PROBE_S)
        is_text = tried.recent_lines and tried.arrivals.text > TEXT_SHARE
        tried.close()
        if is_text:
            return f"{port.baud} is not the baud rate of {path}: at {baud} it sends text. Use --baud {baud}"
    return (
        f"what arrives on {path} is no text at {port.baud} baud, nor at any common rate: is it a load cell's amplifier "
        "that sends lines of text?"
    )
