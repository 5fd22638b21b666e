"""The bounds of a joint's faults, pinned from both sides, and the effect of an old or an absurd current on the
winding.
"""

from __future__ import annotations

from math import inf, nextafter
from typing import Any

import pytest

from control.monitors.joint_monitor import JointMonitor
from control.parameters.fault_bounds import FaultBounds
from control.parameters.joint_limits import JointLimits
from control.rate import PERIOD_S
from control.records import NEVER_S, DriveState
from tests.control.monitors.monitored_joint import (
    BOUNDS,
    CURRENT_LIMIT_A,
    HEALTHY,
    NOW_S,
    TORQUE_CONSTANT_NM_A,
    WINDING,
    faults_of,
    make_monitor,
)


def state(**changes: Any) -> DriveState:
    return HEALTHY._replace(**changes)


def found(monitor: JointMonitor, measured: DriveState, **changes: Any) -> set[str]:
    return {fault.name for fault in faults_of(monitor, measured, **changes)}


def ticks_until(name: str, measured: DriveState, monitor: JointMonitor | None = None, **changes: Any) -> int:
    """Return the number of ticks with this sample up to the first with the fault."""
    monitor = monitor or make_monitor()
    return next(tick for tick in range(1, 2000) if name in found(monitor, measured, **changes))


def test_the_default_bounds_are_those_that_the_reference_publishes() -> None:
    """The times of a few ticks are 2, 3, 10, 3, 5 and 4 periods of the loop; the others suit a machine of this size."""
    assert FaultBounds() == FaultBounds(
        late_s=0.0053,
        quiet_s=0.0079,
        silence_s=0.0263,
        jump_rad=0.05,
        fast_s=0.0079,
        lag_s=0.0131,
        crawl_s=0.0105,
        lag_fraction=0.1,
        longest_watchdog_s=0.3,
        voltage_low_v=20.0,
        voltage_min_v=18.0,
        disk_free_fraction=0.05,
        disk_slow_s=2.0,
    )


# each fault in its tick: the figures are ticks of 1 / 380 s


def test_a_drive_may_report_closed_loop_for_two_heartbeats_after_it_was_let_go() -> None:
    assert ticks_until("drive_energised", state(), energised=False, moving=False) in (76, 77)  # 0.2 s


def test_a_torque_may_be_missing_for_a_tenth_of_a_second_and_by_three_tenths_of_the_limit() -> None:
    assert ticks_until("torque_missing", state(), torque_nm=0.226) == 39
    monitor = make_monitor()
    assert all("torque_missing" not in found(monitor, state(), torque_nm=0.224) for _ in range(200))
    exact = make_monitor(limits=JointLimits(torque_nm=1.0))
    assert all("torque_missing" not in found(exact, state(), torque_nm=0.3) for _ in range(200))


def test_a_torque_that_returns_for_one_tick_begins_the_wait_again() -> None:
    monitor, given = make_monitor(), state(current_a=0.5 / TORQUE_CONSTANT_NM_A)
    for _ in range(5):
        assert not any("torque_missing" in found(monitor, state(), torque_nm=0.5) for _ in range(38))
        found(monitor, given, torque_nm=0.5)


def test_a_joint_may_stand_at_full_torque_for_two_seconds() -> None:
    assert ticks_until("joint_not_following", state(current_a=9.0), torque_nm=0.75) == 761
    assert ticks_until("joint_not_following", state(current_a=9.0), torque_nm=0.95 * 0.75) == 761
    assert ticks_until("joint_not_following", state(current_a=9.0), torque_nm=0.75, dt_s=0.015625) == 129


def test_a_joint_that_is_not_pushed_for_one_tick_begins_the_wait_again() -> None:
    monitor, held = make_monitor(), state(current_a=9.0)
    for _ in range(2):
        assert not any("joint_not_following" in found(monitor, held, torque_nm=0.75) for _ in range(700))
        found(monitor, held, torque_nm=0.7)


def test_a_current_that_is_calm_for_one_tick_may_be_too_large_for_two_again() -> None:
    monitor = make_monitor()
    for _ in range(5):
        assert not found(monitor, state())
        assert not any("joint_current" in found(monitor, state(current_a=16.0)) for _ in range(2))


def test_without_a_torque_limit_no_joint_has_to_follow() -> None:
    monitor = make_monitor(limits=JointLimits(torque_nm=0.0))
    assert not any("joint_not_following" in found(monitor, state()) for _ in range(1000))


def test_a_supply_may_be_low_for_two_messages() -> None:
    assert ticks_until("voltage_low", state(bus_voltage_v=19.9)) == 58  # 0.15 s
    assert ticks_until("voltage_under", state(bus_voltage_v=17.9)) == 58
    for voltage_v, name in ((19.9, "voltage_low"), (17.9, "voltage_under")):
        assert ticks_until(name, state(bus_voltage_v=voltage_v), dt_s=0.03) == 6  # exactly its time is no fault


def test_a_supply_that_is_good_for_one_tick_begins_the_wait_again() -> None:
    monitor = make_monitor()
    for voltage_v in (19.9, 17.9):
        for _ in range(5):
            assert not any(found(monitor, state(bus_voltage_v=voltage_v)) for _ in range(57))
            assert not found(monitor, state(bus_voltage_v=24.0))


def test_the_time_of_a_low_supply_does_not_count_as_one_of_too_low_a_supply() -> None:
    monitor = make_monitor()
    for _ in range(100):
        found(monitor, state(bus_voltage_v=19.0))
    assert found(monitor, state(bus_voltage_v=17.0)) == {"voltage_low"}


def test_a_supply_at_its_bound_is_good() -> None:
    assert not any(found(make_monitor(), state(bus_voltage_v=20.0)) for _ in range(3))
    monitor = make_monitor()
    assert {name for _ in range(100) for name in found(monitor, state(bus_voltage_v=18.0))} == {"voltage_low"}


def test_a_sensor_may_be_too_hot_for_two_messages() -> None:
    assert ticks_until("motor_overheating", state(temperature_c=80.0)) == 58
    assert ticks_until("motor_hot", state(temperature_c=90.0)) == 58
    assert ticks_until("motor_overheating", state(temperature_c=80.0), dt_s=0.075) == 3  # exactly its time is no fault


def test_a_sensor_that_is_cool_for_one_tick_begins_the_wait_again() -> None:
    monitor = make_monitor()
    for _ in range(5):
        assert not any(found(monitor, state(temperature_c=85.0)) for _ in range(57))
        assert not found(monitor, state(temperature_c=25.0))


def test_five_heartbeats_may_be_missing() -> None:
    for age_s, expected in ((0.5, set()), (0.501, {"heartbeat_silent"})):
        assert found(make_monitor(), state(heartbeat_stamp_s=NOW_S - age_s)) == expected


@pytest.mark.parametrize("signal", ["temperature", "bus_voltage"])
def test_a_slow_signal_may_be_missing_for_a_second_and_one_that_never_came_for_ever(signal: str) -> None:
    name = "temperature_silent" if signal == "temperature" else "voltage_silent"
    for stamp_s, expected in ((NOW_S - 1.0, set()), (NOW_S - 1.001, {name}), (NEVER_S, set())):
        assert found(make_monitor(), state(**{f"{signal}_stamp_s": stamp_s})) == expected


def test_a_joint_counts_as_at_rest_a_tenth_of_a_second_after_its_last_step_of_thirty_milliradians() -> None:
    monitor = make_monitor()
    assert not found(monitor, state(closed_loop=False), energised=False, moving=False)
    moved = state(angle_rad=0.1 + 0.0301, closed_loop=False)
    ticks = [found(monitor, moved, energised=False, moving=False) for _ in range(60)]
    moving = sum({"joint_moving"} == each for each in ticks)
    assert moving in (38, 39) and all(ticks[:moving]) and not any(ticks[moving:])
    near = state(angle_rad=0.1 + 0.0301 + 0.0299, closed_loop=False)
    assert not found(monitor, near, energised=False, moving=False)


# half a step: a duration counts once the next tick would be further from its bound


def test_the_time_of_a_fast_joint_is_rounded_to_whole_ticks() -> None:
    """At 2/3 of the bound per tick, one tick and two ticks are equally far from the bound."""
    fast, nearer_s = state(velocity_rad_s=30.0), BOUNDS.fast_s * 2.0 / 3.0
    assert ticks_until("joint_velocity", fast, dt_s=nearer_s + 1e-9) == 1
    assert ticks_until("joint_velocity", fast, dt_s=nearer_s - 1e-9) == 2


def test_a_joint_at_rest_is_never_too_fast_however_long_the_tick() -> None:
    for dt_s in (2.0 * BOUNDS.fast_s, 3.0 * BOUNDS.fast_s, 1.0):
        assert not found(make_monitor(), state(), dt_s=dt_s)
        assert "joint_velocity" in found(make_monitor(), state(velocity_rad_s=30.0), dt_s=dt_s)


def test_one_tick_counts_for_thirty_milliseconds_at_most() -> None:
    missing = 0.5 / 2.0
    assert ticks_until("torque_missing", state(), torque_nm=missing, dt_s=0.03) == 4
    assert ticks_until("torque_missing", state(), torque_nm=missing, dt_s=10.0) == 4
    assert ticks_until("torque_missing", state(), torque_nm=missing, dt_s=0.02) == 6  # exactly its time is no fault


# an old current, and one that is no measurement


def winding_c(measured: DriveState, torque_nm: float = 0.0, bounds: FaultBounds = BOUNDS) -> float:
    """Return the winding's temperature after a minute."""
    monitor = make_monitor(bounds)
    for _ in range(60):
        faults_of(monitor, measured._replace(temperature_c=0.0), dt_s=1.0, torque_nm=torque_nm)
    return monitor.winding.temperature_c


def test_an_old_current_heats_no_longer_and_the_commanded_torque_does_instead() -> None:
    """A drive that is gone keeps its last current for ever."""
    bounds = FaultBounds(silence_s=0.03125)  # exact in binary
    old_s = NOW_S - bounds.silence_s
    for stamp_s, heats in ((old_s, True), (nextafter(old_s, -inf), False)):
        current = state(current_a=10.0, current_stamp_s=stamp_s)
        assert (winding_c(current, bounds=bounds) > WINDING.room_c + 20.0) == heats
    gone = state(current_a=10.0, current_stamp_s=NOW_S - 1.0)
    driven = state(current_a=0.5 / TORQUE_CONSTANT_NM_A)
    assert winding_c(gone, torque_nm=0.5) == pytest.approx(winding_c(driven))
    assert winding_c(gone) == pytest.approx(WINDING.room_c)


def test_a_current_beyond_twice_the_largest_is_no_measurement() -> None:
    most_a = 2.0 * 1.25 * CURRENT_LIMIT_A
    for sign in (-1.0, 1.0):
        assert winding_c(state(current_a=sign * nextafter(most_a, 0.0))) > WINDING.room_c + 20.0
        assert winding_c(state(current_a=sign * most_a)) == pytest.approx(WINDING.room_c)


def test_a_winding_heats_for_the_whole_time_that_a_gap_lasted() -> None:
    """Heat does not depend on the number of samples: one tick of a second heats nearly as much as a hundred short
    ticks.
    """
    long, short = make_monitor(), make_monitor()
    hot = state(current_a=10.0, temperature_c=0.0)
    faults_of(long, hot, dt_s=1.0)
    for _ in range(100):
        faults_of(short, hot, dt_s=0.01)
    assert long.winding.temperature_c == pytest.approx(short.winding.temperature_c, rel=0.02)
    assert long.winding.temperature_c > WINDING.room_c + 0.5


# silence of the current hidden by a silence of the position


def test_a_current_that_is_gone_is_reported_next_to_a_milder_fault_only() -> None:
    quiet_s, silent_s = BOUNDS.quiet_s + 1e-6, BOUNDS.silence_s + 1e-6
    for position_s, expected in (
        (0.0, {"current_silent"}),
        (quiet_s, {"drive_quiet", "current_silent"}),
        (silent_s, {"drive_silent"}),
    ):
        measured = state(angle_stamp_s=NOW_S - position_s, current_stamp_s=NOW_S - silent_s)
        assert found(make_monitor(), measured) == expected


def test_a_heat_fault_reports_the_temperature_of_the_sensor_or_of_the_winding_that_shows_it() -> None:
    """A sensor that is nearly too hot does not hide a winding that is too hot."""
    for measured_c, name, expected_c in (
        (25.0, "winding_hot", 99.0),
        (85.0, "winding_hot", 99.0),
        (96.0, "motor_hot", 96.0),
    ):
        monitor = make_monitor()
        for _ in range(60):
            monitor.winding.temperature_c = 99.0
            faults = faults_of(monitor, state(temperature_c=measured_c))
        assert [fault.name for fault in faults] == [name]
        assert dict(faults[0].values)["temperature_c"] == pytest.approx(expected_c, abs=0.01)


def test_every_fault_reports_the_values_that_it_was_found_by() -> None:
    def values(name: str, measured: DriveState, **changes: Any) -> dict[str, float | str]:
        monitor = make_monitor()
        faults = [fault for _ in range(800) for fault in faults_of(monitor, measured, **changes)]
        return dict(next(fault for fault in faults if fault.name == name).values)

    assert values("torque_missing", state(current_a=2.0), torque_nm=0.7) == {
        "measured_nm": pytest.approx(0.166),
        "commanded_nm": 0.7,
    }
    assert values("joint_current", state(current_a=-16.0)) == {"current_a": 16.0, "limit_a": 15.0}
    assert values("joint_velocity", state(velocity_rad_s=-30.0)) == {"velocity_rad_s": 30.0, "limit_rad_s": 20.0}
    stalled = values("joint_not_following", state(current_a=9.0), torque_nm=0.75)
    assert stalled == {"stalled_s": pytest.approx(2.0, abs=0.01)}
    assert values("voltage_under", state(bus_voltage_v=17.0)) == {"voltage_v": 17.0, "least_v": 18.0}
    assert values("voltage_low", state(bus_voltage_v=19.0)) == {"voltage_v": 19.0}
    assert values("joint_position", state(angle_rad=2.0)) == {
        "angle_deg": pytest.approx(114.59, abs=0.01),
        "low_deg": pytest.approx(-70.0),
        "high_deg": pytest.approx(70.0),
    }


def test_the_energy_of_a_joint_begins_again_once_torque_is_on() -> None:
    """A joint that was turned by hand without torque has another angle when the torque comes back."""
    monitor = make_monitor()
    now_s, angle_rad, turned_s = NOW_S, 0.1, 30 * PERIOD_S

    def tick(speed_rad_s: float, moving: bool) -> set[str]:
        nonlocal now_s, angle_rad
        now_s, angle_rad = now_s + PERIOD_S, angle_rad + speed_rad_s * PERIOD_S
        stamps = {"angle_stamp_s": now_s, "current_stamp_s": now_s, "heartbeat_stamp_s": now_s}
        measured = state(angle_rad=angle_rad, velocity_rad_s=speed_rad_s, temperature_stamp_s=now_s, **stamps)
        return found(monitor, measured, now_s=now_s, moving=moving, torque_nm=-0.2)

    tick(0.0, moving=True)
    for _ in range(round(turned_s / PERIOD_S)):
        tick(10.0, moving=False)
    assert angle_rad > 0.8 and not tick(0.0, moving=True) & {"joint_runaway", "joint_oscillating"}


@pytest.mark.parametrize(("moving", "expected"), [(True, True), (False, False)])
def test_a_joint_that_speeds_up_against_its_torque_is_a_runaway_while_closed_loop_is_expected(
    moving: bool, expected: bool
) -> None:
    monitor, angle_rad, faults = make_monitor(), -0.3, set()
    for number in range(40):
        speed_rad_s, now_s = 0.5 * number, NOW_S + number * PERIOD_S
        angle_rad += speed_rad_s * PERIOD_S
        stamps = {"angle_stamp_s": now_s, "current_stamp_s": now_s, "heartbeat_stamp_s": now_s}
        measured = state(angle_rad=angle_rad, velocity_rad_s=speed_rad_s, temperature_stamp_s=now_s, **stamps)
        faults |= found(monitor, measured, now_s=now_s, moving=moving, torque_nm=-0.2)
    assert ("joint_runaway" in faults) is expected
