"""The exact value of each bound of a joint is allowed, a reset makes its monitor forget all, and faults carry values.

Ages are exact here: a stamp of zero at the time of the bound.
"""

from __future__ import annotations

from math import radians
from typing import Any

import pytest

from control.monitors.joint_monitor import ENERGISED_S, JointMonitor, TickFacts
from control.parameters.fault_bounds import FaultBounds
from control.parameters.joint_limits import JointLimits
from control.rate import PERIOD_S
from tests.control.monitors.monitored_joint import BOUNDS, HEALTHY, LIMITS, NOW_S, SPAN, faults_of, make_monitor

STAMPS = ("angle_stamp_s", "current_stamp_s", "heartbeat_stamp_s", "temperature_stamp_s")
BOTH = ("angle_stamp_s", "current_stamp_s")


def reported(monitor: JointMonitor, now_s: float = NOW_S, changed: Any = None, **state: Any) -> dict[str, Any]:
    """Return the values of each fault by its name, for one sample whose other signals are new."""
    stamps: dict[str, Any] = dict.fromkeys(STAMPS, now_s)
    found = faults_of(monitor, HEALTHY._replace(**(stamps | state)), now_s, **(changed or {}))
    return {fault.name: dict(fault.values) for fault in found}


@pytest.mark.parametrize(
    ("silent", "bound_s", "expected"),
    [
        (BOTH, BOUNDS.late_s, set()),
        (("angle_stamp_s",), BOUNDS.late_s, set()),
        (("current_stamp_s",), BOUNDS.late_s, set()),
        (BOTH, BOUNDS.quiet_s, {"drive_late"}),
        (("angle_stamp_s",), BOUNDS.quiet_s, {"drive_late"}),
        (("current_stamp_s",), BOUNDS.quiet_s, {"drive_late"}),
        (BOTH, BOUNDS.silence_s, {"drive_quiet"}),
        (("angle_stamp_s",), BOUNDS.silence_s, {"position_stale"}),
        (("current_stamp_s",), BOUNDS.silence_s, {"current_stale"}),
    ],
)
def test_a_signal_may_be_exactly_as_old_as_its_bound(
    silent: tuple[str, ...], bound_s: float, expected: set[str]
) -> None:
    assert set(reported(make_monitor(), bound_s, **dict.fromkeys(silent, 0.0))) == expected


@pytest.mark.parametrize(
    ("position_s", "current_s", "signal"),
    [(0.007, 0.006, "position"), (0.006, 0.007, "current"), (0.006,) * 2 + ("current",)],
)
def test_the_older_signal_is_named_and_of_two_equal_ones_the_current(
    position_s: float, current_s: float, signal: str
) -> None:
    late = reported(make_monitor(), 1.0, angle_stamp_s=1.0 - position_s, current_stamp_s=1.0 - current_s)["drive_late"]
    assert late == {"signal": signal, "age_s": pytest.approx(max(position_s, current_s))}


@pytest.mark.parametrize(
    ("stamp", "name"),
    [
        ("heartbeat_stamp_s", "heartbeat_silent"),
        ("temperature_stamp_s", "temperature_silent"),
        ("bus_voltage_stamp_s", "voltage_silent"),
    ],
)
def test_a_slow_signal_that_is_gone_is_reported_with_its_age(stamp: str, name: str) -> None:
    assert reported(make_monitor(), 5.0, **{stamp: 3.0}) == {name: {"age_s": 2.0}}


@pytest.mark.parametrize(
    "edge_rad", [SPAN.min_rad - radians(LIMITS.position_margin_deg), SPAN.max_rad + radians(LIMITS.position_margin_deg)]
)
def test_a_joint_may_be_exactly_at_the_end_of_its_margin(edge_rad: float) -> None:
    assert reported(make_monitor(), angle_rad=edge_rad) == {}


def test_a_joint_may_be_fast_for_exactly_its_time_less_half_a_tick() -> None:
    monitor, tick = make_monitor(FaultBounds(fast_s=0.01)), {"dt_s": 0.004}
    fast = [set(reported(monitor, changed=tick, velocity_rad_s=100.0)) for _ in range(3)]
    assert fast == [set(), set(), {"joint_velocity"}]  # after 0.004, 0.008 and 0.012 s


def test_a_joint_is_at_rest_exactly_a_tenth_of_a_second_after_its_last_step() -> None:
    monitor, tick = make_monitor(), {"dt_s": 0.025, "energised": False, "moving": False}
    reported(monitor, changed=tick, angle_rad=0.0, closed_loop=False)
    moving = [reported(monitor, changed=tick, angle_rad=0.1, closed_loop=False) for _ in range(5)]
    assert [("joint_moving" in found) for found in moving] == [True, True, True, True, False]


def test_a_drive_may_stay_in_closed_loop_for_exactly_two_heartbeats() -> None:
    monitor, idle = make_monitor(), {"energised": False, "moving": False}
    for dt_s in 6 * (0.03,) + (ENERGISED_S - sum(6 * (0.03,)),):
        assert not reported(monitor, changed=idle | {"dt_s": dt_s})
    assert set(reported(monitor, changed=idle)) == {"drive_energised"}


def test_a_supply_exactly_at_its_lower_bound_ends_the_wait() -> None:
    monitor, tick = make_monitor(), {"dt_s": 0.03}
    for volts in (19.9, 19.9, 19.9, 20.0, 20.0, 20.0):
        assert not reported(monitor, changed=tick, bus_voltage_v=volts)


def test_a_third_current_in_a_row_is_too_large() -> None:
    monitor = make_monitor()
    assert [("joint_current" in reported(monitor, current_a=20.0)) for _ in range(3)] == [False, False, True]


def test_torque_is_missing_while_damping_only_where_the_loop_damps() -> None:
    assert TickFacts(0.0, PERIOD_S, True, True, False).damping is False


# a reset begins everything again


def test_after_a_reset_an_encoder_may_have_moved() -> None:
    monitor = make_monitor()
    reported(monitor, NOW_S, angle_rad=0.0)
    monitor.reset()
    assert not reported(monitor, NOW_S + PERIOD_S, angle_rad=0.6)


def test_after_a_reset_a_joint_counts_as_still_until_it_moves() -> None:
    monitor, rest = make_monitor(), {"energised": False, "moving": False}
    reported(monitor, changed=rest, angle_rad=0.0, closed_loop=False)
    assert "joint_moving" in reported(monitor, changed=rest, angle_rad=0.1, closed_loop=False)
    monitor.reset()
    assert "joint_moving" not in reported(monitor, changed=rest, angle_rad=0.1, closed_loop=False)


def test_after_a_reset_no_energy_is_left_unexplained() -> None:
    monitor = make_monitor(limits=JointLimits(velocity_rad_s=100.0))
    for number in range(20):
        speed_rad_s, now_s = 0.5 * number, NOW_S + number * PERIOD_S
        reported(
            monitor,
            now_s,
            {"torque_nm": -0.2},
            angle_rad=speed_rad_s * number * PERIOD_S / 2.0,
            velocity_rad_s=speed_rad_s,
        )
    assert monitor._motion.unexplained_j > 0.0
    monitor.reset()
    assert monitor._motion.unexplained_j == 0.0
