"""`mudskipper experiment actuator`: from its options to an order for the calibration."""

import argparse
from pathlib import Path

from command_line.experiments.conduct import conduct_bench
from command_line.options.shared import DEFAULT_CONFIG
from control.parameters.arm_mass import GRAVITY_M_S2
from experiments.actuator.plan import PAPER_WEIGHTS_G, Plan
from experiments.actuator.run import Order, calibrate
from firmware_host.configuration.configuration import Configuration

DEFAULT_JOINTS = ("right_adduction", "right_sweep")


def run_actuator(options: argparse.Namespace) -> int:
    def plan(configuration: Configuration) -> Plan:
        return Plan(
            joints=tuple(dict.fromkeys(options.joint or DEFAULT_JOINTS)),
            weights_g=options.weights or PAPER_WEIGHTS_G,
            trials=options.trials,
            lever_m=options.lever_m or configuration.geometry.flipper_length_m,
            gravity_m_s2=options.gravity or GRAVITY_M_S2,
            lever_tolerance_m=options.lever_tolerance_mm / 1000.0,
            weight_tolerance=options.weight_tolerance_percent / 100.0,
        )

    order = Order(plan, apply=options.apply, configuration=options.config, seed=options.seed)
    return conduct_bench(
        options, "readings", lambda session: calibrate(session, order, Path(DEFAULT_CONFIG)), calibrate.__module__
    )
