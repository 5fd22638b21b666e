"""Recording a load cell at the bench: time that passes, samples that come or do not, and what is said about it.

Everything goes through the port and a clock, so that an emulated amplifier at an emulated stage is recorded as a real
one is, through its bytes and its tty, only faster.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from drivers.load_cell.load_cell_port import LoadCellPort, Sample
from drivers.load_cell.stage_encoder import Place, StageEncoder
from experiments.loadcell.contact import CONTACT_NOISES, LEAST_FORCE_N, QUIET_S, noise_of
from experiments.robot.bench_robot import BenchError

POLL_S = 0.005
TARE_S = 1.0
ABSENCE_S = 300.0  # for which an adapter may be away
CONTACT_SAMPLES = 3
AVERAGED_LIKENESS = 0.6  # of a mean over three conversions
LEAST_REPORTED, LEAST_VALUES = 40, 8  # samples, and different ones, of which fewer tell nothing
AVERAGED = (
    "the cell's samples at rest hardly differ from one to the next: its amplifier tells means over several "
    "conversions, which smears the strokes. Set its filter to the fastest, or move the stage more slowly"
)
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
    likeness: float = 0.0  # of each sample and the next one: 0 where they are independent, 1 where they are the same

    @property
    def is_averaged(self) -> bool:
        """By a filter in the amplifier, or what shakes the cell is slow."""
        return self.samples >= LEAST_REPORTED and self.likeness > AVERAGED_LIKENESS


class PlaceStretch(NamedTuple):
    """What an encoder on the stage told meanwhile."""

    places: list[Place]
    garbled_lines: int
    drop_outs: int
    breaks: int  # unplugged, or begun anew: places before and behind have not the same zero


class Stretch(NamedTuple):
    """What was recorded of a stroke, and what became of the lines meanwhile."""

    samples: list[Sample]
    garbled_lines: int
    drop_outs: int
    unpluggings: int
    position: PlaceStretch | None = None  # where the stage has an encoder

    @property
    def overloads(self) -> int:
        return sum(sample.overloaded for sample in self.samples)


class CellRecorder:
    """Owns the places that came since it was last drained; `tell` says what a person should know at once."""

    def __init__(
        self,
        port: LoadCellPort,
        clock: BenchClock,
        report: Callable[[str], None],
        encoder: StageEncoder | None = None,
    ) -> None:
        """`encoder`: of the stage; nothing waits for it."""
        self.port, self.clock, self.report, self.encoder = port, clock, report, encoder
        self._places: list[Place] = []

    def drain(self) -> None:
        """What comes while nobody wants it."""
        self._read()
        self._places = []

    def listen(self, duration_s: float) -> list[Sample]:
        self.await_port()
        samples, end_s = list[Sample](), self.clock.now_s() + duration_s
        while self.clock.now_s() < end_s:
            samples += self.poll()
        return samples

    def poll(self) -> list[Sample]:
        self.clock.pass_time(POLL_S)
        return self._read()

    def _read(self) -> list[Sample]:
        now_s = self.clock.now_s()
        if self.encoder is not None:
            self._places += self.encoder.read(now_s)
        return self.port.read(now_s)

    def await_port(self) -> None:
        """An adapter that was pulled out is waited for. Raises BenchError after a while."""
        if self.port.is_there:
            return
        self.report(f"the load cell is gone ({self.port.last_problem}): plug {self.port.path} in again")
        end_s = self.clock.now_s() + ABSENCE_S
        while not self.port.is_there:
            if self.clock.now_s() > end_s:
                raise BenchError(f"the load cell did not come back: {self.port.last_problem}")
            self.poll()
        self.report("the load cell is back")

    def tare(self) -> Tare:
        """Raises BenchError where nothing comes."""
        forces_n = self._steady_forces_n()
        if len(forces_n) < 4 and not self.port.is_there:
            forces_n = self._steady_forces_n()
        if len(forces_n) < 4:
            raise BenchError(self._silence())
        return Tare(float(np.mean(forces_n)), noise_of(np.array(forces_n)), len(forces_n), likeness(forces_n))

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
        before = _counted(self.encoder)
        samples, begin_s = list[Sample](), self.clock.now_s()
        contact = _Contact(noise_n)
        end_s = begin_s + patience_s
        while self.clock.now_s() < end_s and port.is_there:
            fresh = self.poll()
            samples += fresh
            if contact.handle(fresh):
                end_s = self.clock.now_s() + stroke_s
        places, after = self._places, _counted(self.encoder)
        self._places = []
        self.await_port()
        return Stretch(
            samples,
            port.garbled_lines - garbled,
            port.clock.drop_outs - drop_outs,
            port.unpluggings - unpluggings,
            PlaceStretch(places, *(b - a for a, b in zip(before, after, strict=True))) if self.encoder else None,
        )


def likeness(forces_n: Sequence[float]) -> float:
    """Correlation of each with the next one, beside a drift; 0 where a coarse step hides how they scatter."""
    if len(set(forces_n)) < LEAST_VALUES:
        return 0.0
    order = np.arange(len(forces_n))
    apart_n = np.asarray(forces_n) - np.polyval(np.polyfit(order, forces_n, 1), order)
    return float(apart_n[1:] @ apart_n[:-1] / (apart_n @ apart_n))


def _counted(encoder: StageEncoder | None) -> tuple[int, int, int]:
    """Garbled lines, drop-outs, breaks."""
    return (0, 0, 0) if encoder is None else (encoder.counts.garbled, encoder.clock.drop_outs, encoder.breaks)


class _Contact:
    """Owns the level of a stroke's beginning, and whether the force has left it."""

    def __init__(self, noise_n: float) -> None:
        self._bound_n = max(2.0 * CONTACT_NOISES * noise_n, LEAST_FORCE_N)
        self._quiet_n: list[float] = []
        self._first_s: float | None = None
        self._level_n: float | None = None
        self._away = 0
        self._seen = False

    def handle(self, samples: Sequence[Sample]) -> bool:
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
