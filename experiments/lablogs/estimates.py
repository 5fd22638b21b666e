"""The estimates of one log by each method, as recorded and with each disturbance: a data frame with a row for each
coefficient of each stride.

A CSV of the authors is one trial. A log of this project has a trial for each of its walks: the count of strides begins
again there.
"""

from collections.abc import Iterable, Iterator, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np
import pandas
from pandas import DataFrame

from control.records import COEFFICIENTS, Estimate, StrideEstimate
from estimation.estimation_parameters import Method
from experiments.lablogs.log_choice import matches
from experiments.lablogs.recording import Recording, read_recording
from experiments.reports.depth_law import re_entered
from firmware_host.configuration.configuration import CaptureAxis
from logs.files.log_error import LogError
from logs.lab.body_track import VERTICAL_AXIS

METHODS: tuple[Method, ...] = ("default", "paper")
DELAY_S = 0.005  # between current and position: the authors' drives sent a new state every 5 to 20 ms
MISSING_ROWS = 0.3
SEEDS = (1, 2, 3)  # of the random choice of missing rows: one draw can spare the few rows that matter
RECORDED, LATE, EARLY, MISSING = "recorded", "current_late", "current_early", "rows_missing"
DISTURBED = ((LATE, 0), (EARLY, 0), *((MISSING, seed) for seed in SEEDS))
HOLE_M = 0.025  # a plate's width: mud so near to its last hole is disturbed, and was 4 to 7 times weaker in a walk
OF_STRIDE = ("flipper", "index", "t_start_s", "stance", "step_m")
NUMBERS = ("value", "std_error", "repeatability", "depth_m", "speed_m_s")  # of an estimate
COLUMNS = dict.fromkeys((*OF_STRIDE, "coefficient", *NUMBERS, "kind"), "object")  # kind: value, bound or invalid
COLUMNS |= {"index": "int64"} | dict.fromkeys(("t_start_s", "step_m", *NUMBERS), "float64")


class EvaluatedLog(NamedTuple):
    name: str  # of its file
    flippers: tuple[str, ...]
    fixed_base: bool
    in_mud: bool
    estimates: DataFrame
    findings: tuple[str, ...] = ()  # peculiarities of the file
    mud: str = ""  # that the log names


class Refusal(NamedTuple):
    """A log that is not evaluated."""

    name: str
    reason: str


def read_log(
    paths: Sequence[Path],
    vertical: CaptureAxis = VERTICAL_AXIS,
    surface_error_m: float | None = None,
    air: Sequence[str] = (),
) -> EvaluatedLog | Refusal:
    """Read one log and replay it by every method. Without mud there is nothing to disturb.

    `air`: patterns of the names of all logs without mud, which is detected where none is given.
    """
    name = paths[0].name
    try:
        recording = read_recording(paths, vertical, surface_error_m)
        in_mud = not any(matches(name, each) for each in air) if air else recording.has_evidence_of_mud()
        frames = [
            estimate_rows(run.estimate_strides(method), method=method, disturbance=disturbance, seed=seed)
            for disturbance, seed, run in _runs(name, recording, in_mud)
            for method in METHODS
        ]
    except LogError as problem:
        return Refusal(name, str(problem))
    except (ValueError, ArithmeticError, LookupError) as defect:  # of this program; the other logs are still evaluated
        return Refusal(name, f"{paths[0]}: cannot be evaluated: {type(defect).__name__}: {defect}")
    return EvaluatedLog(
        name=name,
        flippers=recording.flippers,
        fixed_base=recording.fixed_base,
        in_mud=in_mud,
        estimates=pandas.concat(frames, ignore_index=True),
        findings=recording.findings,
        mud=recording.mud,
    )


def _runs(name: str, recording: Recording, disturbed: bool) -> Iterator[tuple[str, int, Recording]]:
    """Yield the recorded run and the disturbed ones. A log loses the same rows in any folder."""
    yield RECORDED, 0, recording
    if disturbed:
        yield LATE, 0, recording.delay_current(DELAY_S)
        yield EARLY, 0, recording.delay_current(-DELAY_S)
        key = crc32(name.encode(errors="surrogateescape"))
        for seed in SEEDS:
            yield MISSING, seed, recording.remove_rows(MISSING_ROWS, np.random.default_rng((seed, key)))


def estimate_rows(strides: Iterable[StrideEstimate], **shared: Any) -> DataFrame:
    """Return the estimates in the order of the strides, with the number of the walk that each belongs to.

    `re_entered`: the body had advanced by less than HOLE_M since the flipper's stride before. False without a pose.
    """
    rows = [
        {key: getattr(stride, key) for key in OF_STRIDE}
        | {"coefficient": name, "kind": _kind_of(estimate)}
        | estimate._asdict()
        for stride in strides
        for name in COEFFICIENTS
        for estimate in (getattr(stride, name),)
    ]
    frame = DataFrame(rows, columns=list(COLUMNS)).astype(COLUMNS)
    keys = [frame["flipper"], frame["coefficient"]]
    restarts = frame["index"].groupby(keys).diff() <= 0.0
    frame = frame.assign(walk=restarts.groupby(keys).cumsum(), **shared)
    return frame.assign(re_entered=re_entered(frame.groupby(["flipper", "coefficient", "walk"]), HOLE_M))


def _kind_of(estimate: Estimate) -> str:
    if estimate.valid and estimate.at_least:
        return "bound"
    return "value" if estimate.valid and isfinite(estimate.value) else "invalid"


def join_estimates(logs: Sequence[EvaluatedLog], groups: Sequence[str | None]) -> DataFrame:
    """Return the estimates of all logs, with the number, the group and the conditions of each log."""
    frames = [
        log.estimates.assign(log=number, group=group, fixed_base=log.fixed_base, in_mud=log.in_mud)
        for number, (log, group) in enumerate(zip(logs, groups, strict=True))
    ]
    none = estimate_rows([], method="", disturbance="", seed=0, log=0, group="", fixed_base=False, in_mud=False)
    return pandas.concat(frames or [none], ignore_index=True)


def has_error(estimates: DataFrame) -> "pandas.Series[bool]":
    """Return which rows are values with a repeatability to compare their scatter with."""
    errors = estimates["repeatability"]
    return (estimates["kind"] == "value") & np.isfinite(errors) & (errors > 0.0)


def strokes_of(estimates: DataFrame) -> DataFrame:
    """Return the strides of one method on a fixed base, of the flipper in the mud: the one with the most values.

    `trial` names the walk of the log, and `stroke` counts from 0 in it.
    """
    own = estimates[estimates["fixed_base"].astype(bool)]
    values = (own["kind"] == "value").groupby([own["log"], own["flipper"]], sort=False).sum()
    in_mud = values.groupby("log").transform("idxmax").drop_duplicates()
    own = own[own.set_index(["log", "flipper"]).index.isin(in_mud)]
    return own.assign(
        trial=own.groupby(["log", "walk"], sort=False).ngroup(),
        stroke=own.groupby(["log", "walk", "coefficient"]).cumcount(),
    )
