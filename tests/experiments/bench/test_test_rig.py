"""Every failure at the bench ends with idle drives and a message; readings are reported unchanged."""

import numpy as np
import pytest

from control.records import JOINTS
from drivers.can.frames import Frame
from drivers.odrive import codec
from experiments.bench.operator import BenchOperator
from experiments.bench.reading import BenchReading
from experiments.bench.rig import SimulatedRig
from experiments.bench.sign_check import check_nudge
from experiments.bench.simulated_hand import simulated_operator
from experiments.bench.stroke_tracking import lag_ticks
from experiments.bench.test_rig import TestRig, idle
from experiments.calibration.hand_steps import check_hands
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import CLEAR, LEAVE
from firmware_host.configuration.configuration import Configuration
from simulation.devices.drive import DriveError
from tests.bench.staged_bench import FAILED, PASSED, SKIPPED, BenchReport, StagedBench
from tests.scripted_operator import ScriptedOperator


@pytest.fixture
def rig(configuration: Configuration) -> SimulatedRig:
    return SimulatedRig(configuration)


@pytest.fixture
def opened_rig(rig: SimulatedRig) -> TestRig:
    return TestRig(rig, simulated_operator(rig))


def energised(rig: SimulatedRig) -> set[bool]:
    return {drive.energised for drive in rig.robot.drives}


def test_ctrl_c_with_raised_flippers_leaves_the_drives_idle(opened_rig: TestRig, rig: SimulatedRig) -> None:
    with pytest.raises(KeyboardInterrupt), opened_rig.flippers_raised():
        assert energised(rig) == {True}
        raise KeyboardInterrupt
    assert energised(rig) == {False}


def test_force_idle_works_without_the_loop(opened_rig: TestRig, rig: SimulatedRig) -> None:
    opened_rig.arm(idle)
    opened_rig.force_idle()
    rig.wait()
    assert energised(rig) == {False}


def test_a_fault_ends_a_measurement_with_its_message(opened_rig: TestRig, rig: SimulatedRig) -> None:
    opened_rig.arm(idle)
    rig.robot.restart_drive(1)
    with pytest.raises(BenchError, match=r"left_adduction.*\."):
        opened_rig.run_for(1.0)


@pytest.mark.parametrize("answers", [[CLEAR], [LEAVE], []])
def test_an_earlier_fault_is_cleared_only_if_an_operator_agrees(rig: SimulatedRig, answers: list[str]) -> None:
    """No daemon may run during the bench, so 'mudskipper clear' is not available."""
    rig.robot.drives[1].trip(DriveError.WATCHDOG)
    prompt = ScriptedOperator(*answers)
    opened_rig = TestRig(rig, BenchOperator(prompt if answers else None, sure=True))
    if answers == [CLEAR]:
        opened_rig.arm(idle)
        assert energised(rig) == {True}
    else:
        with pytest.raises(BenchError, match="cannot be armed: The left_adduction drive reports error"):
            opened_rig.arm()
        assert rig.robot.drives[1].failed
    assert ["The left_adduction drive reports error" in question for question in prompt.asked] == [True] * len(answers)


@pytest.mark.parametrize(("answer", "consents"), [("", True), ("n", False)])
def test_nothing_moves_without_permission(answer: str, consents: bool) -> None:
    prompt = ScriptedOperator(answer)
    assert BenchOperator(prompt).allows_motion("It moves.", lambda: None) is consents
    assert prompt.asked == ["It moves."]


def test_a_drive_that_does_not_go_idle_is_reported(opened_rig: TestRig, rig: SimulatedRig) -> None:
    opened_rig.arm(idle)
    for port in rig.buses["right"].ports[1:]:
        port.full = True
    drive = rig.robot.drives[3]
    torque, node_id = codec.SET_INPUT_TORQUE, drive.parameters.node_id
    zero = Frame(codec.arbitration_id(node_id, torque), torque.encode(0.0))

    def feed_watchdog(rig: SimulatedRig) -> None:
        """Feed the watchdog like another program on the bus."""
        drive.receive(zero, rig.now_s)

    rig.others.append(feed_watchdog)
    with pytest.raises(BenchError, match="right_adduction: still in closed loop"):
        opened_rig.switch_off()


def test_checks_that_need_an_operator_are_left_out_without_one(rig: SimulatedRig) -> None:
    readings = [(each.left_out, each.good, each.value_text) for each in check_hands(TestRig(rig, BenchOperator()))]
    assert readings == [(True, True, "left out")] * len(JOINTS)


@pytest.mark.parametrize("index", [0, 1])
def test_an_encoder_that_counts_against_its_motor_never_closes_a_loop(
    opened_rig: TestRig, rig: SimulatedRig, index: int
) -> None:
    """Feedback would be positive there: each joint's nudge ends by itself, and nothing may hold a pose after it.

    The index is that of a sweep and of an adduction.
    """
    drive, report = rig.robot.drives[index], BenchReport()
    measure, before_rad = drive.measure, np.array(rig.robot.plant.angles_rad)
    drive.measure = lambda angle_rad, velocity_rad_s: measure(-angle_rad, -velocity_rad_s)  # type: ignore[method-assign]
    for joint in JOINTS:
        test = f"test_a_tiny_torque[{joint}]"
        assert report.own_obstacle(2, test) == ""
        good = all([reading.good for reading in check_nudge(opened_rig, joint)])
        report_of(report, 2, test, PASSED if good else FAILED)
        assert np.abs(rig.robot.plant.angles_rad - before_rad).max() < 0.15
    assert f"[{JOINTS[index]}] failed" in report.own_obstacle(2, "test_eyes_see[left_sweep]")
    assert report.own_obstacle(6, "test_joints_follow_a_slow_stroke") == ""


# the report of the stages


def report_of(report: BenchReport, stage: int, test: str, outcome: str) -> None:
    """Add a test with this outcome."""
    report.begin(stage, test)
    report.worsen(outcome, "")
    report.end()


def test_a_reading_out_of_its_bounds_fails_with_what_to_do(opened_rig: TestRig) -> None:
    good = BenchReading("speed", 1.0, "m/s", 0.0, 2.0)
    bad = BenchReading("load", 90.0, "%", 0.0, 80.0, "take strangers off")
    bench = StagedBench(opened_rig, BenchReport())
    bench.report.begin(1, "test")
    with pytest.raises(pytest.fail.Exception, match="^load is 90 %, must be 0 to 80: take strangers off.$"):
        bench.check(lambda opened_rig: iter([good, bad]))
    bench.report.end()
    assert bench.report.as_json["tests"][0]["readings"] == [good.as_json, bad.as_json]


@pytest.mark.parametrize(
    ("outcomes", "obstacle"),
    [
        ((), "stage 1, wiring, was not passed in this run"),
        ((PASSED, FAILED), "stage 2, zeros, failed"),
        ((PASSED, SKIPPED), "stage 2, zeros, was not passed"),
        ((PASSED, PASSED), ""),
    ],
)
def test_a_stage_waits_for_all_before_it_and_for_drives_that_kept_their_torque(
    outcomes: tuple[str, ...], obstacle: str
) -> None:
    report = BenchReport()
    for stage, outcome in enumerate(outcomes, 1):
        report_of(report, stage, "test", outcome)
    assert report.obstacle(3).startswith(obstacle) and bool(report.obstacle(3)) == bool(obstacle)
    report.keeps_torque = "left_sweep: cut the power"
    assert {report.obstacle(stage) for stage in (1, 2, 3)} == {report.keeps_torque}


@pytest.mark.parametrize("shift", [-2.0, 0.0, 1.4, 6.0])
def test_the_lag_of_a_shifted_motion_is_found(shift: float) -> None:
    ticks = np.arange(600.0)
    commanded, measured = (np.sin((ticks - late) / 20.0) + 0.3 * np.sin((ticks - late) / 7.0) for late in (0.0, shift))
    assert lag_ticks(commanded, 0.9 * measured + 0.5) == pytest.approx(shift, abs=0.05)
