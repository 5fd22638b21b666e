"""Strides of a walk: how they are told apart and named, and that they add up to what the plant did."""

from __future__ import annotations

from functools import cache
from math import radians, sin
from types import SimpleNamespace
from typing import Any

import pytest

from control.records import Phase
from experiments.trackway.depth_rule import configuration_for, constant_depth
from experiments.trackway.walk import EXTRACTION, RECOVERED, SLIPPAGE, StrideRecord, Walk, WalkedStride, speed_m_s, walk
from simulation.mud.clay import Clay
from simulation.mud.track import Track

ARM_M = 0.12
FIRM, SOFT = Clay("firm", 3000.0), Clay("soft", 700.0)
GOOD = WalkedStride("firm", 0.0, 0.03, 0.12, 1.6, 0.0)


# names of failures


@pytest.mark.parametrize(
    ("step_m", "pushed_back_m", "name"),
    [
        (0.12, 0.0, ""),
        (0.06, 0.0, ""),  # half an arm
        (0.0599, 0.0, SLIPPAGE),
        (-0.01, 0.0, SLIPPAGE),
        (0.12, 0.01, ""),  # what a flipper that comes out moves
        (0.12, 0.0101, EXTRACTION),
        (0.01, 0.08, EXTRACTION),  # it lost the way that it had made
    ],
)
def test_a_stride_slips_below_half_an_arm_and_is_held_when_pushed_back(
    step_m: float, pushed_back_m: float, name: str
) -> None:
    assert GOOD._replace(step_m=step_m, pushed_back_m=pushed_back_m).failure(ARM_M) == name


def test_a_stride_that_needed_a_recovery_has_failed_however_far_it_came() -> None:
    assert GOOD._replace(recovered=True).failure(ARM_M) == RECOVERED
    assert GOOD._replace(recovered=True, pushed_back_m=0.08).failure(ARM_M) == EXTRACTION


def test_speed_is_the_way_over_the_time_not_the_mean_of_speeds() -> None:
    slow = GOOD._replace(step_m=0.03, duration_s=3.4)
    assert speed_m_s([GOOD, slow]) == pytest.approx(0.15 / 5.0)


def test_strides_of_a_mud_are_those_whose_plates_went_into_it() -> None:
    soft = GOOD._replace(mud="soft")
    assert Walk([GOOD, soft, GOOD], "").in_mud("soft") == [soft]
    assert Walk([GOOD], "").in_mud("soft") == []


# the record, with a made-up robot


class MadeUpWalk:
    """A robot whose body and phases are told, 0.1 s apart."""

    def __init__(self) -> None:
        target = SimpleNamespace(stride=-1, phase=Phase.REST)
        plant = SimpleNamespace(body_m=0.0, arms=[SimpleNamespace(sweep_rad=radians(30.0))])
        gait = SimpleNamespace(commanded_depth_m=0.03)
        geometry = SimpleNamespace(flipper_length_m=ARM_M)
        self.target, self.plant, self.gait = target, plant, gait
        lockstep: Any = SimpleNamespace(
            now_s=0.0,
            robot=SimpleNamespace(plant=plant),
            loop=SimpleNamespace(
                controller=SimpleNamespace(target=target, gait=gait), configuration=SimpleNamespace(geometry=geometry)
            ),
        )
        self.lockstep = lockstep
        self.record = StrideRecord(lockstep, Track([(0.1, FIRM), (1.0, SOFT)]))

    def live(self, stride: int, phase: Phase, body_m: float) -> None:
        self.lockstep.now_s += 0.1
        self.target.stride, self.target.phase, self.plant.body_m = stride, phase, body_m
        self.record.look()


def test_a_stride_lasts_from_one_insertion_to_the_next() -> None:
    made_up = MadeUpWalk()
    made_up.live(-1, Phase.REST, 0.01)
    made_up.live(0, Phase.INSERTION, 0.02)
    made_up.live(0, Phase.STANCE, 0.08)
    made_up.live(0, Phase.SWING, 0.09)
    assert made_up.record.strides == []
    made_up.gait.commanded_depth_m = 0.04
    made_up.live(1, Phase.INSERTION, 0.10)
    (first,) = made_up.record.strides
    assert first.step_m == pytest.approx(0.08)
    assert first.duration_s == pytest.approx(0.3)
    assert first.position_m == pytest.approx(0.02 + ARM_M * sin(radians(30.0)))
    assert (first.mud, first.depth_m) == ("firm", 0.03)
    made_up.live(2, Phase.INSERTION, 0.20)
    assert (made_up.record.strides[1].mud, made_up.record.strides[1].depth_m) == ("soft", 0.04)


def test_only_what_is_lost_after_the_stance_is_pushed_back() -> None:
    made_up = MadeUpWalk()
    for phase, body_m in (
        (Phase.INSERTION, 0.00),
        (Phase.STANCE, 0.05),
        (Phase.STANCE, 0.02),  # a slip within the stance is none
        (Phase.EXTRACTION, 0.06),
        (Phase.SWING, 0.09),
        (Phase.SWING, 0.04),
        (Phase.SWING, 0.07),
    ):
        made_up.live(0, phase, body_m)
    made_up.live(1, Phase.INSERTION, 0.07)
    made_up.live(2, Phase.INSERTION, 0.08)
    assert [stride.pushed_back_m for stride in made_up.record.strides] == [pytest.approx(0.05), 0.0]


def test_a_record_that_was_reset_has_no_strides() -> None:
    made_up = MadeUpWalk()
    made_up.live(0, Phase.INSERTION, 0.0)
    made_up.live(1, Phase.INSERTION, 0.1)
    made_up.record.reset()
    made_up.live(5, Phase.STANCE, 0.2)  # the stride under way has no beginning
    assert made_up.record.strides == []


# for real


@cache
def walked(depth_m: float, strength_pa: float, strides: int = 3) -> Walk:
    track = Track([(100.0, Clay("mud", strength_pa))])
    rule = constant_depth(depth_m)
    return walk(configuration_for(rule), track, rule.order, 1, lambda reported: len(reported) >= strides)


def test_a_walk_is_as_long_as_it_was_asked_to_be_and_deterministic() -> None:
    first = walked(0.03, 3000.0)
    assert (len(first.strides), first.fault) == (3, "")
    walked.cache_clear()
    assert walked(0.03, 3000.0) == first


def test_strides_join_without_gaps() -> None:
    """The next place is this one and the step: the arms stand at the front of their sweep in both."""
    before, after = walked(0.03, 3000.0).strides[1:]
    assert after.position_m - before.position_m == pytest.approx(before.step_m, abs=0.002)  # the servo's give


def test_firm_mud_carries_soft_mud_slips_and_deep_flippers_are_held() -> None:
    """Both failures of the paper's section III-D."""
    names = [
        {stride.failure(ARM_M) for stride in walked(depth_m, strength_pa).strides[1:]}
        for depth_m, strength_pa in ((0.03, 2800.0), (0.03, 500.0), (0.05, 5000.0))
    ]
    assert names[:2] == [{""}, {SLIPPAGE}]
    assert EXTRACTION in names[2]
