"""Synthetic logs, estimates and strides with given contents."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame

from control.modes import Mode
from control.records import Phase, StrideEstimate
from estimation.estimation_parameters import EstimationParameters
from experiments.robot.lockstep_robot import simulated_configuration
from experiments.trials.stride_profile import COLUMNS, OF_FLIPPER
from experiments.trials.trial import Trial, replay_trial
from logs.files.log_reader import Log
from logs.files.tick_array import tick_type

CONFIGURATION = simulated_configuration()
GEOMETRY = CONFIGURATION.geometry
RIGHT_SWEEP, RIGHT_ADDUCTION = 2, 3


def make_ticks(phases: list[Phase], stride: int = 0, start_s: float = 0.0) -> NDArray[np.void]:
    """Return a row of a walk for each phase, a hundredth of a second apart."""
    ticks = np.zeros(len(phases), tick_type())
    ticks["stamp_s"] = start_s + 0.01 * np.arange(len(phases))
    ticks["mode"], ticks["stride"], ticks["phase"] = Mode.WALKING, stride, phases
    return ticks


def make_log(*ticks: NDArray[np.void]) -> Log:
    rows = np.concatenate(ticks)
    return Log({}, CONFIGURATION.text, rows, [], [], True)


def make_estimate(value: float | None = 1e6, **others: Any) -> dict[str, Any]:
    reported = {"value": value, "std_error": 0.05e6, "samples": 9, "valid": value is not None, "reason": ""}
    return reported | {"at_least": False} | others


def make_stride(**others: Any) -> dict[str, Any]:
    return {name: make_estimate() for name in ("k_p", "k_s", "k_e")} | {"index": 0, "surface_m": 0.0} | others


def make_profile(phase: Phase, sweeps_deg: list[float], depths_m: list[float], **others: Any) -> DataFrame:
    """Return a profile whose adduction angles put the edge at each depth."""
    sweeps_rad = np.radians(sweeps_deg)
    columns = dict.fromkeys((*COLUMNS[3:], *OF_FLIPPER), 0.0) | {
        "time_s": 0.01 * np.arange(len(depths_m)),
        "phase": phase,
        "sweep_rad": sweeps_rad,
        "adduction_rad": [GEOMETRY.adduction_rad(s, d) for s, d in zip(sweeps_rad, depths_m, strict=True)],
        "depth_m": depths_m,
    }
    return DataFrame(columns | others)


def strides_of(trial: Trial, parameters: EstimationParameters, with_pose: bool = True) -> list[StrideEstimate]:
    """Return an estimator's strides of a simulated trial."""
    return [stride for stride, _ in replay_trial(trial, parameters, with_pose)]
