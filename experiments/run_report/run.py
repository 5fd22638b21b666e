"""A recorded run for a report: its walks, and its strides with mud, outcome, estimates and fits.

A stride lasts from its insertion to the next one; the last of a walk has no duration. Its mud is the one that is named
there (mud_layout.py), the label in the name of a CSV such as 12.5N, or else the one that the robot noticed, described
by its k_p.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf, isfinite
from pathlib import Path

import numpy as np

from control.records import FLIPPERS, UNKNOWN
from estimation.strokes.fit_samples import FitSamples, StrideFits
from experiments.lablogs.log_choice import LABEL
from experiments.pictures.mud_layout import MudLayout, mud_regions
from experiments.pictures.recorded_walk import RecordedWalk, walk_of_lab, walk_of_trace
from experiments.pictures.stride_choice import Outcome, Stride, outcome_of
from experiments.pictures.walk_trace import WalkTraces
from experiments.reports.mud_names import mud_label
from firmware_host.configuration.configuration import CaptureAxis
from logs.fault_history import LoggedCause, read_causes
from logs.files.log_error import LogError, Watch
from logs.files.log_reader import TickPass
from logs.files.log_summary import begin_s, log_summary
from logs.files.scanned_log import ScannedLog, join_logs, scan_log
from logs.lab.body_track import VERTICAL_AXIS
from logs.lab.lab_csv import is_lab_csv, read_lab_csv
from logs.replay import Replay, RunningReplay, configuration_of, replay_lab

SAME = 1e-6  # relative difference of a replayed estimate that is still the logged one
AUTHORS = "the paper's authors"


class MudsFrom(StrEnum):
    """Who named the muds of a run."""

    NAMES = "names"  # given with the report
    FILE = "file name"
    ROBOT = "robot"  # which noticed them: they are described by their k_p


@dataclass(frozen=True)
class ReportedStride:
    """One stride of the robot. Rows and fits are by flipper."""

    walk: int  # from 1
    index: int
    mud: str  # empty where it is not certain
    start_s: float  # since the beginning of the log
    duration_s: float  # NaN of the last stride of a walk
    step_m: float  # NaN without a pose
    outcome: Outcome
    rows: Mapping[str, Stride]
    fits: Mapping[str, StrideFits]

    @property
    def depth_m(self) -> float:
        return max(float(row["depth_m"]) for row in self.rows.values())

    def samples(self, flipper: str, name: str) -> FitSamples | None:
        """Return the samples of a fit; None for a bound, or where this version would estimate otherwise."""
        if flipper not in self.fits:
            return None
        samples: FitSamples | None = getattr(self.fits[flipper], name)()
        value = self.rows[flipper][name]
        return samples if samples and abs(samples.slope - value) <= SAME * abs(value) else None


@dataclass(frozen=True)
class Run:
    """Everything that a report shows of one run."""

    name: str  # of the first file, without its ending
    paths: Sequence[Path]
    robot: str
    started: str
    log: ScannedLog | None  # None for a CSV of the authors
    replay: Replay
    layout: MudLayout | None  # None where the robot noticed the muds
    muds_from: MudsFrom
    walks: Sequence[RecordedWalk]
    strides: Sequence[ReportedStride]
    causes: Sequence[LoggedCause]
    flippers: Sequence[str]

    @property
    def path(self) -> Path:
        return self.paths[0]


@dataclass(frozen=True)
class Source:
    """The files of one run, and their log where it is one of this project."""

    paths: Sequence[Path]
    log: ScannedLog | None


def read_sources(files: Sequence[Path], watch: Watch) -> list[Source]:
    """Read logs, and join the segments of each run. Raises LogError."""
    runs: dict[str, list[tuple[Path, ScannedLog | None]]] = {}
    for path in files:
        if not (path.suffix == ".mcap" or is_lab_csv(path)):
            raise LogError(f"{path}: not a log: its name must end with .mcap, .csv or .csv.gz")
        if any(path.absolute() == known.absolute() for run in runs.values() for known, _ in run):
            raise LogError(f"{path}: given twice")
        log = None if is_lab_csv(path) else scan_log(path, watch)
        runs.setdefault((log and log.metadata.get("run_id")) or str(path), []).append((path, log))
    return [_source(run) for run in runs.values()]


def _source(run: Sequence[tuple[Path, ScannedLog | None]]) -> Source:
    paths, logs = [path for path, _ in run], [log for _, log in run if log]
    return Source(paths, join_logs(paths, logs) if logs else None)


def read_run(source: Source, layout: MudLayout | None, watch: Watch, vertical: CaptureAxis = VERTICAL_AXIS) -> Run:
    """Replay a run and describe its strides. Raises LogError."""
    path, log = source.paths[0], source.log
    if log is None:
        lab = read_lab_csv(path, vertical)
        replay, walks = replay_lab(lab), [walk_of_lab(path, lab)] if lab.flippers else []
    else:
        replay, walks = _read_ticks(path, log, watch)
    label = LABEL.search(path.name) if log is None else None
    muds_from = MudsFrom.NAMES if layout else MudsFrom.FILE if label else MudsFrom.ROBOT
    if layout is None and label:
        layout = MudLayout((f"{label[1][:-1]} N",), (inf,))
    layout = _placed(path, layout, walks)
    summary = log_summary(log) if log else {}
    return Run(
        name=path.name.removesuffix(".gz").removesuffix(".csv").removesuffix(".mcap"),
        paths=source.paths,
        robot=str(summary.get("robot", AUTHORS)),
        started=str(summary.get("started", "")),
        log=log,
        replay=replay,
        layout=layout,
        muds_from=muds_from,
        walks=walks,
        strides=_strides_of(replay, walks, layout),
        causes=read_causes(log.events, log.configuration_text) if log else [],
        flippers=replay.flippers,
    )


def _read_ticks(path: Path, log: ScannedLog, watch: Watch) -> tuple[Replay, list[RecordedWalk]]:
    """Return the estimates and the walks of a log. Raises LogError."""
    configuration, traces = configuration_of(path, log.configuration_text), WalkTraces(log.rows)
    running = RunningReplay(path, log, configuration)
    complete = TickPass(log, watch, "ticks replayed").feed(running.add, traces.add)
    numbers = range(1, len(traces.walks) + 1)
    return running.finish(complete), [walk_of_trace(log, configuration, traces, number, complete) for number in numbers]


def _placed(path: Path, layout: MudLayout | None, walks: Sequence[RecordedWalk]) -> MudLayout | None:
    """Return the layout by the positions of this log. Raises LogError for several muds without any position."""
    if layout is None or not walks:
        return layout
    known = np.concatenate([walk.body_x_m[np.isfinite(walk.body_x_m)] for walk in walks])
    if not len(known) and len(layout.names) > 1:
        raise LogError(f"{path}: has no position of the body, so its strides cannot be assigned to muds: name one mud")
    return layout.beginning_at(float(known[0])) if len(known) else layout


def _strides_of(replay: Replay, walks: Sequence[RecordedWalk], layout: MudLayout | None) -> list[ReportedStride]:
    starts_s = [walk.begun_s for walk in walks]
    fits: dict[tuple[int, int, str], StrideFits] = {}
    for estimate, found in zip(replay.strides, replay.fits, strict=True):
        number = int(np.searchsorted(starts_s, estimate.t_end_s - replay.begin_s))
        fits[number, estimate.index, estimate.flipper] = found
    return [
        stride
        for number, walk in enumerate(walks, 1)
        for stride in _strides_of_walk(number, walk, _mud_names(walk, layout), fits)
    ]


def _strides_of_walk(
    number: int, walk: RecordedWalk, names: Mapping[int, str], fits: Mapping[tuple[int, int, str], StrideFits]
) -> list[ReportedStride]:
    strides, by_index = [], _by_index(walk)
    starts_s = [next(iter(rows.values()))["t_start_s"] for rows in by_index.values()]
    for (index, rows), start_s, next_s in zip(by_index.items(), starts_s, [*starts_s[1:], UNKNOWN], strict=True):
        first = next(iter(rows.values()))
        together = first | {"released": all(row["released"] for row in rows.values())}
        strides.append(
            ReportedStride(
                walk=number,
                index=index,
                mud=names[index],
                start_s=walk.begun_s + start_s,
                duration_s=next_s - start_s,
                step_m=first["step_m"],
                outcome=outcome_of(together, walk.geometric_step_m),
                rows=rows,
                fits={name: fits[number, index, name] for name in rows if (number, index, name) in fits},
            )
        )
    return strides


def _by_index(walk: RecordedWalk) -> dict[int, dict[str, Stride]]:
    """Return the rows of each stride by flipper, in the order of the strides."""
    found: dict[int, dict[str, Stride]] = {}
    for row in walk.strides:
        found.setdefault(row["index"], {})[FLIPPERS[row["flipper"]]] = row
    return dict(sorted(found.items()))


def _mud_names(walk: RecordedWalk, layout: MudLayout | None) -> dict[int, str]:
    """Name the mud of each stride."""
    first_rows = {index: next(iter(rows.values())) for index, rows in _by_index(walk).items()}
    if layout is not None:
        return {index: _named(walk, layout, row) for index, row in first_rows.items()}
    regions = mud_regions(walk, None)
    return {
        index: next((each.name for each in reversed(regions) if each.start_s <= row["t_start_s"]), "")
        for index, row in first_rows.items()
    }


def _named(walk: RecordedWalk, layout: MudLayout, row: Stride) -> str:
    if len(layout.names) == 1 and not isfinite(row["position_m"] + walk.geometric_step_m):
        return mud_label(layout.names[0])
    reach_m = walk.geometric_step_m / 2.0
    slip_m = max(0.0, walk.geometric_step_m - row["step_m"])
    return mud_label(layout.mud_at(row["position_m"] + reach_m, slip_m))


def log_begin_s(run: Run) -> float:
    return begin_s(run.log) if run.log else run.replay.begin_s
