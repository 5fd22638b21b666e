"""A recorded run that can be estimated again, also after a disturbance of its columns.

The currents can be delayed against the positions, and rows can be removed. Both act on the recorded columns, before
anything is estimated from them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from control.records import StrideEstimate
from estimation.estimation_parameters import Method
from firmware_host.configuration.configuration import CaptureAxis
from logs.files.log_reader import Log, read_logs
from logs.lab.body_track import VERTICAL_AXIS
from logs.lab.columns import PAPER_CONSTANT_NM_A
from logs.lab.joint_signs import find_evidence
from logs.lab.lab_csv import LabLog, read_lab_csv
from logs.lab.log_rows import LogRows
from logs.replay import configuration_of, replay_lab, replay_log

Floats = NDArray[np.float64]


class Recording(ABC):
    """The columns of one run: n rows, joints in the order of the rig's."""

    flippers: tuple[str, ...]
    fixed_base: bool
    findings: tuple[str, ...] = ()  # peculiarities that the reader noticed
    stamp_s: Floats
    phase: NDArray[Any]
    angle_rad: Floats  # (n, joints)
    current_a: Floats  # (n, joints)
    torque_scale: float = 1.0  # torque constant over that of the authors' motors

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
        """Whether a stance needed far more torque than friction does. A log without stance cannot be evaluated.

        This is not the estimator's evaluation: a method cannot declare its own wrong values as air.
        """
        rows = LogRows(Path(), self.stamp_s, np.arange(len(self.phase)), self.phase)
        evidence = find_evidence(rows, self.angle_rad, self.current_a * self.torque_scale)
        return evidence.is_mud or isnan(evidence.stance_nm)


class LabRecording(Recording):
    """A CSV of the paper's authors."""

    def __init__(self, lab: LabLog) -> None:
        self._lab = lab
        self.flippers, self.fixed_base = lab.flippers, len(lab.flippers) == 1
        self.findings = tuple(map(str, lab.findings))
        self.stamp_s, self.phase = lab.stamp_s, lab.phase
        self.angle_rad, self.current_a = lab.angle_rad, lab.current_a

    def estimate_strides(self, method: Method) -> list[StrideEstimate]:
        return replay_lab(self._lab, method=method).strides

    def _with_current(self, current_a: Floats) -> Recording:
        return LabRecording(self._lab._replace(current_a=current_a))

    def _with_rows(self, rows: NDArray[np.bool_]) -> Recording:
        fields: dict[str, Any] = self._lab._asdict()
        columns: dict[str, Any] = {name: value[rows] for name, value in fields.items() if isinstance(value, np.ndarray)}
        return LabRecording(self._lab._replace(**columns))


class OwnRecording(Recording):
    """A log of this project, with the configuration that it carries."""

    def __init__(self, path: Path, log: Log) -> None:
        """Raises LogError."""
        self._path, self._log = path, log
        self._configuration = configuration_of(path, log.configuration_text)
        self.flippers, self.fixed_base = log.rig.flippers, self._configuration.estimation.fixed_base
        self.stamp_s, self.phase = log.ticks["stamp_s"], log.ticks["phase"]
        self.angle_rad, self.current_a = log.ticks["angle_rad"], log.ticks["current_a"]
        self.torque_scale = self._configuration.flipper_drives[0].sweep_constant_nm_a / PAPER_CONSTANT_NM_A

    def estimate_strides(self, method: Method) -> list[StrideEstimate]:
        parameters = replace(self._configuration.estimation, method=method)
        return replay_log(self._path, self._log, replace(self._configuration, estimation=parameters)).strides

    def _with_current(self, current_a: Floats) -> Recording:
        ticks = self._log.ticks.copy()
        ticks["current_a"] = current_a
        return OwnRecording(self._path, self._log._replace(ticks=ticks))

    def _with_rows(self, rows: NDArray[np.bool_]) -> Recording:
        return OwnRecording(self._path, self._log._replace(ticks=self._log.ticks[rows]))


def read_recording(paths: Sequence[Path], vertical: CaptureAxis = VERTICAL_AXIS) -> Recording:
    """Read a CSV, whose capture has `vertical` upward, or the segments of one run. Raises LogError."""
    if paths[0].suffix == ".mcap":
        return OwnRecording(paths[0], read_logs(paths))
    return LabRecording(read_lab_csv(paths[0], vertical))
