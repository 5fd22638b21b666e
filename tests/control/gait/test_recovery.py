"""Recoveries of synthetic flippers, which follow their targets exactly unless the mud holds them still."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import groupby, pairwise
from math import copysign, cos, degrees, nan, radians, sin
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.controller import Controller, WalkOrder
from control.faults import FaultKind
from control.gait.joint_path import still
from control.gait.recovery import AWAY_FRACTION, Recovery, is_in_mud, lowest_point_m
from control.gait.stride_table import stride_duration_s
from control.geometry import FlipperGeometry
from control.limits import JointRange
from control.modes import Mode
from control.parameters.arm_mass import ArmMass
from control.parameters.gait_parameters import GaitParameters
from control.parameters.joint_gains import JointGains
from control.parameters.motion_parameters import MotionParameters
from control.parameters.recovery_parameters import RecoveryParameters
from control.rate import PERIOD_S
from control.records import (
    DriveState,
    DriveStates,
    GaitTarget,
    Joints,
    JointTargets,
    Phase,
    same_for_all,
    same_for_each,
)
from firmware_host.configuration.gait_file import PROTOCOLS
from tests.control.synthetic_states import states_at

DEPTH_M = 0.04
GEOMETRY, GAIT, PARAMETERS = FlipperGeometry(), GaitParameters(), RecoveryParameters()
REAR_RAD = -radians(GAIT.sweep_angle_deg)
SWEEPS, ADDUCTIONS = JointRange(radians(-60.0), radians(60.0)), JointRange(radians(-75.0), radians(45.0))
RANGES = same_for_each(SWEEPS, ADDUCTIONS)
BOTH = ("left", "right")
LONGEST_S = PARAMETERS.grace_s + PARAMETERS.attempts * (PARAMETERS.pause_s + PARAMETERS.attempt_s)


class Moment(NamedTuple):
    target: GaitTarget
    joints: JointTargets
    attempt: int
    events: str
    angles_rad: tuple[float, ...]  # measured when the targets were chosen


class SeenRecovery(Recovery):
    """A recovery that stores the targets that it gave last."""

    def step(
        self,
        dt_s: float,
        stuck: Sequence[str],
        states: DriveStates,
        wanted: JointTargets,
        at_work: Sequence[str] = (),
    ) -> JointTargets:
        self.given = super().step(dt_s, stuck, states, wanted, at_work)
        return self.given


Hold = Callable[["SyntheticRobot"], Sequence[str]]


class SyntheticRobot:
    """A robot of which the mud holds the flippers of `hold` where they are, from the extraction on."""

    def __init__(
        self,
        hold: Hold,
        parameters: RecoveryParameters = PARAMETERS,
        ranges: Joints[JointRange] = RANGES,
        gait: GaitParameters = GAIT,
    ) -> None:
        self.hold = hold
        self.recovery = SeenRecovery(parameters, GEOMETRY, gait, ranges)
        stiff = JointGains(1.0, 0.0, 1.0, 0.0)
        mass = ArmMass(arm_mass_kg=0.0)
        self.controller = Controller(gait, GEOMETRY, stiff, mass, MotionParameters(10.0, 0.0), self.recovery)
        self.controller.order = WalkOrder(DEPTH_M, adaptive=False)
        self.angles_rad = same_for_all(0.0)
        self.moments: list[Moment] = []
        self.waited_s = 0.0  # since the extraction began
        self.attempt_s = 0.0  # since the attempt under direction began

    @property
    def states(self) -> DriveStates:
        return states_at(self.angles_rad)

    def step(self, mode: Mode = Mode.WALKING) -> None:
        before_rad = self.angles_rad
        torques_nm = self.controller.step(PERIOD_S, mode, self.states)
        wanted_rad = [angle + torque for angle, torque in zip(before_rad, torques_nm, strict=True)]
        target = self.controller.target
        self._time(target.phase, self.recovery.events)
        for index, flipper in enumerate(BOTH):
            if self.waited_s and flipper in self.hold(self):
                wanted_rad[2 * index : 2 * index + 2] = before_rad[2 * index : 2 * index + 2]
        self.angles_rad = Joints(*wanted_rad)
        if target.stride >= 0:
            events, attempt = self.recovery.events, self.recovery.attempt
            self.moments.append(Moment(target, self.recovery.given, attempt, events, before_rad))

    def _time(self, phase: Phase, events: str) -> None:
        self.attempt_s = 0.0 if events else self.attempt_s + PERIOD_S
        begun = phase is Phase.EXTRACTION or (self.waited_s > 0.0 and phase in (Phase.PAUSE, Phase.RECOVERY))
        self.waited_s = self.waited_s + PERIOD_S if begun else 0.0

    def walk(self, seconds: float) -> SyntheticRobot:
        for _ in range(round(seconds / PERIOD_S)):
            self.step()
        return self

    @property
    def phases(self) -> list[Phase]:
        return [phase for phase, _ in groupby(moment.target.phase for moment in self.moments)]

    @property
    def events(self) -> list[str]:
        return [moment.events for moment in self.moments if moment.events]

    def in_attempt(self, attempt: int) -> list[Moment]:
        return [moment for moment in self.moments if moment.attempt == attempt]


def no_flipper(robot: SyntheticRobot) -> Sequence[str]:
    return ()


def both_flippers(robot: SyntheticRobot) -> Sequence[str]:
    return BOTH


@cache
def held() -> SyntheticRobot:
    """Return a robot whose flippers stayed in the mud in all attempts."""
    return SyntheticRobot(both_flippers).walk(LONGEST_S + 1.5)


@cache
def freed() -> SyntheticRobot:
    """Return a robot whose flippers came out at the second attempt."""
    return SyntheticRobot(until_attempt(2)).walk(9.0)


def until_attempt(attempt: int, flippers: Sequence[str] = BOTH, after_s: float = 1.0) -> Hold:
    """Hold the flippers until that attempt has lasted `after_s`."""

    def hold(robot: SyntheticRobot) -> Sequence[str]:
        return () if robot.recovery.attempt == attempt and robot.attempt_s > after_s else flippers

    return hold


# when there is a recovery


def test_flippers_that_follow_are_never_recovered_and_without_attempts_the_gaits_clock_does_not_wait() -> None:
    waiting, other, stuck = (
        SyntheticRobot(hold, RecoveryParameters(attempts=attempts)).walk(6.0)
        for hold, attempts in ((no_flipper, PARAMETERS.attempts), (no_flipper, 0), (both_flippers, 0))
    )
    assert Phase.RECOVERY not in waiting.phases
    assert waiting.moments == other.moments
    assert waiting.moments[-1].target.stride >= 2
    assert [moment[:2] for moment in stuck.moments] == [moment[:2] for moment in waiting.moments]
    assert not stuck.recovery.given_up


@pytest.mark.parametrize("gait", PROTOCOLS.values())
def test_a_flipper_that_comes_out_within_the_grace_is_only_waited_for(gait: GaitParameters) -> None:
    extraction_s = (DEPTH_M + GEOMETRY.clearance_m) / gait.extraction_speed_m_s + gait.pause_s
    late_s = extraction_s + PARAMETERS.grace_s - 5.0 * PERIOD_S

    def hold(robot: SyntheticRobot) -> Sequence[str]:
        return BOTH if robot.waited_s < late_s else ()

    robot = SyntheticRobot(hold, gait=gait).walk(2.0 * stride_duration_s(gait, GEOMETRY, DEPTH_M))
    assert Phase.RECOVERY not in robot.phases
    assert robot.events == []
    assert Phase.SWING in robot.phases
    assert PERIOD_S * sum(moment.target.stride == 0 for moment in robot.moments) == pytest.approx(
        stride_duration_s(gait, GEOMETRY, DEPTH_M) + late_s - extraction_s, abs=3.0 * PERIOD_S
    )


def test_a_flipper_that_stays_in_is_given_up_after_the_last_attempt_in_bounded_time() -> None:
    robot = SyntheticRobot(lambda robot: ("right",))
    while not robot.recovery.given_up:
        robot.step()
        assert robot.waited_s < LONGEST_S + 0.2
    assert robot.recovery.given_up == ("right",)
    fault = robot.controller.fault
    assert fault is not None
    assert fault == FaultKind.FLIPPER_STUCK.fault("right", attempts=3)
    assert robot.phases == [Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION, Phase.RECOVERY]
    assert robot.events == [f"the right flipper is stuck, attempt {n} of 3" for n in (1, 2, 3)]


def test_a_flipper_that_comes_out_at_the_second_attempt_swings_and_walks_on() -> None:
    assert freed().controller.fault is None
    assert freed().phases[:6] == [
        Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION, Phase.RECOVERY, Phase.SWING, Phase.INSERTION,
    ]  # fmt: skip
    assert freed().events[:3] == [
        "both flippers are stuck, attempt 1 of 3",
        "both flippers are stuck, attempt 2 of 3",
        "the flippers came out after 2 attempts",
    ]


def test_swing_begins_in_the_tick_after_the_last_flipper_is_out() -> None:
    robot = SyntheticRobot(until_attempt(1, ("left",))).walk(5.0)
    out = next(
        i
        for i, moment in enumerate(robot.moments)
        if moment.attempt and not is_in_mud(GEOMETRY, *robot.moments[i + 1].angles_rad[:2])
    )
    assert robot.moments[out].target.phase is Phase.RECOVERY
    assert robot.moments[out + 1].target.phase is Phase.SWING


def test_the_gait_does_not_wait_for_an_unknown_angle() -> None:
    """The silence of a joint is a fault of its own."""
    lost, inside = DriveState(angle_rad=nan), DriveState(angle_rad=-0.6)
    level = DriveState(angle_rad=0.0)
    recovery = Recovery(PARAMETERS, GEOMETRY, GAIT, RANGES)
    assert recovery.stuck(Joints(level, lost, level, inside)) == ("right",)
    assert recovery.stuck(Joints(lost, level, level, level)) == ()


def test_stopping_ends_a_recovery_and_forgets_it() -> None:
    robot = SyntheticRobot(both_flippers).walk(3.0)
    assert robot.recovery.attempt == 1
    robot.step(Mode.STOPPING)
    assert (robot.recovery.attempt, robot.recovery.events, robot.recovery.given_up) == (0, "", ())
    assert robot.controller.fault is None


# what it does


def attempts_at(sweep_deg: float) -> list[list[JointTargets]]:
    """Return the targets of each attempt at a left flipper that nothing moves."""
    recovery = Recovery(PARAMETERS, GEOMETRY, GAIT, RANGES)
    free, given = DriveState(angle_rad=0.0), list[list[JointTargets]]()
    states = Joints(DriveState(angle_rad=radians(sweep_deg)), DriveState(angle_rad=-0.6), free, free)
    while not recovery.given_up:
        targets = recovery.step(PERIOD_S, ("left",), states, still(Joints(REAR_RAD, 0.0, REAR_RAD, 0.0)))
        if recovery.attempt > len(given):
            given.append([])
        if recovery.attempt:
            given[-1].append(targets)
    return given


@pytest.mark.parametrize("sweep_deg", [-55.0, -30.0, -10.0, 5.0, 14.0])
def test_the_first_attempt_pulls_to_the_rear_and_the_others_away_from_the_middle(sweep_deg: float) -> None:
    """For AWAY_FRACTION of the time the targets lead in that direction; otherwise they lead in the other or change
    sides.
    """
    directions = [-1.0, *[copysign(1.0, sweep_deg)] * (PARAMETERS.attempts - 1)]
    for direction, targets in zip(directions, attempts_at(sweep_deg), strict=True):
        leads_deg = [direction * (degrees(each[0].angle_rad) - sweep_deg) for each in targets]
        pulled = leads_deg[round(PARAMETERS.pause_s / PERIOD_S) :]
        reached = max(direction * (direction * 60.0 - sweep_deg), 0.0)  # the joint's limit
        assert max(pulled) == pytest.approx(min(PARAMETERS.lead_deg, reached))
        assert min(pulled) == pytest.approx(-PARAMETERS.lead_deg)
        assert sum(lead_deg > 0.0 for lead_deg in pulled) / len(pulled) == pytest.approx(AWAY_FRACTION, abs=0.1)


def test_the_sweep_rocks_with_the_configured_period() -> None:
    targets = attempts_at(-30.0)[0]
    leads_deg = [degrees(each[0].angle_rad) + 30.0 for each in targets]
    turns = sum(before < 0.0 <= now for before, now in pairwise(leads_deg))
    assert turns == pytest.approx(PARAMETERS.attempt_s / PARAMETERS.rock_s, abs=1)


def test_a_flipper_that_is_out_stays_where_it_is() -> None:
    for targets in attempts_at(10.0):
        assert {each[2:] for each in targets} == {still(Joints(0.0, 0.0, 0.0, 0.0))[2:]}


def test_both_flippers_rock_in_the_same_direction_from_both_sides_of_the_middle() -> None:
    recovery = Recovery(PARAMETERS, GEOMETRY, GAIT, RANGES)
    down, left, right = DriveState(angle_rad=-0.6), DriveState(angle_rad=0.2), DriveState(angle_rad=-0.1)
    targets = still(Joints(0.0, 0.0, 0.0, 0.0))
    while recovery.attempt < 2 or targets[0].angle_rad == pytest.approx(left.angle_rad):
        targets = recovery.step(PERIOD_S, BOTH, Joints(left, down, right, down), still(Joints(0.0, 0.0, 0.0, 0.0)))
    lead_rad = radians(PARAMETERS.lead_deg)
    assert targets[0].angle_rad == pytest.approx(left.angle_rad + lead_rad)
    assert targets[2].angle_rad == pytest.approx(right.angle_rad + lead_rad)


@pytest.mark.parametrize("attempt", [1, 2, 3])
def test_each_attempt_begins_with_a_pause_where_the_flippers_are_and_lifts_at_the_same_speed(attempt: int) -> None:
    moments = held().in_attempt(attempt)
    for moment in moments[: round(PARAMETERS.pause_s / PERIOD_S) - 1]:
        assert [joint.angle_rad for joint in moment.joints] == pytest.approx(moments[0].angles_rad)
        assert all(joint.velocity_rad_s == 0.0 for joint in moment.joints)
    assert moments[-1].joints[1].angle_rad > moments[0].angles_rad[1]
    speeds = [abs(moment.joints[index].velocity_rad_s) for moment in moments for index in (1, 3)]
    assert max(speeds) == pytest.approx(PARAMETERS.lift_rad_s)


def test_targets_lead_their_joints_by_no_more_than_the_lead() -> None:
    leads = [
        abs(joint.angle_rad - angle_rad)
        for moment in held().moments
        if moment.attempt
        for joint, angle_rad in zip(moment.joints, moment.angles_rad, strict=True)
    ]
    assert max(leads) == pytest.approx(radians(PARAMETERS.lead_deg))


@pytest.mark.parametrize("margin_deg", [0.0, 3.0, 30.0])
def test_targets_stay_within_the_joints_limits(margin_deg: float) -> None:
    sweeps = JointRange(radians(-30.0 - margin_deg), radians(30.0 + margin_deg))
    lifts = JointRange(radians(-75.0), 0.0)
    wild = RecoveryParameters(lift_rad_s=5.0, rock_s=2.0, lead_deg=45.0)
    robot = SyntheticRobot(until_attempt(3), wild, same_for_each(sweeps, lifts)).walk(LONGEST_S + 1.0)
    assert "the flippers came out after 3 attempts" in robot.events
    for moment in robot.moments:
        for joint, span in zip(moment.joints, same_for_each(sweeps, lifts), strict=True):
            assert span.min_rad - 1e-9 <= joint.angle_rad <= span.max_rad + 1e-9


# into the swing


@pytest.mark.parametrize(("attempt", "after_s"), [(1, 0.5), (1, 2.0), (2, 1.0), (3, 0.5)])
def test_targets_and_their_velocities_are_continuous_from_recovery_through_swing(attempt: int, after_s: float) -> None:
    """Gap and swing take 130 rad/s² at most, so the mean velocity gives the angle to 0.1 mrad."""
    robot = SyntheticRobot(until_attempt(attempt, after_s=after_s)).walk(LONGEST_S + 3.0)
    begin = next(i for i, moment in enumerate(robot.moments) if moment.events.startswith("the flippers came out"))
    end = next(i for i, moment in enumerate(robot.moments) if moment.target.stride == 1)
    assert {moment.target.phase for moment in robot.moments[begin:end]} == {Phase.SWING}
    assert max(abs(joint.velocity_rad_s) for joint in robot.moments[begin - 1].joints) > 0.1
    for before, now in pairwise(robot.moments[begin - 1 : end + 20]):
        for old, new in zip(before.joints, now.joints, strict=True):
            mean_rad_s = (old.velocity_rad_s + new.velocity_rad_s) / 2.0
            assert new.angle_rad - old.angle_rad == pytest.approx(mean_rad_s * PERIOD_S, abs=1e-4)
            assert abs(new.velocity_rad_s - old.velocity_rad_s) < 130.0 * PERIOD_S


def test_the_swing_after_a_recovery_ends_where_every_swing_ends_and_is_soon_clear_of_the_mud() -> None:
    first = next(moment for moment in freed().moments if moment.target.stride == 1)
    assert first.target.phase is Phase.INSERTION
    assert first.joints == freed().controller._follow(first.target)
    swing = [moment for moment in freed().moments if moment.target[:2] == (Phase.SWING, 0)]
    assert swing
    for moment in swing[round(0.2 / PERIOD_S) :]:
        assert lowest_point_m(GEOMETRY, *moment.angles_rad[:2]) < -0.9 * GEOMETRY.clearance_m


def test_a_method_that_swings_faster_than_the_ordered_gait_begins_its_insertion_without_a_gap() -> None:
    quick, free = replace(GAIT, swing_duration_s=0.3), until_attempt(1)
    robot = SyntheticRobot(lambda robot: free(robot) if robot.controller.gait.stride else (), gait=quick)
    robot.controller.order = WalkOrder(DEPTH_M, gait=GAIT)
    robot.walk(1.0).controller.gait.next_parameters = quick
    robot.walk(7.0)
    first = next(moment for moment in robot.moments if moment.target.stride == 2)
    assert robot.events
    assert first.joints == robot.controller._follow(first.target)


# when a flipper is out


@given(st.floats(-1.0, 1.0), st.floats(-1.2, 0.5))
def test_the_lowest_point_is_the_deeper_corner(sweep_rad: float, adduction_rad: float) -> None:
    """The ends of the edge are at l ± w/2 along the arm."""
    ends_m = [
        GEOMETRY.drop_m * cos(adduction_rad) - length_m * cos(sweep_rad) * sin(adduction_rad) - GEOMETRY.axis_height_m
        for length_m in (GEOMETRY.flipper_length_m - 0.0125, GEOMETRY.flipper_length_m + 0.0125)
    ]
    assert lowest_point_m(GEOMETRY, sweep_rad, adduction_rad) == pytest.approx(max(ends_m), abs=1e-12)
