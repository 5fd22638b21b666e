"""The winding's temperature against scipy's integrator, and under the reading of a sensor."""

from math import inf, isfinite, nan, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from control.monitors.winding import HOTTEST_C, Winding
from control.parameters.joint_limits import JointLimits
from control.parameters.winding_parameters import WindingParameters
from control.rate import PERIOD_S

PARAMETERS = WindingParameters()


def heated(current_a: float, ticks: int, dt_s: float = PERIOD_S) -> Winding:
    winding = Winding(PARAMETERS)
    for _ in range(ticks):
        winding.update(dt_s, current_a, nan)
    return winding


def test_it_begins_as_warm_as_the_room_and_stays_so_without_current() -> None:
    assert heated(0.0, 1000).temperature_c == PARAMETERS.room_c


def test_a_changing_current_heats_it_like_an_integrator() -> None:
    def current_a(time_s: float) -> float:
        return 10.0 * sin(2.0 * time_s) + 2.0

    def slope_k_s(time_s: float, temperature_c: np.ndarray) -> np.ndarray:
        watts = 1.5 * PARAMETERS.resistance_ohm * (1.0 + 0.0039 * (temperature_c - 25.0)) * current_a(time_s) ** 2
        gap_k = PARAMETERS.room_c - temperature_c
        return np.asarray((gap_k + PARAMETERS.thermal_resistance_k_w * watts) / PARAMETERS.time_constant_s)

    exact = solve_ivp(slope_k_s, (0.0, 60.0), [PARAMETERS.room_c], rtol=1e-9, atol=1e-9).y[0, -1]
    winding = Winding(PARAMETERS)
    for tick in range(round(60.0 / PERIOD_S)):
        winding.update(PERIOD_S, current_a((tick + 0.5) * PERIOD_S), nan)
    assert winding.temperature_c == pytest.approx(float(exact), abs=0.01)
    assert exact > 60.0


def test_a_sensor_that_reads_higher_is_trusted_and_one_that_reads_lower_is_not() -> None:
    winding = heated(5.0, 10000)
    before_c = winding.temperature_c
    assert winding.update(PERIOD_S, 5.0, before_c - 10.0) == pytest.approx(before_c, abs=0.01)
    assert winding.update(PERIOD_S, 5.0, before_c + 10.0) == before_c + 10.0
    assert winding.update(PERIOD_S, 5.0, nan) == pytest.approx(before_c + 10.0, abs=0.01)


def test_a_current_that_is_no_number_adds_no_heat() -> None:
    for current_a in (nan, inf, -inf):
        assert heated(current_a, 100).temperature_c == PARAMETERS.room_c


@given(st.lists(st.tuples(st.floats(0.0, 10.0), st.floats(-1e38, 1e38) | st.just(nan), st.floats() | st.just(nan))))
def test_for_any_input_the_temperature_stays_between_room_and_burning(
    updates: list[tuple[float, float, float]],
) -> None:
    winding = Winding(PARAMETERS)
    for dt_s, current_a, measured_c in updates:
        temperature_c = winding.update(dt_s, current_a, measured_c)
        assert isfinite(temperature_c) and PARAMETERS.room_c - 1e-9 <= temperature_c <= HOTTEST_C


def test_full_torque_by_the_limits_is_a_matter_of_a_minute_and_of_an_hour_at_a_third() -> None:
    """0.75 N·m at 0.083 N·m/A are 9 A, more than a motor withstands for long; a third of that is harmless."""
    limits = JointLimits()
    full_a = limits.torque_nm / 0.083
    winding, seconds = Winding(PARAMETERS), 0
    while winding.update(1.0, full_a, nan) < limits.temperature_hot_c:
        seconds += 1
        assert seconds < 120
    assert seconds > 20
    assert heated(full_a / 3.0, 3600, 1.0).temperature_c < limits.temperature_warm_c


def test_a_reset_makes_it_as_warm_as_the_room() -> None:
    winding = heated(9.0, 1000)
    winding.reset()
    assert winding.temperature_c == PARAMETERS.room_c
