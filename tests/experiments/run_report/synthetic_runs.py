"""Runs with strides of known steps, times and coefficients, for tests of reports."""

from collections.abc import Sequence
from math import nan
from pathlib import Path
from typing import Any

from pandas import DataFrame

from control.records import COEFFICIENTS
from estimation.strokes.fit_samples import FitSamples
from experiments.pictures.stride_choice import Outcome
from experiments.run_report.run import STRIDES, MudsFrom, Run, estimate_frame
from logs.replay import Replay

STD_ERROR = 0.04e6
FLIPPERS = ("left", "right")
StrideRows = tuple[dict[str, Any], list[dict[str, Any]]]  # of a run's strides and estimates


def stride(
    mud: str,
    left: float = 1e6,
    right: float = 1e6,
    step_m: float = nan,
    duration_s: float = nan,
    outcome: Outcome = Outcome.GOOD,
    samples: FitSamples | None = None,
    expected_n_m3: float = nan,
    **flags: bool,
) -> StrideRows:
    """Return a stride with the same value for each coefficient of a flipper.

    `samples` are those of k_p; earlier strides let expect `expected_n_m3`.
    """
    own = {"walk": 1, "index": 0, "mud": mud}
    motion = {"start_s": 0.0, "duration_s": duration_s, "step_m": step_m, "depth_m": 0.03, "outcome": str(outcome)}
    estimates = [
        own
        | {"flipper": flipper, "coefficient": name, "samples": samples if name == "k_p" else None}
        | {"value": value, "std_error": STD_ERROR, "valid": True, "at_least": False, "reason": ""}
        | {"expected_n_m3": expected_n_m3}
        | flags
        for flipper, value in zip(FLIPPERS, (left, right), strict=True)
        for name in COEFFICIENTS
    ]
    return own | motion | {"two_surfaces": False}, estimates


def run_of(strides: Sequence[StrideRows], name: str = "run") -> Run:
    return Run(
        name=name,
        paths=[Path(f"{name}.mcap")],
        robot="R1",
        log=None,
        replay=Replay([], FLIPPERS),
        layout=None,
        muds_from=MudsFrom.NAMES,
        walks=[],
        strides=DataFrame([own for own, _ in strides], columns=list(STRIDES)),
        estimates=estimate_frame([each for _, own in strides for each in own]),
        causes=[],
    )
