"""A plan is checked against the configuration before a weight is hung."""

from dataclasses import replace

import pytest

from experiments.actuator.plan import WeighingPlan, require_possible, stays_cool, steps_of
from experiments.actuator.simulation import bench_configuration
from experiments.robot.bench_errors import BenchError
from firmware_host.configuration.configuration import Configuration


def test_passes_lie_between_readings_of_the_empty_arm_and_only_the_first_rises() -> None:
    steps = steps_of(WeighingPlan(("left_sweep",), weights_g=(400.0, 10.0, 50.0), trials=3))
    assert [(step.trial, step.weight_g) for step in steps] == [
        (0, 0.0),
        (1, 10.0), (1, 50.0), (1, 400.0), (1, 0.0),
        (2, 400.0), (2, 10.0), (2, 50.0), (2, 0.0),
        (3, 400.0), (3, 10.0), (3, 50.0), (3, 0.0),
    ]  # fmt: skip
    assert len({step.key for step in steps}) == len(steps)


def test_a_weight_beyond_the_torque_limit_is_refused_with_key_value_and_bound(configuration: Configuration) -> None:
    with pytest.raises(BenchError) as refused:
        require_possible(WeighingPlan(("right_sweep",)), configuration)
    message = str(refused.value)
    assert "limits.torque_nm = 0.75: must be at least 1.25 for 800 g at 12 cm" in message
    assert "set it to 1.25, current_limit_a of all drives to 18.1" in message  # 17.4 for k_t = 0.0719
    assert "at most 400 g of them" in message
    require_possible(WeighingPlan(("right_sweep",), weights_g=(100.0, 400.0)), configuration)


def test_a_weight_that_the_winding_does_not_bear_is_refused() -> None:
    configuration = bench_configuration()
    hot = replace(configuration, winding=replace(configuration.winding, thermal_resistance_k_w=4.0))
    with pytest.raises(BenchError, match=r"winding.thermal_resistance_k_w = 4: 800 g would warm the winding of left_"):
        require_possible(WeighingPlan(("left_sweep",)), hot)


def test_a_winding_must_stay_below_the_temperature_at_which_torque_fades(configuration: Configuration) -> None:
    warm_c = configuration.limits.temperature_warm_c
    assert [stays_cool(configuration, 0.0, warm_c - below_k, 0.0) for below_k in (1.9, 2.1)] == [False, True]
