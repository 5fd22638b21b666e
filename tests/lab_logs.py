"""Synthetic logs in the authors' form with a known truth, for tests that read such logs."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from logs.lab.lab_csv import LabLog, read_lab_csv

Columns = dict[str, NDArray[Any]]
Change = Callable[[Columns], None]

RATE_HZ = 200.0
CONSTANT_NM_A = 0.083
JOINTS = ("leftsweeping", "leftadduction", "rightsweeping", "rightadduction")
DOWN_RAD, FRONT_RAD = -0.36, 0.5
DEPTH_M = 0.03
SETTINGS = {"scenario": "turtle", "lateral_angle_range": "0.5", "extraction_height": "0.01", "insertion_angle": "0.03"}
CYCLE = (  # state, duration in s, sweep and adduction in rad at its end, torques in N·m in mud and in air
    (2, 0.5, FRONT_RAD, DOWN_RAD, (0.0, -0.30), (0.0, 0.06)),
    (3, 1.0, -FRONT_RAD, DOWN_RAD, (-0.6, -0.10), (-0.06, 0.06)),
    (4, 0.5, -FRONT_RAD, 0.0, (0.0, 0.30), (0.0, 0.06)),
    (1, 1.0, FRONT_RAD, 0.0, (0.05, 0.06), (0.05, 0.06)),
)  # the arm's weight is 0.06 N·m, so in air its motor brakes as it goes down


def lab_columns(strides: int = 3, mud: bool = True) -> Columns:
    """Return a walk of both flippers in mud, or in air, where the motors only overcome friction and the arm's weight.

    The angles fall in insertion and stance.
    """
    rest = (0, 1.0, 0.0, 0.0, (0.0, 0.06), (0.0, 0.06))
    parts = [rest, CYCLE[3], *CYCLE * strides]
    noise = np.random.default_rng(7)
    angles, torques, states, before = [], [], [], (0.0, 0.0)
    for state, duration_s, sweep_rad, adduction_rad, in_mud, in_air in parts:
        count = int(duration_s * RATE_HZ)
        fraction = np.arange(1, count + 1)[:, None] / count
        angles.append(np.array(before) + fraction * (np.array((sweep_rad, adduction_rad)) - np.array(before)))
        torques.append(np.full((count, 2), in_mud if mud else in_air))
        states += [state] * count
        before = (sweep_rad, adduction_rad)
    angle_rad, torque_nm = np.concatenate(angles), np.concatenate(torques)
    columns: Columns = {"time": np.arange(len(states)) / RATE_HZ, "turtle_state": np.array(states, dtype=float)}
    for number, joint in enumerate(JOINTS):
        columns[f"{joint}_pos"] = (angle_rad[:, number % 2] + noise.normal(0.0, 1e-4, len(states))) / math.tau
        columns[f"{joint}_curr"] = torque_nm[:, number % 2] / CONSTANT_NM_A + noise.normal(0.0, 0.05, len(states))
    return columns


def write_lab_log(path: Path, columns: Columns, settings: dict[str, str] = SETTINGS) -> Path:
    """Write the columns in the form that the authors publish."""
    head = [",".join(settings), ",".join(settings.values()), ",".join(columns)]
    rows = [",".join(f"{value:.9g}" for value in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
    return path


def read_columns(folder: Path, columns: Columns, **options: Any) -> LabLog:
    """Write the columns as a log in this folder and read it."""
    return read_lab_csv(write_lab_log(folder / "run.csv", columns), **options)
