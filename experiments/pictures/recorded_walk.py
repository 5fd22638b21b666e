"""One walk from a log, for the pictures: the time series and the strides of both flippers, one of which is shown first.

A log of the daemon has all of it, for every walk of its run. The authors' CSV has angles, currents and the position of
the body; forces and strides are estimated from them, as in `mudskipper replay`. Values that a log does not have are NaN
and are listed in `missing`.
"""

from collections.abc import Sequence
from math import nan, radians, sin
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.geometry import FlipperGeometry
from control.modes import Mode
from control.records import FLIPPERS, FlipperLoad, Rig, StrideEstimate
from firmware_host.configuration.configuration import CaptureAxis, Configuration
from firmware_host.log.rows import STRIDE, stride_row
from firmware_host.log_reading.lab.body_track import VERTICAL_AXIS
from firmware_host.log_reading.lab.findings import Finding
from firmware_host.log_reading.lab_csv import LabLog, is_lab_csv, read_lab_csv
from firmware_host.log_reading.log_reader import (
    Log,
    LogError,
    Watch,
    begin_s,
    log_summary,
    read_log,
    read_logs,
    segment_of,
    unwatched,
)
from firmware_host.log_reading.replay import configuration_of, lab_estimator, lab_readings
from firmware_host.log_reading.tick_array import Ticks

Floats = NDArray[np.float64]
Truths = NDArray[np.bool_]

ANOTHER_MUD = "another mud"  # the loop's event after a stride that did not fit what was known
DESCRIPTIONS = {
    "body_x_m": "the position of the body, so no steps",
    "depth_command_m": "the commanded depth",
    "force_z_n": "forces",
}


class FlipperSeries(NamedTuple):
    """The time series of one flipper, a value a row."""

    flipper: str
    sweep_angle_rad: Floats
    adduction_angle_rad: Floats
    depth_m: Floats  # measured, below the nominal surface
    force_x_n: Floats
    force_z_n: Floats


class RecordedWalk(NamedTuple):
    """Times are seconds since the walk began. Arrays have a value a row; those of joints belong to `flipper`."""

    title: str
    geometry: FlipperGeometry
    sweep_rad: float  # commanded, at the front and at the rear
    flipper: str
    time_s: Floats
    phase: NDArray[np.int64]  # commanded
    sweep_angle_rad: Floats
    adduction_angle_rad: Floats
    depth_m: Floats  # measured, below the nominal surface
    depth_command_m: Floats
    force_x_n: Floats
    force_z_n: Floats
    body_x_m: Floats
    strides: list[dict[str, Any]]  # rows of log_rows.STRIDE, of both flippers
    noticed_s: list[float]  # when the robot noticed another mud
    walks: int = 1  # in the log
    begun_s: float = 0.0  # since the beginning of the log
    complete: bool = True  # False if the writer of the log was interrupted, or still writes
    cut: str = ""  # how the walk may extend beyond this log
    findings: tuple[Finding, ...] = ()  # what the reader noticed in a CSV of the authors
    series: tuple[FlipperSeries, ...] = ()  # of every flipper that moved, the left one first

    @property
    def sides(self) -> list["RecordedWalk"]:
        """The same walk with each flipper as the one that is shown."""
        return [self._replace(**series._asdict()) for series in self.series] or [self]

    @property
    def geometric_step_m(self) -> float:
        """The step with a plate that does not move in the mud during the sweep: 2 l sin α."""
        return 2.0 * self.geometry.flipper_length_m * sin(self.sweep_rad)

    @property
    def own_strides(self) -> list[dict[str, Any]]:
        """The strides of `flipper`."""
        return [stride for stride in self.strides if FLIPPERS[stride["flipper"]] == self.flipper]

    @property
    def mud_starts_s(self) -> list[float]:
        """The start of each mud after the first: the start of the stride in which the robot noticed it."""
        begun_s = [(stride["stamp_s"], stride["t_start_s"]) for stride in self.own_strides]
        return [max((start for close, start in begun_s if close <= now), default=now) for now in self.noticed_s]

    @property
    def missing(self) -> list[str]:
        """Descriptions of the values that the log does not have."""
        return [text for name, text in DESCRIPTIONS.items() if not np.any(np.isfinite(getattr(self, name)))]


def read_walk(
    path: Path,
    number: int = 0,
    more: Sequence[Path] = (),
    watch: Watch = unwatched,
    vertical: CaptureAxis = VERTICAL_AXIS,
) -> RecordedWalk:
    """Read walk `number` of a log from 1; 0 is the last one. Raises LogError.

    `more` are segments of the same run; `vertical` is the axis of a CSV's capture that points up.
    """
    if more:
        return numbered_walk(path, read_logs([path, *more], watch), number)
    if is_lab_csv(path):
        return walk_of_lab(path, read_lab_csv(path, vertical), number)
    if path.suffix == ".mcap":
        return numbered_walk(path, read_log(path, watch), number)
    raise LogError(f"{path}: not a log: its name must end with .mcap, .csv or .csv.gz")


def all_walks(path: Path, log: Log) -> list[RecordedWalk]:
    """Return every walk of a log that was read already, none where the robot did not walk. Raises LogError."""
    return [numbered_walk(path, log, number + 1) for number in range(len(_walk_borders(log)) // 2)]


def _walk_borders(log: Log) -> NDArray[np.int64]:
    """Return the first row of each walk and the row after its last one, in turn."""
    return np.flatnonzero(np.diff(log.ticks["mode"] == Mode.WALKING, prepend=False, append=False))


def numbered_walk(path: Path, log: Log, number: int = 0) -> RecordedWalk:
    """Return a walk of a log that was read already; `path` is for messages. Raises LogError."""
    configuration = configuration_of(path, log.configuration_text)
    borders = _walk_borders(log)
    starts, ends = borders[::2], borders[1::2]
    _refuse_number(path, number, len(starts))
    chosen = number - 1 if number else len(starts) - 1
    until_s = log.ticks["stamp_s"][starts[chosen + 1]] if chosen + 1 < len(starts) else np.inf
    walk = _walk_of_log(log, configuration, slice(starts[chosen], ends[chosen]), float(until_s))
    cut = _cut_of(log, bool(starts[chosen] == 0), bool(ends[chosen] == len(log.ticks)))
    begun_s = float(log.ticks["stamp_s"][starts[chosen]]) - begin_s(log)
    return walk._replace(walks=len(starts), begun_s=begun_s, complete=log.complete, cut=cut)


def _cut_of(log: Log, from_the_first: bool, to_the_last: bool) -> str:
    """Describe how the walk may extend beyond this segment of its run."""
    number = segment_of(log)
    before = [f"begun before segment {number}"] * (from_the_first and number > 0)
    after = ["continued in the next segment"] * (to_the_last and log.complete and "segment" in log.metadata)
    return " and ".join(before + after)


def _refuse_number(path: Path, number: int, walks: int) -> None:
    if not walks:
        raise LogError(f"{path}: there is no walk in this log")
    if number > walks:
        raise LogError(f"{path}: it has no walk {number}, only {walks}")


def _walk_of_log(log: Log, configuration: Configuration, rows: slice, until_s: float) -> RecordedWalk:
    """Return the walk in some rows. Strides and events belong to it up to the next walk at `until_s`."""
    ticks = log.ticks[rows]
    start_s = float(ticks["stamp_s"][0])
    strides = [stride for stride in log.strides if start_s <= stride["stamp_s"] < until_s]
    events = [event for event in log.events if start_s <= event["stamp_s"] < until_s]
    summary = log_summary(log)
    series = tuple(_series_of(ticks, log.rig, flipper) for flipper in log.rig.flippers)
    return RecordedWalk(
        title=f"{summary['robot']}  {summary['started']}",
        geometry=configuration.geometry,
        sweep_rad=radians(configuration.gait.sweep_angle_deg),
        **series[-1]._asdict(),
        time_s=ticks["stamp_s"] - start_s,
        phase=ticks["phase"].astype(np.int64),
        depth_command_m=ticks["depth_command_m"],
        body_x_m=ticks["body_x_m"],
        strides=[_since(start_s, stride) for stride in strides],
        noticed_s=[event["stamp_s"] - start_s for event in events if event["text"] == ANOTHER_MUD],
        series=series,
    )


def _series_of(ticks: Ticks, rig: Rig, flipper: str) -> FlipperSeries:
    number = rig.flippers.index(flipper)
    return FlipperSeries(
        flipper=flipper,
        sweep_angle_rad=ticks["angle_rad"][:, 2 * number],
        adduction_angle_rad=ticks["angle_rad"][:, 2 * number + 1],
        depth_m=ticks["depth_m"][:, number],
        force_x_n=ticks["force_x_n"][:, number],
        force_z_n=ticks["force_z_n"][:, number],
    )


def _since(start_s: float, stride: dict[str, Any]) -> dict[str, Any]:
    return stride | {name: stride[name] - start_s for name in ("stamp_s", "t_start_s")}


class _LabReading(NamedTuple):
    """The estimator's results for one of the authors' runs."""

    loads: list[tuple[FlipperLoad, ...]]  # left and right, a row each
    strides: list[StrideEstimate]
    noticed_s: list[float]


def _read_lab(lab: LabLog) -> _LabReading:
    """Estimate one run as `replay_lab` does."""
    estimator, reading = lab_estimator(lab), _LabReading([], [], [])
    for now_s, reported in lab_readings(estimator, lab):
        reading.loads.append(reported.loads)
        reading.strides.extend(stride for stride in reported.strides if stride.flipper in lab.flippers)
        if reported.strides and estimator.mud_estimate.boundary:
            reading.noticed_s.append(now_s)
    return reading


def walk_of_lab(path: Path, lab: LabLog, number: int = 0) -> RecordedWalk:
    """Return the one walk of a CSV that was read already; `path` is for its title and messages. Raises LogError."""
    _refuse_number(path, number, 1 if lab.flippers else 0)
    start_s, reading = float(lab.stamp_s[0]), _read_lab(lab)
    rows = [STRIDE.decode(stride_row(stride.t_end_s, stride, nan)) for stride in reading.strides]
    series = tuple(_lab_series(lab, reading, flipper) for flipper in lab.flippers)
    return RecordedWalk(
        title=path.name,
        geometry=FlipperGeometry(),
        sweep_rad=lab.gait.get("lateral_angle_range", radians(lab.gait.get("sweep_angle_deg", nan))),
        **series[-1]._asdict(),
        time_s=lab.stamp_s - start_s,
        phase=lab.phase,
        depth_command_m=lab.commanded_depth_m,
        body_x_m=lab.body_x_m,
        strides=[_since(start_s, row) for row in rows],
        noticed_s=[now_s - start_s for now_s in reading.noticed_s],
        findings=lab.findings,
        series=series,
    )


def _lab_series(lab: LabLog, reading: _LabReading, flipper: str) -> FlipperSeries:
    number = FLIPPERS.index(flipper)
    loads = [both[number] for both in reading.loads]
    return FlipperSeries(
        flipper=flipper,
        sweep_angle_rad=lab.angle_rad[:, 2 * number],
        adduction_angle_rad=lab.angle_rad[:, 2 * number + 1],
        depth_m=np.array([load.depth_m for load in loads]),
        force_x_n=np.array([load.force_x_n for load in loads]),
        force_z_n=np.array([load.force_z_n for load in loads]),
    )
