"""The bench with drives that can only be asked by a command: watchdogs are measured without asking in between."""

from typing import Any

import pytest

from experiments.bench.operator import BenchOperator
from experiments.bench.reading import BenchReading
from experiments.bench.rig import SimulatedRig
from experiments.bench.simulated_hand import simulated_operator
from experiments.bench.stop_check import check_damping
from experiments.bench.stroke_tracking import FAST_DEG, FAST_RAD_S, check_stroke
from experiments.bench.test_rig import TestRig
from experiments.bench.watchdog_check import check_watchdog_times, check_what_feeds_watchdogs
from experiments.bench.wiring_check import check_firmware, check_watchdogs
from experiments.robot.bench_errors import BenchError
from experiments.robot.lockstep_robot import simulated_configuration
from simulation.harness.lockstep import drives_of

DAMIAO, CUBEMARS, ROBSTRIDE = "mit", "mit:AK80-9", "mit:RS05"


def rig_of(drive: str, **changes: Any) -> TestRig:
    configuration = simulated_configuration(drive_type=drive)
    rig = SimulatedRig(configuration, drives=drives_of(configuration, **changes))
    return TestRig(rig, simulated_operator(rig))


def wrong(readings: list[BenchReading]) -> list[str]:
    return [reading.what for reading in readings if not reading.good]


@pytest.mark.parametrize("drive", [DAMIAO, CUBEMARS, ROBSTRIDE])
def test_watchdogs_that_cannot_be_observed_are_measured(drive: str) -> None:
    rig = rig_of(drive)
    readings = [*check_firmware(rig), *check_watchdogs(rig), *check_watchdog_times(rig)]
    assert wrong(readings) == []
    measured = [reading.what for reading in readings if "its current" in reading.what and not reading.left_out]
    assert measured and all("adduction" in what for what in measured)
    left_out = {reading.what.partition(":")[0] for reading in readings if reading.left_out}
    assert left_out == (set() if drive == DAMIAO else set(rig.configuration.rig.joints))


@pytest.mark.parametrize("drive", [DAMIAO, CUBEMARS, ROBSTRIDE])
def test_a_watchdog_that_is_off_is_found(drive: str) -> None:
    rig = rig_of(drive, watchdog_s=0.0)
    if drive == DAMIAO:  # stage 1 ends the bench
        assert len(wrong(list(check_watchdogs(rig)))) == 4
    else:
        assert wrong(list(check_watchdog_times(rig))) == [
            "left_adduction: part of its current 0.31 s after the last command",
            "right_adduction: part of its current 0.31 s after the last command",
        ]


def test_other_frames_that_feed_a_watchdog_are_found() -> None:
    found = wrong(list(check_what_feeds_watchdogs(rig_of(DAMIAO, any_frame_feeds=True))))
    assert {what.partition(" among ")[2] for what in found} == {
        "answers of another drive",
        "questions for another drive's registers",
    }


def test_drives_whose_watchdog_cannot_be_read_are_armed_only_where_an_operator_allows_it() -> None:
    rig = rig_of(CUBEMARS)
    rig.operator = BenchOperator()
    with pytest.raises(BenchError, match="no watchdog can be read; stage 5 measures"):
        rig.arm()
    assert not any(drive.energised for drive in rig.rig.robot.drives)  # type: ignore[union-attr]


@pytest.mark.parametrize("drive", [DAMIAO, "moteus"])
def test_damping_brakes_a_fast_sweep_of_drives_whose_answers_are_a_tick_old(drive: str) -> None:
    assert wrong(list(check_damping(rig_of(drive)))) == []


@pytest.mark.parametrize("drive", ["odrive", "odrive05", "moteus", DAMIAO, CUBEMARS, ROBSTRIDE])
def test_a_stroke_finds_a_velocity_of_the_angle_s_scale_right(drive: str) -> None:
    readings = [each for each in check_stroke(rig_of(drive), "fast", FAST_RAD_S, FAST_DEG) if "slope" in each.what]
    assert len(readings) == 4 and not wrong(readings)


@pytest.mark.parametrize(("drive", "range_rad_s"), [(CUBEMARS, 25.64), ("mit:AK60-6", 50.0)])  # of a V2, of a V1
def test_a_velocity_of_another_scale_is_found_before_a_stroke_ends(drive: str, range_rad_s: float) -> None:
    with pytest.raises(BenchError, match="speed_wrong|encoder_slips"):
        list(check_stroke(rig_of(drive, velocity_range_rad_s=range_rad_s), "fast", FAST_RAD_S, FAST_DEG))
