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
from experiments.bench.test_rig import TestRig
from experiments.calibration.hand_steps import check_hands
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import CLEAR, LEAVE
from firmware_host.configuration.configuration import Configuration
from simulation.devices.drive import DriveError
from tests.bench.staged_bench import FAILED, PASSED, SKIPPED, BenchReport, StagedBench
from tests.control.synthetic_states import NO_TORQUE
from tests.scripted_operator import ScriptedOperator


@pytest.fixture
def rig(configuration: Configuration) -> SimulatedRig:
    return SimulatedRig(configuration)


@pytest.fixture
def bench(rig: SimulatedRig) -> StagedBench:
    return StagedBench(TestRig(rig, simulated_operator(rig)), BenchReport())


def energised(rig: SimulatedRig) -> set[bool]:
    return {drive.energised for drive in rig.robot.drives}


def test_ctrl_c_with_raised_flippers_leaves_the_drives_idle(bench: StagedBench, rig: SimulatedRig) -> None:
    with pytest.raises(KeyboardInterrupt), bench.test_rig.flippers_raised():
        assert energised(rig) == {True}
        raise KeyboardInterrupt
    assert energised(rig) == {False}


def test_force_idle_works_without_the_loop(bench: StagedBench, rig: SimulatedRig) -> None:
    bench.test_rig.arm(lambda held, states: NO_TORQUE)
    bench.test_rig.force_idle()
    rig.wait()
    assert energised(rig) == {False}


def test_a_fault_ends_a_measurement_with_its_message(bench: StagedBench, rig: SimulatedRig) -> None:
    bench.test_rig.arm(lambda held, states: NO_TORQUE)
    rig.robot.restart_drive(1)
    with pytest.raises(BenchError, match=r"left_adduction.*\."):
        bench.test_rig.run_for(1.0)


class Asked(BenchOperator):
    """Use an operator with the same answer to every fault."""

    def __init__(self, answer: str) -> None:
        operator = ScriptedOperator(answer)
        super().__init__(operator, sure=True)
        self.asked, self.clears = operator.asked, answer == CLEAR


@pytest.mark.parametrize("bench_operator", [Asked(CLEAR), Asked(LEAVE), BenchOperator()])
def test_an_earlier_fault_is_cleared_only_if_an_operator_agrees(
    rig: SimulatedRig, bench_operator: BenchOperator
) -> None:
    """No daemon may run during the bench, so 'mudskipper clear' is not available."""
    rig.robot.drives[1].trip(DriveError.WATCHDOG)
    opened_rig = TestRig(rig, bench_operator)
    if isinstance(bench_operator, Asked) and bench_operator.clears:
        opened_rig.arm(lambda held, states: NO_TORQUE)
        assert energised(rig) == {True}
    else:
        with pytest.raises(BenchError, match="cannot be armed: The left_adduction drive reports error"):
            opened_rig.arm()
        assert rig.robot.drives[1].failed
    if isinstance(bench_operator, Asked):
        (question,) = bench_operator.asked
        assert "The left_adduction drive reports error" in question


def test_a_drive_that_does_not_go_idle_is_reported(bench: StagedBench, rig: SimulatedRig) -> None:
    bench.test_rig.arm(lambda held, states: NO_TORQUE)
    for port in rig.buses["right"].ports[1:]:
        port.full = True
    drive = rig.robot.drives[3]
    zero_torque = Frame(
        codec.arbitration_id(drive.parameters.node_id, codec.SET_INPUT_TORQUE), codec.SET_INPUT_TORQUE.encode(0.0)
    )

    def feed_watchdog(rig: SimulatedRig) -> None:
        """Feed the watchdog like another program on the bus."""
        drive.receive(zero_torque, rig.now_s)

    rig.others.append(feed_watchdog)
    with pytest.raises(BenchError, match="right_adduction: still in closed loop"):
        bench.test_rig.switch_off()


def test_checks_that_need_an_operator_are_left_out_without_one(configuration: Configuration) -> None:
    opened_rig = TestRig(SimulatedRig(configuration), BenchOperator())
    readings = [(each.left_out, each.good, each.value_text) for each in check_hands(opened_rig)]
    assert readings == [(True, True, "left out")] * len(JOINTS)


@pytest.mark.parametrize("index", [0, 1])
def test_an_encoder_that_counts_against_its_motor_never_closes_a_loop(rig: SimulatedRig, index: int) -> None:
    """Feedback would be positive there: each joint's nudge ends by itself, and nothing may hold a pose after it.

    The index is that of a sweep and of an adduction.
    """
    drive, report = rig.robot.drives[index], BenchReport()
    measure = drive.measure
    drive.measure = lambda angle_rad, velocity_rad_s: measure(-angle_rad, -velocity_rad_s)  # type: ignore[method-assign]
    opened_rig = TestRig(rig, simulated_operator(rig))
    before = rig.robot.plant.angles_rad
    farthest_rad = 0.0
    for joint in JOINTS:
        test = f"test_a_tiny_torque[{joint}]"
        assert report.own_obstacle(2, test) == ""
        report.begin(2, test)
        good = all([reading.good for reading in check_nudge(opened_rig, joint)])
        report.worsen(PASSED if good else FAILED, "")
        report.end()
        moved = (abs(there - here) for here, there in zip(before, rig.robot.plant.angles_rad, strict=True))
        farthest_rad = max(farthest_rad, *moved)
    assert farthest_rad < 0.15
    assert report.own_obstacle(2, "test_eyes_see[left_sweep]") == (
        f"test_a_tiny_torque[{JOINTS[index]}] failed: fix that before anything else moves"
    )
    assert report.own_obstacle(6, "test_joints_follow_a_slow_stroke") == ""


def test_a_reading_out_of_its_bounds_fails_with_what_to_do(bench: StagedBench) -> None:
    bench.report.begin(1, "test")
    good, bad = (
        BenchReading("speed", 1.0, "m/s", 0.0, 2.0),
        BenchReading("load", 90.0, "%", 0.0, 80.0, "take strangers off"),
    )
    with pytest.raises(pytest.fail.Exception) as failure:
        bench.check(lambda opened_rig: iter([good, bad]))
    assert str(failure.value) == "load is 90 %, must be 0 to 80: take strangers off."
    bench.report.end()
    assert bench.report.as_json["tests"][0]["readings"] == [good.as_json, bad.as_json]


def report_with(*outcomes: str) -> BenchReport:
    """Return a report with one test per stage, from the first stage on."""
    report = BenchReport()
    for stage, outcome in enumerate(outcomes, 1):
        report.begin(stage, "test")
        report.worsen(outcome, "")
        report.end()
    return report


@pytest.mark.parametrize(
    ("outcomes", "obstacle"),
    [
        ((), "stage 1, wiring, was not passed in this run"),
        ((PASSED, FAILED), "stage 2, zeros, failed"),
        ((PASSED, SKIPPED), "stage 2, zeros, was not passed"),
        ((PASSED,), "stage 2, zeros, was not passed"),
        ((PASSED, PASSED), ""),
    ],
)
def test_a_stage_waits_for_all_before_it(outcomes: tuple[str, ...], obstacle: str) -> None:
    reported = report_with(*outcomes).obstacle(3)
    assert reported.startswith(obstacle) and bool(reported) == bool(obstacle)


def test_no_test_begins_after_a_drive_kept_its_torque() -> None:
    report = report_with(PASSED)
    report.keeps_torque = "left_sweep: cut the power"
    assert [report.obstacle(stage) for stage in (1, 2)] == ["left_sweep: cut the power"] * 2


@pytest.mark.parametrize("shift", [-2.0, 0.0, 1.4, 6.0])
def test_the_lag_of_a_shifted_motion_is_found(shift: float) -> None:
    ticks = np.arange(600.0)
    commanded, measured = (np.sin((ticks - late) / 20.0) + 0.3 * np.sin((ticks - late) / 7.0) for late in (0.0, shift))
    assert lag_ticks(commanded, 0.9 * measured + 0.5) == pytest.approx(shift, abs=0.05)
