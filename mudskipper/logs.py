"""Logs as numpy arrays, and their replay."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from control.records import Rig
from estimation.estimation_parameters import Method
from firmware_host.configuration.configuration import CaptureAxis, Configuration
from firmware_host.log.rows import EVENT, STRIDE, tick_kind
from firmware_host.trial import METADATA_KEY, OperatorReport, from_json
from logs.files.log_error import LogError
from logs.files.log_reader import read_logs
from logs.files.log_summary import operator_reports, wall_offset_ns
from logs.flat_columns import stack_rows
from logs.replay import Replay, configuration_of, replay_files
from mudskipper.rows import Rows

Paths = str | Path | Sequence[str | Path]


@dataclass(frozen=True)
class OpenedLog:
    """One log, or the joined segments of one run. Field names end with the unit; docs/reference/log.md lists them."""

    paths: tuple[Path, ...]
    ticks: Rows  # one row per tick; arrays have one value for each of `rig.joints` or `rig.flippers`
    strides: Rows  # one row per closed stride of a flipper
    events: Rows  # changes of mode, faults and requests
    metadata: dict[str, str]  # robot, run_id, version, commit, ...
    configuration_text: str  # the TOML file with which the daemon ran
    complete: bool  # False where the writer was cut off
    unknown_fields: tuple[str, ...]  # of a later version; they are in the arrays too
    missing_fields: tuple[str, ...]  # of an earlier version; they are NaN, 0, False or empty
    rig: Rig  # the flippers of the robot; `rig.joints` are the names of its joints

    def __str__(self) -> str:
        """Return what the log contains, in ten lines at most."""
        known = "stamp_s" in (self.ticks.dtype.names or ()) and len(self.ticks)
        rows = {
            "files": ", ".join(path.name for path in self.paths[:3]) + ", ..." * (len(self.paths) > 3),
            "robot": f"{self.metadata.get('robot', '?')}, {', '.join(self.rig.joints)}",
            "started": f"{self.metadata.get('started', '?')}, mudskipper {self.metadata.get('version', '?')}",
            "trial": ", ".join(f"{name} {text}" for name, text in self.trial.items())[:100] or "not described",
            "length": f"{self.ticks['stamp_s'][-1] - self.ticks['stamp_s'][0]:.1f} s" if known else "?",
            "ticks": f"{len(self.ticks)} rows of {len(self.ticks.dtype.names or ())} fields",
            "strides": f"{len(self.strides)} rows of {len(self.strides.dtype.names or ())} fields",
            "events": f"{len(self.events)}, the last: {self.events['text'][-1] if len(self.events) else 'none'}"[:100],
            "end": "whole" if self.complete else "cut off: everything before that is here",
        }
        return "\n".join(f"{name:8} {text}" for name, text in rows.items())

    __repr__ = __str__

    @property
    def configuration(self) -> Configuration:
        """Return the configuration with which the daemon ran. Raises LogError where this version does not accept it."""
        return configuration_of(self.paths[0], self.configuration_text)

    @property
    def trial(self) -> dict[str, str]:
        """Return the description of the trial; empty where the log has none, or several."""
        return from_json(self.metadata.get(METADATA_KEY, ""))

    @property
    def reports(self) -> list[tuple[float, OperatorReport]]:
        """Return the trials, notes and markers: `stamp_s`, and a report with `kind`, `time`, `by` and `text`."""
        return operator_reports(self.events)


def open_log(path: Paths, fields: str | Iterable[str] = ()) -> OpenedLog:
    """Read an MCAP log, or several segments of one run. Raises LogError.

    `ticks` has all fields of a tick, or only `fields`: an hour of all takes 600 MB, of each number 11 MB.

    >>> log = open_log("walk.mcap", fields=["stamp_s", "force_z_n"])
    >>> [f"{1e-6 * k_p:.1f} N/cm³" for k_p in log.strides["k_p"][:2]]
    ['1.3 N/cm³', '1.3 N/cm³']
    """
    paths = _as_paths(path)
    log = read_logs(paths, fields=[fields] if isinstance(fields, str) else list(fields))
    offset_ns = wall_offset_ns(log.metadata)
    arrays = {
        "ticks": Rows.of(log.ticks, tick_kind(log.rig), offset_ns),
        "strides": Rows.of(stack_rows(log.strides, STRIDE), STRIDE, offset_ns),
        "events": Rows.of(stack_rows(log.events, EVENT), EVENT, offset_ns),
    }
    return OpenedLog(paths=paths, **(log._asdict() | arrays))


def replay(
    path: Paths,
    method: Method | None = None,
    configuration: Configuration | None = None,
    vertical: CaptureAxis | None = None,
) -> Replay:
    """Estimate the mud from a log again: an MCAP log, its segments, or the authors' CSV. Raises LogError.

    `method` and `configuration` replace those of the log. `vertical` is the axis of a CSV's capture that points up:
    "x", "y" or "z" (default: `pose.vertical` of the configuration, "y" without one).

    >>> first = replay("walk.mcap").strides[0]
    >>> f"{first.flipper}: {1e-6 * first.k_p.value:.1f} N/cm³ at {100 * first.depth_m:.1f} cm"
    'left: 1.3 N/cm³ at 3.5 cm'
    """
    for name, value, known in (("method", method, get_args(Method)), ("vertical", vertical, get_args(CaptureAxis))):
        if value not in (None, *known):
            raise ValueError(f"{name} = {value!r}: must be one of {', '.join(known)}")
    return replay_files(_as_paths(path), configuration, method, vertical=vertical)


def _as_paths(path: Paths) -> tuple[Path, ...]:
    paths = (Path(path),) if isinstance(path, str | Path) else tuple(Path(each) for each in path)
    if not paths:
        raise LogError("no log is given")
    return paths
