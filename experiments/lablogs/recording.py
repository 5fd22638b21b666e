"""A recorded run that can be estimated again, also after a disturbance of its columns.

The currents can be delayed against the positions, and rows can be removed. Both act on the recorded columns, before
anything is estimated from them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from control.records import FLIPPERS, Phase, StrideEstimate
from estimation.mud import Method
from firmware_host.log_reading.lab.columns import PAPER_CONSTANT_NM_A
from firmware_host.log_reading.lab_csv import LabLog, read_lab_csv
from firmware_host.log_reading.log_reader import Log, read_logs
from firmware_host.log_reading.replay import configuration_of, replay_lab, replay_log

Floats = NDArray[np.float64]
LARGEST_FRICTION_NM = 0.12  # dry friction of a sweep joint, over the authors' logs that were recorded in air


class Recording(ABC):
    """The columns of one run: n rows, joints in the order of JOINTS."""

    flippers: tuple[str, ...]
    fixed_base: bool
    findings: tuple[str, ...] = ()  # peculiarities that the reader noticed
    stamp_s: Floats
    phase: NDArray[Any]
    current_a: Floats  # (n, 4)
    sweep_constants_nm_a: tuple[float, float]  # of the left and the right flipper

    @abstractmethod
    def estimate_strides(self, method: Method) -> list[StrideEstimate]:
        """Return the strides of the flippers. Raises LogError."""

    @abstractmethod
    def _with_current(self, current_a: Floats) -> Recording: ...

    @abstractmethod
    def _with_rows(self, rows: NDArray[np.bool_]) -> Recording: ...

    def delay_current(self, delay_s: float) -> Recording:
        """Return the run with each current `delay_s` later than its position; a negative delay makes it earlier.

        A current stays until the next, as messages do.
        """
        known_s = np.maximum.accumulate(self.stamp_s)
        rows = np.searchsorted(known_s, known_s - delay_s, side="right") - 1
        return self._with_current(self.current_a[np.clip(rows, 0, len(rows) - 1)])

    def remove_rows(self, fraction: float, random: np.random.Generator) -> Recording:
        """Return the run without a random fraction of its rows."""
        return self._with_rows(random.random(len(self.stamp_s)) >= fraction)

    def has_evidence_of_mud(self) -> bool:
        """Whether a flipper's stance ever needed more torque than its swing and the largest friction.

        This is not the estimator's evaluation: a method cannot declare its own wrong values as air. A log without
        stance or swing counts as one in mud, because it cannot be evaluated.
        """
        excess_nm = [excess for flipper in self.flippers for excess in self._stance_excess_nm(flipper)]
        return not excess_nm or max(excess_nm) > LARGEST_FRICTION_NM

    def _stance_excess_nm(self, flipper: str) -> Iterator[float]:
        """Yield the size of each stance's median sweep torque, less the one that is typical of the swings."""
        number = FLIPPERS.index(flipper)
        torque_nm = self.sweep_constants_nm_a[number] * self.current_a[:, 2 * number]
        swing_nm = _median([_median_size(torque_nm[rows]) for rows in self._pieces(Phase.SWING)])
        for rows in self._pieces(Phase.STANCE):
            excess_nm = _median_size(torque_nm[rows]) - swing_nm
            if np.isfinite(excess_nm):
                yield excess_nm

    def _pieces(self, phase: Phase) -> Iterator[slice]:
        """Yield the rows of each uninterrupted phase."""
        borders = [0, *(np.flatnonzero(np.diff(self.phase)) + 1).tolist(), len(self.phase)]
        for start, end in pairwise(borders):
            if end > start and self.phase[start] == phase:
                yield slice(start, end)


class LabRecording(Recording):
    """A CSV of the paper's authors."""

    def __init__(self, lab: LabLog) -> None:
        self._lab = lab
        self.flippers, self.fixed_base = lab.flippers, len(lab.flippers) == 1
        self.findings = tuple(map(str, lab.findings))
        self.stamp_s, self.phase, self.current_a = lab.stamp_s, lab.phase, lab.current_a
        self.sweep_constants_nm_a = (PAPER_CONSTANT_NM_A, PAPER_CONSTANT_NM_A)

    def estimate_strides(self, method: Method) -> list[StrideEstimate]:
        return replay_lab(self._lab, method=method).strides

    def _with_current(self, current_a: Floats) -> Recording:
        return LabRecording(self._lab._replace(current_a=current_a))

    def _with_rows(self, rows: NDArray[np.bool_]) -> Recording:
        columns = {name: value for name, value in self._lab._asdict().items() if np.shape(value)[:1] == rows.shape}
        return LabRecording(self._lab._replace(**{name: value[rows] for name, value in columns.items()}))


class OwnRecording(Recording):
    """A log of this project, with the configuration that it carries."""

    def __init__(self, path: Path, log: Log) -> None:
        """Raises LogError."""
        self._path, self._log = path, log
        self._configuration = configuration_of(path, log.configuration_text)
        self.flippers, self.fixed_base = FLIPPERS, self._configuration.estimation.fixed_base
        self.stamp_s, self.phase = log.ticks["stamp_s"], log.ticks["phase"]
        self.current_a = log.ticks["current_a"]
        left, right = self._configuration.flipper_drives
        self.sweep_constants_nm_a = (left.sweep_constant_nm_a, right.sweep_constant_nm_a)

    def estimate_strides(self, method: Method) -> list[StrideEstimate]:
        parameters = replace(self._configuration.estimation, method=method)
        return replay_log(self._path, self._log, replace(self._configuration, estimation=parameters)).strides

    def _with_current(self, current_a: Floats) -> Recording:
        ticks = self._log.ticks.copy()
        ticks["current_a"] = current_a
        return OwnRecording(self._path, self._log._replace(ticks=ticks))

    def _with_rows(self, rows: NDArray[np.bool_]) -> Recording:
        return OwnRecording(self._path, self._log._replace(ticks=self._log.ticks[rows]))


def _median_size(torque_nm: Floats) -> float:
    return abs(_median(torque_nm))


def _median(values: Sequence[float] | Floats) -> float:
    """Return the median of the known values; NaN without any."""
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known)]
    return float(np.median(known)) if len(known) else np.nan


def read_recording(paths: Sequence[Path]) -> Recording:
    """Read a CSV, or the segments of one run. Raises LogError."""
    if paths[0].suffix == ".mcap":
        return OwnRecording(paths[0], read_logs(paths))
    return LabRecording(read_lab_csv(paths[0]))
