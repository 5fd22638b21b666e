"""`mudskipper experiment actuator`: from its options to an order for the calibration."""

from __future__ import annotations

import argparse
from pathlib import Path

from command_line.commands import DEFAULT_CONFIG
from command_line.experiments.conduct import conduct_bench
from experiments.actuator.run import Order, calibrate


def run_actuator(options: argparse.Namespace) -> int:
    order = Order(
        joints=tuple(dict.fromkeys(options.joint or ())),
        weights_g=options.weights,
        trials=options.trials,
        lever_m=options.lever_m,
        gravity_m_s2=options.gravity,
        lever_tolerance_m=options.lever_tolerance_mm / 1000.0,
        weight_tolerance=options.weight_tolerance_percent / 100.0,
        apply=options.apply,
        configuration=options.config,
        seed=options.seed,
    )
    return conduct_bench(options, "readings", lambda session: calibrate(session, order, Path(DEFAULT_CONFIG)))
