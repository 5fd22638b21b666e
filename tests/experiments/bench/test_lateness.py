"""On a busy computer the bench passes a sound robot, and reports late ticks and messages with a failed check."""

from dataclasses import replace
from random import Random

import pytest

from control.modes import Request
from control.rate import PERIOD_S
from control.records import DriveState, same_for_all
from experiments.bench.lateness import LATE_S
from experiments.bench.measured_check import MOST_MEASURED, measure_check
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


class LateRig(SimulatedRig):
    """A simulated robot on a computer that is busy from `begin` on: it misses ticks, or its drives run late, at random.

    A late drive executes the waiting commands in their order and then catches up with the missed time, like the process
    that emulates drives in real time.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._missing_fraction = self._waiting_fraction = 0.0  # of ticks that begin a delay
        self._longest = self._waits = 0  # ticks
        self._random = Random()
        super().__init__(configuration)

    def begin(self, missing_fraction: float, waiting_fraction: float, longest: int, seed: int) -> None:
        self._missing_fraction, self._waiting_fraction, self._longest = missing_fraction, waiting_fraction, longest
        self._random.seed(seed)

    def wait(self) -> Tick:
        missed = self._some(self._missing_fraction)
        self._tick_number += 1 + missed
        for other in self.others:
            other(self)
        self._waits = self._waits - 1 if self._waits > 0 else self._some(self._waiting_fraction)
        if not self._waits:
            self.robot.advance(self.now_s)
        return Tick(self.now_s, missed * PERIOD_S, self._tick_number, missed)

    def _some(self, fraction: float) -> int:
        return self._random.randint(1, self._longest) if self._random.random() < fraction else 0


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


def test_a_flipper_that_sinks_during_arming_only_delays_it(configuration: Configuration) -> None:
    """It sinks from the tick in which the loop handles a request; a prompt drive reports that in the same tick."""
    requests = list[float]()

    def sink(rig: SimulatedRig) -> None:
        if hasattr(rig, "loop") and rig.loop.pending_request is Request.ARM:
            requests.append(rig.now_s)
            rig.robot.plant.arms[0].adduction_rad += 0.05 if len(requests) <= 2 else 0.0

    drives = on_blocks(configuration).drives(configuration)
    prompt = {joint: replace(each, message_delay_s=0.0) for joint, each in drives.items()}
    rig = SimulatedRig(configuration, drives=prompt, others=[sink])
    opened_rig = TestRig(rig, simulated_operator(rig))
    opened_rig.arm()
    assert len(requests) == 3
    assert all(state.closed_loop for state in opened_rig.loop.states)


def ends_of_current(opened_rig: TestRig) -> dict[str, BenchReading]:
    """Return after how many ticks no current flows, by joint."""
    readings = [each for each in check_torque_off(opened_rig) if each.what.endswith("until no current flows")]
    return {each.what.split(":")[0]: each for each in readings}


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


@pytest.mark.parametrize(
    ("missed", "age_s", "times", "late"),
    [
        (0, 0.9 * LATE_S, 1, ""),
        (3, 0.0, MOST_MEASURED, "this computer missed 3 of 4 ticks: end what else runs"),
        (0, 0.04, MOST_MEASURED, "the drives' messages were up to 40 ms old: see stage 1"),
        (3, 0.04, MOST_MEASURED, "missed 3 of 4 ticks and the drives' messages were up to 40 ms old: end what"),
    ],
)
def test_a_bad_reading_is_measured_again_if_something_was_late_and_reported_with_that(
    opened_rig: TestRig, missed: int, age_s: float, times: int, late: str
) -> None:
    states = same_for_all(DriveState(angle_stamp_s=1.0, current_stamp_s=1.0))

    def measure(opened_rig: TestRig) -> BenchReadings:
        opened_rig.lateness.update(Tick(1.0 + age_s, 0.0, 1, missed), states)
        yield BenchReading("error", 7.0, "deg", 0.0, 6.0, "check the gains")

    measured = measure_check(opened_rig, measure)
    assert len(measured.repeats) == times - 1
    reading, _, meanwhile = measured.problem.partition("\n")
    assert reading.startswith("error is 7 deg") and late in meanwhile and bool(late) == bool(meanwhile)


def test_readings_are_computed_after_torque_is_off(opened_rig: TestRig, rig: LateRig) -> None:
    """The computation takes longer than a tick, and on a slow computer longer than a drive's watchdog."""
    for _ in check_stroke(opened_rig, "fast", FAST_RAD_S, FAST_DEG):
        assert not any(drive.energised for drive in rig.robot.drives)


def test_a_pause_that_trips_the_watchdogs_is_reported_with_the_fault(opened_rig: TestRig, rig: LateRig) -> None:
    opened_rig.arm()
    rig.begin(1.0, 0.0, 400, 1)
    with pytest.raises(BenchError, match="watchdog"):
        opened_rig.run_for(1.0)
    assert opened_rig.lateness.missed


def test_a_robot_in_mud_must_go_onto_blocks(patient: Configuration, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its strides would not be in air, and the mud would need more torque than the limit."""
    monkeypatch.setattr("experiments.bench.rig.on_blocks", lambda configuration: World(track_of(["48.5"])))
    rig = SimulatedRig(patient)
    lying, *_ = (each for each in check_rest_pose(TestRig(rig, simulated_operator(rig))) if not each.good)
    assert lying.what.startswith("left flipper: edge above the axis") and "put the robot on blocks" in lying.message
