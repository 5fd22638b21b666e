"""Runs with strides of known steps, times and coefficients, for tests of reports."""

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

from experiments.pictures.stride_choice import Outcome
from experiments.reports.error_table import COEFFICIENTS
from experiments.run_report.comparison import ComparedRun
from experiments.run_report.headline import headline_of
from experiments.run_report.run import MudsFrom, ReportedStride, Run
from logs.replay import Replay

STD_ERROR = 0.04e6


def estimates(value: float, std_error: float = STD_ERROR, at_least: bool = False, valid: bool = True) -> dict[str, Any]:
    """Return a row of the log with the same value for each coefficient."""
    row: dict[str, Any] = {"depth_m": 0.03}
    for name in COEFFICIENTS:
        row |= {name: value, f"{name}_std_error": std_error, f"{name}_valid": valid, f"{name}_at_least": at_least}
    return row


def stride(
    mud: str,
    left: dict[str, Any],
    right: dict[str, Any],
    step_m: float = nan,
    duration_s: float = nan,
    outcome: Outcome = Outcome.GOOD,
) -> ReportedStride:
    return ReportedStride(
        walk=1,
        index=0,
        mud=mud,
        start_s=0.0,
        duration_s=duration_s,
        step_m=step_m,
        outcome=outcome,
        rows={"left": left, "right": right},
        fits={},
    )


def run_of(strides: Sequence[ReportedStride], name: str = "run", robot: str = "R1") -> Run:
    return Run(
        name=name,
        paths=[Path(f"{name}.mcap")],
        robot=robot,
        started="",
        log=None,
        replay=Replay([], ("left", "right")),
        layout=None,
        muds_from=MudsFrom.NAMES,
        walks=[],
        strides=strides,
        causes=[],
        flippers=("left", "right"),
    )


def compared(strides: Sequence[ReportedStride], name: str = "run", robot: str = "R1") -> ComparedRun:
    run = run_of(strides, name, robot)
    return ComparedRun(run, headline_of(run))


def renamed(each: ComparedRun, robot: str) -> ComparedRun:
    return replace(each, run=replace(each.run, robot=robot))
