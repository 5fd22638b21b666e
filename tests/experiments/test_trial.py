"""Simulated trials: what an estimator meets in them, and that they can be met again."""

from functools import cache
from math import isfinite

import numpy as np
import pytest

from control.records import FLIPPERS, Phase
from estimation.mud import EstimationParameters, MudEstimator
from experiments.trial import (
    BENCH_CURRENT_A,
    BENCH_TORQUE_NM,
    SINGLE,
    WALKING,
    Setup,
    Trial,
    _known_drives,
    beliefs_of,
    configuration_of,
    run_trial,
    strides_of,
)
from firmware_host.ticker import PERIOD_S
from simulation.clay import clay_of_water
from simulation.disturbances import LAB, NONE, Disturbances
from simulation.track import Track

TRACK = Track([(100.0, clay_of_water(47.6))])
SETUPS = {"walking": WALKING, "single": SINGLE, "every row new": WALKING._replace(row_period_s=0.0)} if False else {}


def setup_of(name: str, row_period_s: float) -> Setup:
    setup = WALKING if name == "walking" else SINGLE
    return Setup(setup.name, setup.gait, setup.fixed_base, row_period_s, setup.depth_m)


@cache
def trial(
    name: str = "walking", row_period_s: float = 0.005, seed: int = 1, disturbances: Disturbances = LAB
) -> Trial:
    return run_trial(setup_of(name, row_period_s), TRACK, disturbances, 1, seed, 0.032)
