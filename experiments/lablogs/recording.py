"""A recorded run that can be estimated again, also after a disturbance of its columns.

The currents can be delayed against the positions, and rows can be removed. Both act on the recorded columns, before
anything is estimated from them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from control.records import StrideEstimate
from estimation.estimation_parameters import Method
from firmware_host.configuration.configuration import CaptureAxis
from logs.files.log_error import ADVICE
from logs.files.log_reader import Log, read_logs
from logs.files.log_summary import trial_of
from logs.lab.body_track import VERTICAL_AXIS
from logs.lab.columns import PAPER_CONSTANT_NM_A
from logs.lab.joint_signs import find_evidence
from logs.lab.lab_csv import LabLog, read_lab_csv
from logs.lab.log_rows import LogRows
from logs.replay import configuration_of, replay_lab, replay_log

Floats = NDArray[np.float64]
Rows = NDArray[np.bool_]


@dataclass(frozen=True)
class Recording:
    """The columns of one run: n rows, joints in the order of the rig's."""

    flippers: tuple[str, ...]
    fixed_base: bool
    stamp_s: Floats
    phase: NDArray[Any]
    angle_rad: Floats  # (n, joints)
    current_a: Floats  # (n, joints)
    rows: Rows  # those that are not missing
    replay: Callable[[Method, Floats, Rows], list[StrideEstimate]]  # with these currents and rows; raises LogError
    findings: tuple[str, ...] = ()  # peculiarities that the reader noticed
    mud: str = ""  # that the log names
    torque_scale: float = 1.0  # torque constant over that of the authors' motors

    def estimate_strides(self, method: Method) -> list[StrideEstimate]:
        """Return the strides of the flippers. Raises LogError."""
        return self.replay(method, self.current_a, self.rows)

    def delay_current(self, delay_s: float) -> "Recording":
        """Return the run with each current `delay_s` later than its position; a negative delay makes it earlier.

        A current stays until the next, as messages do.
        """
        known_s = np.maximum.accumulate(self.stamp_s)
        rows = np.searchsorted(known_s, known_s - delay_s, side="right") - 1
        return replace(self, current_a=self.current_a[np.clip(rows, 0, len(rows) - 1)])

    def remove_rows(self, fraction: float, random: np.random.Generator) -> "Recording":
        """Return the run without a random fraction of its rows."""
        return replace(self, rows=random.random(len(self.stamp_s)) >= fraction)

    def has_evidence_of_mud(self) -> bool:
        """Whether a stance needed far more torque than friction does. A log without stance cannot be evaluated.

        This is not the estimator's evaluation: a method cannot declare its own wrong values as air.
        """
        rows = LogRows(Path(), self.stamp_s, np.arange(len(self.phase)), self.phase, [])
        evidence = find_evidence(rows, self.angle_rad, self.current_a * self.torque_scale)
        return evidence.is_mud or isnan(evidence.stance_nm)


def recording_of_lab(lab: LabLog, surface_error_m: float | None = None) -> Recording:
    """Return the columns of a CSV of the paper's authors."""

    def replay(method: Method, current_a: Floats, rows: Rows) -> list[StrideEstimate]:
        fields: dict[str, Any] = lab._replace(current_a=current_a)._asdict()
        columns: dict[str, Any] = {name: value[rows] for name, value in fields.items() if isinstance(value, np.ndarray)}
        return replay_lab(lab._replace(**columns), method=method, surface_error_m=surface_error_m).strides

    return Recording(
        flippers=lab.flippers,
        fixed_base=lab.fixed_base,
        stamp_s=lab.stamp_s,
        phase=lab.phase,
        angle_rad=lab.angle_rad,
        current_a=lab.current_a,
        rows=np.full(len(lab.stamp_s), True),
        replay=replay,
        findings=tuple(map(str, lab.findings)),
    )


def recording_of_log(path: Path, log: Log, surface_error_m: float | None = None) -> Recording:
    """Return the columns of a log of this project, with the configuration that it carries. Raises LogError."""
    configuration, ticks = configuration_of(path, log.configuration_text), log.ticks
    estimation = configuration.estimation
    if surface_error_m is not None:
        estimation = replace(estimation, surface_error_m=surface_error_m)

    def replay(method: Method, current_a: Floats, rows: Rows) -> list[StrideEstimate]:
        disturbed = ticks[rows]
        disturbed["current_a"] = current_a[rows]
        parameters = replace(estimation, method=method)
        return replay_log(path, log._replace(ticks=disturbed), replace(configuration, estimation=parameters)).strides

    return Recording(
        flippers=log.rig.flippers,
        fixed_base=configuration.estimation.fixed_base,
        stamp_s=ticks["stamp_s"],
        phase=ticks["phase"],
        angle_rad=ticks["angle_rad"],
        current_a=ticks["current_a"],
        rows=np.full(len(ticks), True),
        replay=replay,
        findings=() if log.complete else (f"its end is missing: everything up to there counts; {ADVICE}",),
        mud=trial_of(log).get("mud", ""),
        torque_scale=configuration.flipper_drives[0].sweep_constant_nm_a / PAPER_CONSTANT_NM_A,
    )


def read_recording(
    paths: Sequence[Path], vertical: CaptureAxis = VERTICAL_AXIS, surface_error_m: float | None = None
) -> Recording:
    """Read a CSV, whose capture has `vertical` upward, or the segments of one run. Raises LogError.

    `surface_error_m` is the standard error of the mud's height, where it is not the usual one.
    """
    if paths[0].suffix == ".mcap":
        return recording_of_log(paths[0], read_logs(paths), surface_error_m)
    return recording_of_lab(read_lab_csv(paths[0], vertical), surface_error_m)
