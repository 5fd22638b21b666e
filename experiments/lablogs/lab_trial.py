"""One log: its strides by each method, as recorded and with each disturbance.

A CSV of the authors is one trial. A log of this project has a trial for each of its walks: the count of strides begins
again there.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from math import isfinite
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

import numpy as np

from control.records import FLIPPERS, Estimate, StrideEstimate
from estimation.estimation_parameters import Method
from experiments.lablogs.recording import Recording, read_recording
from experiments.reports.error_table import COEFFICIENTS
from firmware_host.configuration.configuration import CaptureAxis
from logs.files.log_error import LogError
from logs.lab.body_track import VERTICAL_AXIS

METHODS: tuple[Method, ...] = ("default", "paper")
DELAY_S = 0.005  # between current and position: the authors' drives sent a new state every 5 to 20 ms
MISSING_ROWS = 0.3
SEEDS = (1, 2, 3)  # of the random choice of missing rows: one draw can spare the few rows that matter
Strides = Sequence[StrideEstimate]


class Replays(NamedTuple):
    """The strides of one log by one method."""

    recorded: Strides
    current_late: Strides = ()
    current_early: Strides = ()
    rows_missing: Sequence[Strides] = ()  # one for each of SEEDS


class LabTrial(NamedTuple):
    name: str  # of the log's file
    flippers: tuple[str, ...]
    fixed_base: bool
    in_mud: bool
    replays: Mapping[Method, Replays]
    findings: tuple[str, ...] = ()

    def stroke_flipper(self, method: Method) -> str:
        """Return the flipper in the mud, on a fixed base: the one with the most values."""
        strides = self.replays[method].recorded
        return max(self.flippers, key=lambda flipper: sum(_count_values(s) for s in strides if s.flipper == flipper))

    def strokes(self, method: Method) -> list[Strides]:
        """Return the strides of the flipper in the mud, on a fixed base, by walk."""
        return split_walks(self.replays[method].recorded, self.stroke_flipper(method))


class Refusal(NamedTuple):
    """A log that is not evaluated."""

    name: str
    reason: str


def is_value(estimate: Estimate) -> bool:
    return estimate.valid and not estimate.at_least and isfinite(estimate.value)


def is_bound(estimate: Estimate) -> bool:
    return estimate.valid and estimate.at_least


def claims_error(estimate: Estimate) -> bool:
    """Whether the estimate is a value with an error to compare its scatter with."""
    return is_value(estimate) and isfinite(estimate.std_error) and estimate.std_error > 0.0


def split_walks(strides: Strides, flipper: str) -> list[Strides]:
    """Return the strides of one flipper by walk."""
    walks: list[list[StrideEstimate]] = []
    for stride in strides:
        if stride.flipper == flipper:
            if not walks or stride.index <= walks[-1][-1].index:
                walks.append([])
            walks[-1].append(stride)
    return list(walks)


def pair_flippers(strides: Strides) -> list[tuple[StrideEstimate, StrideEstimate]]:
    """Return the left and the right flipper's part of each stride: both begin with the same sample."""
    left, right = ({stride.t_start_s: stride for stride in strides if stride.flipper == name} for name in FLIPPERS)
    return [(left[t_start_s], right[t_start_s]) for t_start_s in left if t_start_s in right]


def read_trial(
    paths: Sequence[Path], disturbed: bool = True, vertical: CaptureAxis = VERTICAL_AXIS
) -> LabTrial | Refusal:
    """Read one log and replay it by every method. Without mud there is nothing to disturb."""
    name = paths[0].name
    try:
        recording = read_recording(paths, vertical)
        in_mud = recording.has_evidence_of_mud()
        replay = partial(_replay_disturbed, name) if disturbed and in_mud else _replay
        replays = {method: replay(recording, method) for method in METHODS}
    except LogError as problem:
        return Refusal(name, str(problem))
    except (ValueError, ArithmeticError, LookupError) as defect:  # of this program; the other logs are still evaluated
        return Refusal(name, f"{paths[0]}: cannot be evaluated: {type(defect).__name__}: {defect}")
    return LabTrial(name, recording.flippers, recording.fixed_base, in_mud, replays, recording.findings)


def _replay(recording: Recording, method: Method) -> Replays:
    return Replays(recording.estimate_strides(method))


def _replay_disturbed(name: str, recording: Recording, method: Method) -> Replays:
    """Also replay with each disturbance. A log loses the same rows by each method and in any folder."""
    key = crc32(name.encode(errors="surrogateescape"))
    return Replays(
        recorded=recording.estimate_strides(method),
        current_late=recording.delay_current(DELAY_S).estimate_strides(method),
        current_early=recording.delay_current(-DELAY_S).estimate_strides(method),
        rows_missing=[
            recording.remove_rows(MISSING_ROWS, np.random.default_rng((seed, key))).estimate_strides(method)
            for seed in SEEDS
        ],
    )


def _count_values(stride: StrideEstimate) -> int:
    return sum(is_value(getattr(stride, name)) for name in COEFFICIENTS)
