"""The loop's drives and the simulated ones, end to end: the watchdog is read back, and a restart is detected."""

from math import isnan

import pytest

from control.modes import Mode
from simulation.harness.lockstep import Lockstep, drives_of
from simulation.mud.track import paper_track
from verification.example_robot import load_example


def read_settings(walk: Lockstep, seconds: float) -> None:
    for _ in range(round(seconds * 380)):
        walk.loop.drives.request_settings(walk.now_s)
        walk.step()


def test_watchdogs_are_read_back_and_again_from_a_drive_that_restarted() -> None:
    configuration = load_example()
    walk = Lockstep(configuration, paper_track(), drives=drives_of(configuration, watchdog_s=0.025))
    assert walk.run_until(lambda: walk.loop.mode is Mode.IDLE, 2.0)
    assert all(isnan(health.watchdog_s) for health in walk.loop.drives.health)
    read_settings(walk, 1.5)
    assert [each.watchdog_s for each in walk.loop.drives.health] == pytest.approx([0.025] * 4)
    walk.robot.restart_drive(1)
    assert walk.run_until(lambda: walk.loop.drives.health[1].restarts == 1, 1.3)
    assert walk.loop.drives.health[1].firmware == "" and isnan(walk.loop.drives.health[1].watchdog_s)
    read_settings(walk, 2.0)
    assert [health.restarts for health in walk.loop.drives.health] == [0, 1, 0, 0]
    assert walk.loop.drives.health[1].watchdog_s == pytest.approx(0.025)
    assert not any(health.duplicate_id for health in walk.loop.drives.health)
