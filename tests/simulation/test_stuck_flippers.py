"""In muds that hold the flippers the whole program recovers by itself, or stops safely if it cannot."""

from dataclasses import replace
from pathlib import Path

import pytest

from control.controller import DAMPING_S, WalkOrder
from control.modes import Mode, Request
from control.parameters.recovery_parameters import RecoveryParameters
from control.rate import PERIOD_S
from control.records import Phase
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import Recorder
from logs.replay import replay_files
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import Clay
from simulation.mud.track import Track
from tests.control.synthetic_states import NO_TORQUE
from tests.copied_robots import copy_of
from tests.recorded_events import EventRecorder

PARAMETERS = RecoveryParameters()
HASTY = RecoveryParameters(attempts=2, pause_s=0.1, attempt_s=0.6)
NEVER = RecoveryParameters(attempts=0)


def longest_s(parameters: RecoveryParameters) -> float:
    return parameters.attempts * (parameters.pause_s + parameters.attempt_s)


def mud(kilopascal: float) -> Track:
    return Track([(3.0, Clay(f"{kilopascal:g} kPa", 1e3 * kilopascal))])


def walking(
    configuration: Configuration, kilopascal: float, depth_m: float, log: Recorder | None = None
) -> tuple[Lockstep, EventRecorder]:
    recorder = EventRecorder(log)
    robot = Lockstep(configuration, mud(kilopascal), recorder=recorder)
    robot.arm()
    robot.walk(WalkOrder(depth_m, adaptive=False))
    assert until_phase(robot, Phase.INSERTION)
    return robot, recorder


def until_phase(robot: Lockstep, phase: Phase) -> bool:
    return robot.run_until(lambda: robot.loop.target.phase is phase, longest_s(PARAMETERS) + 5.0)


def released(robot: Lockstep) -> dict[str, bool]:
    """Run the ticks over which the work of the stride is spread; return whether each flipper was released."""
    assert robot.run_until(lambda: len(robot.loop.learning.strides) == 2, 5.0)
    return {stride.estimate.flipper: stride.estimate.released for stride in robot.loop.learning.strides}


@pytest.fixture(scope="module")
def held(configuration: Configuration) -> Lockstep:
    """Return a robot with short recoveries, in the first one, after the mud has hardened around its flippers."""
    robot, _ = walking(replace(configuration, recovery=HASTY), 2.6, 0.04)
    assert until_phase(robot, Phase.STANCE)
    for arm in robot.robot.plant.arms:
        arm.track = mud(40.0)
    assert until_phase(robot, Phase.RECOVERY)
    return robot


@pytest.fixture
def recovering(held: Lockstep) -> Lockstep:
    return copy_of(held)


@pytest.mark.parametrize(("kilopascal", "depth_m", "in_time"), [(0.5, 0.05, True), (4.5, 0.03, False)])
def test_in_the_muds_of_the_paper_nothing_is_recovered_and_flippers_that_come_out_in_time_are_not_waited_for(
    configuration: Configuration, kilopascal: float, depth_m: float, in_time: bool
) -> None:
    robot, recorder = walking(configuration, kilopascal, depth_m)
    assert released(robot) == {"left": True, "right": True}
    assert recorder.about("stuck") == []
    assert robot.loop.fault is None
    paper, _ = walking(replace(configuration, recovery=NEVER), kilopascal, depth_m)
    paper.run_for(robot.now_s - paper.now_s)
    first, second = (repr((each.robot.plant.angles_rad, each.loop.learning.strides)) for each in (robot, paper))
    assert (first == second) is in_time


def test_in_stiff_mud_it_frees_itself_and_a_replay_gives_the_same_strides_to_the_last_digit(
    tmp_path: Path, configuration: Configuration
) -> None:
    """Its body advances by at least half of a stride's 12 cm, and it inserts again."""
    path = tmp_path / "walk.mcap"
    log = Recorder(path, configuration.text, {"robot": "test"})
    robot, recorder = walking(configuration, 5.0, 0.05, log)
    assert until_phase(robot, Phase.RECOVERY)
    stuck_s, stuck_m = robot.now_s, robot.robot.plant.body_m
    assert until_phase(robot, Phase.SWING)
    assert robot.now_s - stuck_s < longest_s(PARAMETERS)
    assert robot.robot.plant.body_m > stuck_m + 0.06
    assert released(robot) == {"left": False, "right": False}
    assert until_phase(robot, Phase.INSERTION)
    assert robot.loop.mode is Mode.WALKING and robot.loop.fault is None
    geometry = configuration.geometry
    assert geometry.depth_m(*robot.robot.plant.angles_rad[:2]) == pytest.approx(-geometry.clearance_m, abs=0.002)
    assert log.close(20.0)
    live = [stride.estimate for stride in robot.loop.learning.strides]
    assert repr(replay_files([path]).strides) == repr(live)


def test_mud_that_never_releases_a_flipper_ends_in_a_fault_without_torque_in_bounded_time(recovering: Lockstep) -> None:
    robot, recorder = recovering, recovering.loop.recorder
    assert isinstance(recorder, EventRecorder)
    began_s = robot.now_s
    assert robot.run_until(lambda: robot.loop.mode is Mode.DAMPING, 2.0)
    assert robot.now_s - began_s == pytest.approx(longest_s(HASTY), abs=5.0 * PERIOD_S)
    assert robot.run_until(lambda: robot.loop.mode is Mode.FAULT, DAMPING_S + PERIOD_S)
    assert len(recorder.about(" stuck, attempt ")) == HASTY.attempts
    assert robot.loop.fault is not None and robot.loop.fault.name == "flipper_stuck"
    assert robot.loop.sent.torques_nm == NO_TORQUE
    robot.step()
    assert all(not drive.energised for drive in robot.robot.drives)
    assert robot.loop.request(Request.ARM, robot.now_s) is not None  # latched until an operator clears it
    assert robot.loop.request(Request.CLEAR, robot.now_s) is None
    assert robot.run_until(lambda: robot.loop.mode is Mode.IDLE, 1.0)
    robot.arm()
