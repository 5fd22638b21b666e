"""Records the load cell and the stage's encoder, to memory and then to a file for each trial.

All samples come through serial ports and all times from a clock, so that emulated devices are recorded through their
own bytes, only faster than real ones. The notebook's entry of a trial names its files.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pandas import read_csv
from scipy.signal import detrend

from drivers.load_cell.load_cell_port import ForceSample, LoadCellPort
from drivers.load_cell.stage_encoder import StageEncoder, StagePosition
from experiments.loadcell.curve_fit import Array
from experiments.loadcell.stage import Stage, TrialPlan
from experiments.loadcell.strokes import (
    CONTACT_NOISES,
    LEAST_FORCE_N,
    QUIET_S,
    Recorded,
    StagePositions,
    StageSettings,
    noise_of,
)
from experiments.robot.bench_errors import BenchError
from experiments.study.notebook import Entry, Notebook
from experiments.study.session import Session
from simulation.test_rig.load_cell_bench import EmulatedBench

POLL_S = 0.005
TARE_S = 1.0
ABSENCE_S = 300.0  # longest time for which the amplifier may be unplugged
CONTACT_SAMPLES = 3  # in a row away from zero
AVERAGED_CORRELATION = 0.6  # of successive samples, each a mean over three conversions
LEAST_CORRELATED, LEAST_VALUES = 40, 8  # samples, and different values, for a correlation
AVERAGED = "the amplifier averages several conversions, which smears the strokes: set its filter to the fastest"
FOLLOWING = 0.01  # gain per sample of the tracking of a drifting zero
RAW = "raw"
FORCES = {"t_s": "%.6f", "force_n": "%.6f", "overloaded": "%d"}  # columns and formats, as in earlier files
POSITIONS = {"t_s": "%.6f", "place_m": "%.8f"}


class WallClock:
    """The time at a real bench."""

    def now_s(self) -> float:
        return time.monotonic()

    def pass_time(self, duration_s: float) -> None:
        time.sleep(duration_s)


class Tare(NamedTuple):
    """The zero of the force, with the plate clear of the mud."""

    force_n: float
    noise_n: float
    is_averaged: bool  # a filter averages the samples, or something slow shakes the cell


Counts = dict[str, int]  # of the problems of a serial line, by their keys in the notebook


class StrokeRecording(NamedTuple):
    """The lines of a stroke, and what went wrong on the lines of both devices."""

    samples: list[ForceSample]
    problems: Counts
    positions: list[StagePosition]
    position_problems: Counts  # empty where the stage has no encoder


@dataclass
class CellBench:
    """The devices, which are read while the operator is asked too, and the plan and the notebook of the trials."""

    session: Session
    plan: TrialPlan
    notebook: Notebook
    port: LoadCellPort
    clock: WallClock | EmulatedBench
    encoder: StageEncoder | None  # of the stage
    stage: Stage = field(init=False)
    _positions: list[StagePosition] = field(default_factory=list)

    def report(self, message: str) -> None:
        self.session.operator.report(message)

    def ask(self, question: str, answers: Mapping[str, str]) -> str:
        return self.session.operator.ask(question, answers, self.drain)

    def drain(self) -> None:
        """Discard everything that has arrived."""
        self._read()
        self._positions = []

    def _read(self) -> list[ForceSample]:
        now_s = self.clock.now_s()
        if self.encoder is not None:
            self._positions += self.encoder.read(now_s)
        return self.port.read(now_s)

    def listen(self, duration_s: float) -> list[ForceSample]:
        self._await_port()
        samples, end_s = list[ForceSample](), self.clock.now_s() + duration_s
        while self.clock.now_s() < end_s:
            samples += self._poll()
        return samples

    def _poll(self) -> list[ForceSample]:
        self.clock.pass_time(POLL_S)
        return self._read()

    def _await_port(self) -> None:
        """Wait for an adapter that was unplugged. Raises BenchError after ABSENCE_S."""
        line, end_s = self.port.line, self.clock.now_s() + ABSENCE_S
        if line.is_there:
            return
        self.report(f"the load cell is unplugged ({line.problem}): plug {line.path} in again")
        while not line.is_there:
            if self.clock.now_s() > end_s:
                raise BenchError(f"the load cell did not come back: {line.problem}")
            self._poll()
        self.report("the load cell is connected again")

    def tare(self) -> Tare:
        """Raises BenchError where no samples arrive."""
        forces_n = self._steady_forces_n()
        if len(forces_n) < 4 and not self.port.line.is_there:
            forces_n = self._steady_forces_n()
        if len(forces_n) < 4 and self.port.overloads and self.port.readable_fraction > 0.5:
            raise BenchError("the load cell reports an overload with nothing on it: check its mounting and its wires")
        if len(forces_n) < 4:
            raise BenchError(f"no samples arrive from {self.port.line.path}: check the amplifier's power and cable")
        is_averaged = len(forces_n) >= LEAST_CORRELATED and correlation(forces_n) > AVERAGED_CORRELATION
        return Tare(float(np.mean(forces_n)), noise_of(forces_n), is_averaged)

    def _steady_forces_n(self) -> Array:
        self.drain()
        return np.array([sample.force_n for sample in self.listen(TARE_S) if not sample.overloaded])

    def record(self, noise_n: float, patience_s: float, stroke_s: float) -> StrokeRecording:
        """Record until `stroke_s` after the contact, or until the patience ends without a contact."""
        self._await_port()
        self.drain()
        before, contact, has_touched = self._counts(), _Contact(noise_n), False
        samples, end_s = list[ForceSample](), self.clock.now_s() + patience_s
        while self.clock.now_s() < end_s and self.port.line.is_there:
            fresh = self._poll()
            samples += fresh
            if not has_touched and any(contact.is_reached_by(sample) for sample in fresh):
                has_touched, end_s = True, self.clock.now_s() + stroke_s
        positions, self._positions = self._positions, []
        problems, of_positions = (
            {name: count - old[name] for name, count in new.items()}
            for new, old in zip(self._counts(), before, strict=True)
        )
        self._await_port()
        problems["overloads"] = sum(sample.overloaded for sample in samples)
        return StrokeRecording(samples, problems, positions, of_positions)

    def _counts(self) -> tuple[Counts, Counts]:
        """Return the counts of both lines so far. Positions before and after a break have different zeros."""
        line, encoder = self.port.line, self.encoder
        problems = {
            "garbled_lines": self.port.malformed_lines,
            "drop_outs": line.clock.drop_outs,
            "unpluggings": line.unpluggings,
        }
        if encoder is None:
            return problems, {}
        return problems, {
            "garbled_lines": encoder.counts.malformed,
            "drop_outs": encoder.line.clock.drop_outs,
            "breaks": encoder.breaks,
        }


def correlation(forces_n: Array) -> float:
    """Return the correlation of successive samples, without their drift; 0 where the resolution is too coarse."""
    if len(np.unique(forces_n)) < LEAST_VALUES:
        return 0.0
    apart_n = detrend(forces_n)
    return float(apart_n[1:] @ apart_n[:-1] / (apart_n @ apart_n))


class _Contact:
    """Detects the contact with the mud: the force leaves its zero, which may drift until then."""

    def __init__(self, noise_n: float) -> None:
        self._bound_n = max(2.0 * CONTACT_NOISES * noise_n, LEAST_FORCE_N)
        self._quiet: list[ForceSample] = []
        self._level_n: float | None = None
        self._away = 0

    def is_reached_by(self, sample: ForceSample) -> bool:
        if self._level_n is None:
            self._quiet.append(sample)
            quiet_n = [each.force_n for each in self._quiet if not each.overloaded]
            if sample.stamp_s > self._quiet[0].stamp_s + QUIET_S and quiet_n:
                self._level_n = float(np.median(quiet_n))
            return False
        far = sample.overloaded or abs(sample.force_n - self._level_n) > self._bound_n
        self._away = self._away + 1 if far else 0
        if not far:
            self._level_n += FOLLOWING * (sample.force_n - self._level_n)
        return self._away >= CONTACT_SAMPLES


# files


def write_rows(path: Path, columns: Mapping[str, str], rows: Sequence[tuple[float, ...]]) -> None:
    path.parent.mkdir(exist_ok=True)
    table, head = np.reshape(rows, (-1, len(columns))), ",".join(columns)
    np.savetxt(path, table, [*columns.values()], delimiter=",", newline="\r\n", header=head, comments="")


def _read_columns(path: Path) -> Array:
    return np.asarray(read_csv(path), dtype=np.float64).T


def load_recorded(folder: Path, key: str, entry: Entry, settings: StageSettings) -> Recorded:
    """Read one trial. Raises OSError, ValueError for a file of another kind."""
    times_s, forces_n, overloaded = _read_columns(folder / entry["file"])
    valid, position, positions = overloaded == 0.0, entry.get("position"), None
    if position and position["places"] and not position["breaks"]:  # the encoder's zero did not change in the stroke
        positions = StagePositions(*_read_columns(folder / position["file"]))
    return Recorded(
        key=key,
        mud=entry["mud"],
        kind=entry["kind"],
        settings=settings,
        times_s=times_s[valid],
        forces_n=forces_n[valid],
        zero_n=(entry["zero_before_n"] + entry["zero_after_n"]) / 2.0,
        positions=positions,
    )


def load_counted(folder: Path, notebook: Notebook, settings: StageSettings) -> list[Recorded]:
    """Read all trials that count."""
    return [
        load_recorded(folder, key, entry, settings)
        for key, entry in notebook.entries.items()
        if "file" in entry and not entry.get("skipped")
    ]
