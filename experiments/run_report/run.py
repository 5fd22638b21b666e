"""A recorded run for a report: its walks, its strides with mud and outcome, and their estimates with the fits.

A stride lasts from its insertion to the next one; the last of a walk has no duration. Its mud is the one that is named
there (mud_layout.py), the mud of the log's trial, the label in the name of a CSV such as 12.5N, or else the one that
the robot noticed, described by its k_p.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np
from pandas import DataFrame

from control.mud_estimate import FlipperEstimate
from control.records import COEFFICIENTS, FLIPPERS, UNKNOWN
from estimation.strokes.fit_samples import NO_FITS, StrideFits
from experiments.lablogs.log_choice import LABEL
from experiments.pictures.mud_layout import MudLayout, MudRegion, mud_regions
from experiments.pictures.recorded_walk import RecordedWalk, walk_of_lab, walk_of_trace
from experiments.pictures.stride_choice import Stride, of_both_flippers, outcome_of
from experiments.pictures.walk_trace import WalkTraces
from experiments.reports.mud_names import mud_label, mud_name
from experiments.run_report.supply_range import SupplyRange
from firmware_host.configuration.configuration import CaptureAxis
from logs.fault_history import LoggedCause, read_causes
from logs.files.log_error import LogError, Watch
from logs.files.log_reader import watched_blocks
from logs.files.log_summary import segment_of, segments_before, trial_of
from logs.files.scanned_log import ScannedLog, join_logs, scan_log
from logs.lab.body_track import VERTICAL_AXIS
from logs.lab.lab_csv import is_lab_csv, log_name, read_lab_csv
from logs.replay import Replay, RunningReplay, configuration_of, replay_lab

SAME = 1e-6  # relative difference of a replayed estimate that is still the logged one
AUTHORS = "the paper's authors"
STRIDES = ("walk", "index", "mud", "start_s", "duration_s", "step_m", "depth_m", "outcome", "two_surfaces", "supply_v")
NUMBERS = ("value", "std_error", "repeatability", "depth_m", "speed_m_s")  # of an estimate; NaN where not known
FLAGS = ("valid", "at_least")
# expected_n_m3: by the strides before, at the same depth; NaN where these have no value
ESTIMATES = ("walk", "index", "mud", "flipper", "coefficient", *NUMBERS, *FLAGS, "reason", "samples", "expected_n_m3")


class MudsFrom(StrEnum):
    """Who named the muds of a run."""

    NAMES = "names"  # given with the report
    LOG = "log"  # which the operator described when the walk began
    FILE = "file name"
    ROBOT = "robot"  # which noticed them: they are described by their k_p


@dataclass(frozen=True)
class Run:
    """Everything that a report shows of one run."""

    name: str  # of the first file, without its ending
    paths: Sequence[Path]
    robot: str
    log: ScannedLog | None  # None for a CSV of the authors
    replay: Replay
    layout: MudLayout | None  # None where the robot noticed the muds
    muds_from: MudsFrom
    walks: Sequence[RecordedWalk]
    strides: DataFrame  # STRIDES; the mud is empty where it is not certain, duration and step are NaN where unknown
    estimates: DataFrame  # ESTIMATES: a row for each coefficient of each flipper; `samples` of a fit, or None
    causes: Sequence[LoggedCause]
    supply: Sequence[dict[str, Any]] = ()  # what each drive reported of its supply, of those that did


def read_runs(
    files: Sequence[Path], layout: MudLayout | None, watch: Watch, vertical: CaptureAxis = VERTICAL_AXIS
) -> list[Run]:
    """Read logs, join the segments of each run, replay them and describe their strides. Raises LogError.

    A trial begins a run of its own, so the trials of one daemon are compared.
    """
    runs: dict[str, dict[Path, ScannedLog | None]] = {}
    for path in files:
        if not (path.suffix == ".mcap" or is_lab_csv(path)):
            raise LogError(f"{path}: not a log: its name must end with .mcap, .csv or .csv.gz")
        for known in (known for run in runs.values() for known in run if log_name(known) == log_name(path)):
            same = path.absolute() == known.absolute()
            raise LogError(f"{path}: {'given twice' if same else f'has the name of {known}: rename one of them'}")
        log = None if is_lab_csv(path) else scan_log(path, watch)
        runs.setdefault((log and log.metadata.get("run_id")) or str(path), {})[path] = log
    parts = [part for run in runs.values() for part in _trials_in(run)]
    joined = [(list(part), [log for log in part.values() if log]) for part in parts]
    sources = [(paths, join_logs(paths, logs) if logs else None) for paths, logs in joined]
    return [_read_run(paths, log, layout, watch, vertical) for paths, log in sources]


def _trials_in(run: Mapping[Path, ScannedLog | None]) -> list[dict[Path, ScannedLog | None]]:
    """Split the segments of a run, in their order, where a trial begins."""
    parts: list[dict[Path, ScannedLog | None]] = []
    for path, log in sorted(run.items(), key=lambda each: segment_of(each[1]) if each[1] else 0):
        if not parts or (log and not segments_before(log)):
            parts.append({})
        parts[-1][path] = log
    return parts


def _read_run(
    paths: Sequence[Path], log: ScannedLog | None, layout: MudLayout | None, watch: Watch, vertical: CaptureAxis
) -> Run:
    path = paths[0]
    label = LABEL.search(path.name) if log is None else None
    supply: Sequence[dict[str, Any]] = ()
    if log is None:
        lab = read_lab_csv(path, vertical)
        replay, walks = replay_lab(lab), [walk_of_lab(path, lab)] if lab.flippers else []
    else:
        replay, walks, supply = _read_ticks(path, log, watch)
    described = trial_of(log).get("mud") if log else None
    named = described or (f"{label[1][:-1]} N" if label else "")
    muds_from = MudsFrom.NAMES if layout else MudsFrom.LOG if described else MudsFrom.FILE if label else MudsFrom.ROBOT
    if layout is None and named:
        layout = MudLayout((mud_name(named),), (inf,))
    layout = _placed(path, layout, walks)
    strides = _describe_strides(walks, layout)
    return Run(
        name=log_name(path),
        paths=paths,
        robot=log.metadata.get("robot", "") if log else AUTHORS,
        log=log,
        replay=replay,
        layout=layout,
        muds_from=muds_from,
        walks=walks,
        strides=strides,
        estimates=_describe_estimates(replay, walks, strides),
        causes=read_causes(log.events, log.configuration_text) if log else [],
        supply=supply,
    )


def _read_ticks(path: Path, log: ScannedLog, watch: Watch) -> tuple[Replay, list[RecordedWalk], list[dict[str, Any]]]:
    """Return the estimates, the walks and the supply of a log. Raises LogError."""
    configuration, traces = configuration_of(path, log.configuration_text), WalkTraces(log.rows)
    running, supply = RunningReplay(path, log, configuration), SupplyRange(configuration.rig.joints)
    for ticks in watched_blocks(log, watch, "ticks replayed"):
        running.add(ticks)
        traces.add(ticks)
        supply.add(ticks)
    walks = [walk_of_trace(log, configuration, traces, number) for number in range(1, len(traces.walks) + 1)]
    return running.finish(), walks, supply.rows()


def _placed(path: Path, layout: MudLayout | None, walks: Sequence[RecordedWalk]) -> MudLayout | None:
    """Return the layout by the positions of this log. Raises LogError for several muds where these are not known."""
    if layout is None or not walks:
        return layout
    known = np.concatenate([walk.body_x_m[np.isfinite(walk.body_x_m)] for walk in walks])
    if not len(known) and len(layout.names) > 1:
        raise LogError(f"{path}: has no position of the body, so its strides cannot be assigned to muds: name one mud")
    return layout.beginning_at(float(known[0])) if len(known) else layout


def _describe_strides(walks: Sequence[RecordedWalk], layout: MudLayout | None) -> DataFrame:
    """Return the rows of STRIDES."""
    found, named = [], set[str]()  # muds that the robot noticed in earlier walks may be others
    for number, walk in enumerate(walks, 1):
        regions = mud_regions(walk, None) if layout is None else []
        regions = [each._replace(name=each.name + f", walk {number}" * (each.name in named)) for each in regions]
        named.update(each.name for each in regions)
        by_index: dict[int, list[Stride]] = {}
        for row in sorted(walk.strides, key=lambda row: int(row["index"])):
            by_index.setdefault(row["index"], []).append(row)
        firsts = of_both_flippers(walk, [rows[0] for rows in by_index.values()])
        ends_s = [*(first["t_start_s"] for first in firsts), UNKNOWN][1:]
        for first, rows, end_s in zip(firsts, by_index.values(), ends_s, strict=True):
            found.append(
                {
                    "walk": number,
                    "index": first["index"],
                    "mud": _mud_of(walk, layout, regions, first),
                    "start_s": walk.begun_s + first["t_start_s"],
                    "duration_s": end_s - first["t_start_s"],
                    "step_m": first["step_m"],
                    "depth_m": max(float(row["depth_m"]) for row in rows),
                    "outcome": str(outcome_of(walk, first)),
                    "two_surfaces": any(isfinite(row.get("other_surface_m", nan)) for row in rows),
                    "supply_v": min((v for row in rows if isfinite(v := row.get("supply_min_v", nan))), default=nan),
                }
            )
    return DataFrame(found, columns=list(STRIDES))


def _describe_estimates(replay: Replay, walks: Sequence[RecordedWalk], strides: DataFrame) -> DataFrame:
    """Return the rows of ESTIMATES, those of one stride together."""
    starts_s = [walk.begun_s for walk in walks]
    fits: dict[tuple[int, int, str], tuple[StrideFits, FlipperEstimate]] = {}
    for replayed, of_fits, known in zip(replay.strides, replay.fits, replay.remembered, strict=True):
        number = int(np.searchsorted(starts_s, replayed.t_end_s - replay.begin_s))
        fits[number, replayed.index, replayed.flipper] = of_fits, known
    muds = {(number, index): mud for number, index, mud in strides[["walk", "index", "mud"]].itertuples(index=False)}
    found = []
    for number, walk in enumerate(walks, 1):
        for row in sorted(walk.strides, key=lambda row: (int(row["index"]), row["flipper"])):
            index, flipper = row["index"], FLIPPERS[row["flipper"]]
            own = {"walk": number, "index": index, "mud": muds[number, index], "flipper": flipper}
            of_stride, known = fits.get((number, index, flipper), (NO_FITS, FlipperEstimate()))
            for name in COEFFICIENTS:
                samples, before, estimate = getattr(of_stride, name)(), getattr(known, name), estimate_of_row(row, name)
                if not (samples and abs(samples.slope - row[name]) <= SAME * abs(row[name])):
                    samples = None  # of a bound, or this version would estimate otherwise
                is_known = before is not None and not before.at_least
                expected_n_m3 = before.at(estimate["depth_m"])[0] if is_known else UNKNOWN
                found.append(own | estimate | {"samples": samples, "expected_n_m3": expected_n_m3})
    return estimate_frame(found)


def estimate_frame(rows: Sequence[dict[str, Any]]) -> DataFrame:
    kinds = dict.fromkeys((*NUMBERS, "expected_n_m3"), float) | dict.fromkeys(FLAGS, bool)
    return DataFrame(rows, columns=list(ESTIMATES)).astype(kinds)


def _mud_of(walk: RecordedWalk, layout: MudLayout | None, regions: Sequence[MudRegion], row: Stride) -> str:
    if layout is None:
        return next((each.name for each in reversed(regions) if each.start_s <= row["t_start_s"]), "")
    plates_m, slip_m = _plates_m(walk, row)
    if len(layout.names) == 1 and not isfinite(plates_m):
        return mud_label(layout.names[0])
    return mud_label(layout.mud_at(plates_m, slip_m))


def _plates_m(walk: RecordedWalk, row: Stride) -> tuple[float, float]:
    """Return where the plates go down, and how far they slip to the rear; negative in a walk backward."""
    sweep_rad = walk.series[FLIPPERS[row["flipper"]]]["sweep_angle_rad"]
    times_s = [row["t_start_s"], row["t_start_s"] + row["insertion_s"], row["stamp_s"]]
    begin, down, close = np.searchsorted(walk.time_s, times_s).clip(max=len(walk.time_s) - 1)
    ahead_m = walk.geometry.flipper_length_m * np.sin(sweep_rad)
    swept_m = ahead_m[begin] - ahead_m[begin : close + 1]
    full_m = float(swept_m[np.argmax(np.abs(swept_m))])
    slip_m = full_m - row["step_m"]
    return row["position_m"] + float(ahead_m[down]), max(0.0, slip_m) if full_m > 0.0 else min(0.0, slip_m)


def estimate_of_row(row: Stride, name: str) -> dict[str, Any]:
    """Return one coefficient of a row as the daemon reports an estimate."""
    keys = (name, *(f"{name}_{part}" for part in NUMBERS[1:]))
    numbers = {part: float(row.get(key, nan)) for part, key in zip(NUMBERS, keys, strict=True)}
    return {"coefficient": name, **numbers} | {
        "valid": bool(row[f"{name}_valid"]) and isfinite(numbers["value"]),
        "at_least": bool(row[f"{name}_at_least"]),
        "reason": "",
    }
