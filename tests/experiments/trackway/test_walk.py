"""Strides of a walk: where they begin and end, the names of their failures, and their sum against the plant."""

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
        (0.12, 0.01, ""),  # a flipper that comes out moves the body as much
        (0.12, 0.0101, EXTRACTION),
        (0.01, 0.08, EXTRACTION),  # the body lost its advance
    ],
)
def test_a_stride_slips_below_half_an_arm_and_fails_to_extract_when_pushed_back(
    step_m: float, pushed_back_m: float, name: str
) -> None:
    assert GOOD._replace(step_m=step_m, pushed_back_m=pushed_back_m).failure(ARM_M) == name


def test_a_stride_that_needed_a_recovery_has_failed_at_any_length() -> None:
    assert GOOD._replace(recovered=True).failure(ARM_M) == RECOVERED
    assert GOOD._replace(recovered=True, pushed_back_m=0.08).failure(ARM_M) == EXTRACTION


def test_speed_is_distance_over_time_and_not_the_mean_of_speeds() -> None:
    slow = GOOD._replace(step_m=0.03, duration_s=3.4)
    assert speed_m_s([GOOD, slow]) == pytest.approx(0.15 / 5.0)


def test_a_stride_belongs_to_the_mud_in_which_its_plates_went_down() -> None:
    soft = GOOD._replace(mud="soft")
    assert Walk([GOOD, soft, GOOD], "").in_mud("soft") == [soft]
    assert Walk([GOOD], "").in_mud("soft") == []


# the record, with a synthetic robot


class SyntheticWalk:
    """A robot whose body and phases the test sets, 0.1 s apart."""

    def __init__(self) -> None:
        target = SimpleNamespace(stride=-1, phase=Phase.REST)
        plant = SimpleNamespace(body_m=0.0, arms=[SimpleNamespace(sweep_rad=radians(30.0))])
        geometry = SimpleNamespace(flipper_length_m=ARM_M)
        self.target, self.plant = target, plant
        lockstep: Any = SimpleNamespace(
            now_s=0.0,
            robot=SimpleNamespace(plant=plant),
            loop=SimpleNamespace(
                controller=SimpleNamespace(target=target),
                configuration=SimpleNamespace(geometry=geometry),
                stride_depth_m=0.03,
            ),
        )
        self.lockstep = lockstep
        self.record = StrideRecord(lockstep, Track([(0.1, FIRM), (1.0, SOFT)]))

    def live(self, stride: int, phase: Phase, body_m: float) -> None:
        self.lockstep.now_s += 0.1
        self.target.stride, self.target.phase, self.plant.body_m = stride, phase, body_m
        self.record.update()


def test_a_stride_lasts_from_one_insertion_to_the_next() -> None:
    synthetic = SyntheticWalk()
    synthetic.live(-1, Phase.REST, 0.01)
    synthetic.live(0, Phase.INSERTION, 0.02)
    synthetic.live(0, Phase.STANCE, 0.08)
    synthetic.live(0, Phase.SWING, 0.09)
    assert synthetic.record.strides == []
    synthetic.lockstep.loop.stride_depth_m = 0.04
    synthetic.live(1, Phase.INSERTION, 0.10)
    (first,) = synthetic.record.strides
    assert first.step_m == pytest.approx(0.08)
    assert first.duration_s == pytest.approx(0.3)
    assert first.position_m == pytest.approx(0.02 + ARM_M * sin(radians(30.0)))
    assert (first.mud, first.depth_m) == ("firm", 0.03)
    synthetic.live(2, Phase.INSERTION, 0.20)
    assert (synthetic.record.strides[1].mud, synthetic.record.strides[1].depth_m) == ("soft", 0.04)


def test_only_a_loss_after_the_stance_counts_as_pushed_back() -> None:
    synthetic = SyntheticWalk()
    for phase, body_m in (
        (Phase.INSERTION, 0.00),
        (Phase.STANCE, 0.05),
        (Phase.STANCE, 0.02),  # a slip within the stance does not count
        (Phase.EXTRACTION, 0.06),
        (Phase.SWING, 0.09),
        (Phase.SWING, 0.04),
        (Phase.SWING, 0.07),
    ):
        synthetic.live(0, phase, body_m)
    synthetic.live(1, Phase.INSERTION, 0.07)
    synthetic.live(2, Phase.INSERTION, 0.08)
    assert [stride.pushed_back_m for stride in synthetic.record.strides] == [pytest.approx(0.05), 0.0]


def test_a_record_that_was_reset_has_no_strides() -> None:
    synthetic = SyntheticWalk()
    synthetic.live(0, Phase.INSERTION, 0.0)
    synthetic.live(1, Phase.INSERTION, 0.1)
    synthetic.record.reset()
    synthetic.live(5, Phase.STANCE, 0.2)  # the stride under way has no beginning
    assert synthetic.record.strides == []


# in simulation


@cache
def walked(depth_m: float, strength_pa: float, strides: int = 3) -> Walk:
    track = Track([(100.0, Clay("mud", strength_pa))])
    rule = constant_depth(depth_m)
    return walk(configuration_for(rule), track, rule.order, 1, lambda made: len(made) >= strides)


def test_a_walk_has_the_ordered_length_and_is_deterministic() -> None:
    first = walked(0.03, 3000.0)
    assert (len(first.strides), first.fault) == (3, "")
    assert walked(0.03, 3000.0, strides=1).strides == first.strides[:1]


def test_strides_join_without_gaps() -> None:
    """The next position is this one plus the step, since the arms are at the front of their sweep in both."""
    before, after = walked(0.03, 3000.0).strides[1:]
    assert after.position_m - before.position_m == pytest.approx(before.step_m, abs=0.002)  # the servo yields


def test_firm_mud_carries_soft_mud_slips_and_deep_flippers_get_stuck() -> None:
    """Both failures of the paper's section III-D."""
    names = [
        {stride.failure(ARM_M) for stride in walked(depth_m, strength_pa, strides).strides[1:]}
        for depth_m, strength_pa, strides in ((0.03, 3000.0, 3), (0.03, 500.0, 2), (0.05, 5000.0, 3))
    ]
    assert names[:2] == [{""}, {SLIPPAGE}]
    assert EXTRACTION in names[2]
