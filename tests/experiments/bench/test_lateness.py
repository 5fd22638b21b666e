"""On a busy computer the bench passes a sound robot, and reports late ticks and messages with a failed check."""

import re
from dataclasses import replace

import pytest

from control.modes import Request
from control.records import DriveState, DriveStates, same_for_all
from experiments.bench.lateness import LATE_S
from experiments.bench.measured_check import MOST_MEASURED
from experiments.bench.reading import BenchReading, BenchReadings
from experiments.bench.rest_pose_check import check_rest_pose
from experiments.bench.rig import SimulatedRig
from experiments.bench.simulated_hand import simulated_operator
from experiments.bench.stop_check import OFF_TICKS, check_torque_off
from experiments.bench.stroke_tracking import FAST_DEG, FAST_RAD_S, check_stroke
from experiments.bench.test_rig import TestRig
from experiments.robot.bench_errors import BenchError
from firmware_host.configuration.configuration import Configuration
from firmware_host.ticker import Tick
from simulation.devices.odrive.device import SimulatedOdrive
from simulation.harness.blocks import on_blocks
from simulation.harness.peer import track_of
from simulation.harness.world import World
from tests.bench.staged_bench import BenchReport, StagedBench
from tests.experiments.bench.late_rig import LateRig


@pytest.fixture
def patient(configuration: Configuration) -> Configuration:
    """Return a configuration for drives that are emulated on the same computer: late messages are no fault yet."""
    waits = {name: 0.5 for name in ("late_s", "quiet_s", "silence_s", "lag_s", "crawl_s", "fast_s")}
    return replace(configuration, faults=replace(configuration.faults, **waits, lag_fraction=1.0, jump_rad=2.0))


@pytest.fixture
def rig(patient: Configuration) -> LateRig:
    return LateRig(patient)


@pytest.fixture
def opened_rig(rig: LateRig) -> TestRig:
    return TestRig(rig, simulated_operator(rig))


def by_name(readings: BenchReadings) -> dict[str, BenchReading]:
    return {reading.what: reading for reading in readings}


class Sinking:
    """Lets a flipper sink from the tick in which the loop handles a request to arm."""

    def __init__(self, times: int) -> None:
        self._times = times
        self.requests = 0

    def __call__(self, rig: SimulatedRig) -> None:
        if not hasattr(rig, "loop") or rig.loop.pending_request is not Request.ARM:
            return
        self.requests += 1
        if self.requests <= self._times:
            rig.robot.plant.arms[0].adduction_rad += 0.05


def sinking_rig(configuration: Configuration, sinking: Sinking) -> TestRig:
    """Return a rig whose drives report a motion in the tick in which it begins."""
    drives = on_blocks(configuration).drives(configuration)
    prompt = {joint: replace(each, message_delay_s=0.0) for joint, each in drives.items()}
    rig = SimulatedRig(configuration, drives=prompt, others=[sinking])
    return TestRig(rig, simulated_operator(rig))


def test_a_flipper_that_sinks_during_arming_only_delays_it(configuration: Configuration) -> None:
    sinking = Sinking(2)
    opened_rig = sinking_rig(configuration, sinking)
    opened_rig.arm()
    assert sinking.requests == 3
    assert all(state.closed_loop for state in opened_rig.loop.states)


def ends_of_current(opened_rig: TestRig) -> dict[str, BenchReading]:
    """Return after how many ticks no current flows, by joint."""
    reported = by_name(check_torque_off(opened_rig))
    return {what.split(":")[0]: each for what, each in reported.items() if what.endswith("until no current flows")}


def test_a_drive_that_holds_its_torque_is_found_by_its_current(
    opened_rig: TestRig, rig: LateRig, briefly: None
) -> None:
    drive = rig.robot.drives[2]
    assert isinstance(drive, SimulatedOdrive)

    def keep(rig: SimulatedRig) -> None:
        """Let the drive ignore all commands from the request on, while another program feeds its watchdog."""
        if rig.loop.pending_request is Request.DISARM:
            drive.receive = lambda frame, now_s: []  # type: ignore[method-assign]
        drive._fed_s = rig.now_s

    rig.others.append(keep)
    ends = ends_of_current(opened_rig)
    kept = ends.pop("right_sweep")
    assert not kept.good and "does not obey 'idle'" in kept.message
    assert len(ends) == 3 and all(reading.value <= OFF_TICKS for reading in ends.values())


def test_a_drive_that_goes_idle_too_late_is_found_in_spite_of_missed_ticks(
    opened_rig: TestRig, rig: LateRig, briefly: None
) -> None:
    """The drive goes idle six ticks late; this computer reads three of those ticks."""
    drive, late = rig.robot.drives[2], rig
    asked: list[int] = []

    def dawdle(rig: SimulatedRig) -> None:
        if rig.loop.pending_request is Request.DISARM:
            asked.append(rig._tick_number)
            drive.receive = lambda frame, now_s: []  # type: ignore[method-assign]
            late.begin(1.0, 0.0, 1, 1)
        elif asked and rig._tick_number >= asked[0] + 6:
            drive.energised = False

    rig.others.append(dawdle)
    ends = ends_of_current(opened_rig)
    assert ends.pop("right_sweep").value >= 6 > OFF_TICKS
    assert all(reading.good for reading in ends.values())
    assert opened_rig.lateness.missed  # so the bench repeats the check


@pytest.fixture
def briefly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shorten the time for which joints are measured after torque off."""
    monkeypatch.setattr("experiments.bench.stop_check.COASTING_S", 0.15)


@pytest.fixture
def bench(opened_rig: TestRig) -> StagedBench:
    report = BenchReport()
    report.begin(6, "test")
    return StagedBench(opened_rig, report)


@pytest.mark.parametrize(
    ("missed", "age_s", "times", "message"),
    [
        (0, 0.9 * LATE_S, 1, "$"),
        (3, 0.0, MOST_MEASURED, r"\n.*Meanwhile this computer missed 3 of 4 ticks: end what else runs"),
        (0, 0.04, MOST_MEASURED, r"\n.*Meanwhile the drives' messages were up to 40 ms old: see stage 1"),
        (3, 0.04, MOST_MEASURED, r"\n.*missed 3 of 4 ticks and the drives' messages were up to 40 ms old: end what"),
    ],
)
def test_a_bad_reading_is_measured_again_if_something_was_late_and_reported_with_that(
    bench: StagedBench, missed: int, age_s: float, times: int, message: str
) -> None:
    measured = []

    def measure(opened_rig: TestRig) -> BenchReadings:
        measured.append(1)
        opened_rig.lateness.update(*late(missed, age_s))
        yield BenchReading("error", 7.0, "deg", 0.0, 6.0, "check the gains")

    with pytest.raises(pytest.fail.Exception, match=rf"error is 7 deg, .* check the gains\.{message}"):
        bench.check(measure)
    assert len(measured) == times


def late(missed: int, age_s: float) -> tuple[Tick, DriveStates]:
    state = DriveState(angle_stamp_s=1.0, current_stamp_s=1.0)
    return Tick(1.0 + age_s, 0.0, 1, missed), same_for_all(state)


def test_readings_are_computed_after_torque_is_off(opened_rig: TestRig, rig: LateRig) -> None:
    """The computation takes longer than a tick, and on a slow computer longer than a drive's watchdog."""
    for _ in check_stroke(opened_rig, "fast", FAST_RAD_S, FAST_DEG):
        assert not any(drive.energised for drive in rig.robot.drives)


def test_a_pause_that_trips_the_watchdogs_is_reported_with_the_fault(opened_rig: TestRig, rig: LateRig) -> None:
    opened_rig.arm()
    rig.begin(1.0, 0.0, 400, 1)
    with pytest.raises(BenchError, match="watchdog"):
        opened_rig.run_for(1.0)
    assert re.search(r"this computer missed \d+ of \d+ ticks", opened_rig.lateness.message)


def test_a_robot_in_mud_must_go_onto_blocks(patient: Configuration, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its strides would not be in air, and the mud would need more torque than the limit."""
    monkeypatch.setattr("experiments.bench.rig.on_blocks", lambda configuration: World(track_of(["48.5"])))
    rig = SimulatedRig(patient)
    reported = by_name(check_rest_pose(TestRig(rig, simulated_operator(rig))))
    lying = reported["left flipper: edge above the axis, at rest"]
    assert not lying.good and "put the robot on blocks" in lying.message
