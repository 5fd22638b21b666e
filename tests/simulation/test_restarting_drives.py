"""The loop's drives and the simulated ones, end to end: the watchdog is read back, and a restart is detected."""

from math import isnan

import pytest

from control.modes import Mode
from simulation.harness.lockstep import Lockstep, drives_of
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from verification.example_robot import load_example


def make_walk(**changes: float) -> Lockstep:
    configuration = load_example()
    return Lockstep(configuration, Track([(1.0, MUDS["48.5"])]), drives=drives_of(configuration, **changes))


def read_settings(walk: Lockstep, seconds: float) -> None:
    for _ in range(round(seconds * 380)):
        walk.loop.drives.request_settings(walk.now_s)
        walk.step()


@pytest.mark.parametrize("watchdog_s", [0.1, 0.025, 0.0])
def test_the_watchdogs_of_all_drives_are_read_back_within_a_second_and_a_half(watchdog_s: float) -> None:
    walk = make_walk(watchdog_s=watchdog_s)
    assert walk.run_until(lambda: walk.loop.mode is Mode.IDLE, 2.0)
    assert all(isnan(health.watchdog_s) for health in walk.loop.drives.health)
    read_settings(walk, 1.5)
    assert [health.watchdog_s for health in walk.loop.drives.health] == [pytest.approx(watchdog_s)] * 4


def test_a_restarted_drive_is_noticed_and_its_settings_are_read_again() -> None:
    walk = make_walk()
    read_settings(walk, 1.5)
    assert [health.restarts for health in walk.loop.drives.health] == [0, 0, 0, 0]
    walk.robot.restart_drive(1)
    assert walk.run_until(lambda: walk.loop.drives.health[1].restarts == 1, 1.3)
    assert walk.loop.drives.health[1].firmware == ""
    assert isnan(walk.loop.drives.health[1].watchdog_s)
    read_settings(walk, 2.0)
    assert [health.restarts for health in walk.loop.drives.health] == [0, 1, 0, 0]
    assert walk.loop.drives.health[1].watchdog_s == pytest.approx(0.1)
    assert not any(health.duplicate_id for health in walk.loop.drives.health)
