"""Strides of a walk: their begin and end, the names of their failures, and those of a log compared with the plant."""

from collections.abc import Sequence
from dataclasses import replace
from math import isnan, nan
from typing import NamedTuple

import pytest

from control.controller import WalkOrder
from control.modes import Mode
from control.records import Phase
from experiments.trackway.walk import (
    EXTRACTION,
    RECOVERED,
    SLIPPAGE,
    StrideRecord,
    WalkedStride,
    WalkTick,
    logged_strides,
    speed_m_s,
    tick_of,
)
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import Recorder
from logs.files.log_reader import Log, read_log
from simulation.devices.motion_capture_parameters import MotionCaptureParameters
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import Clay
from simulation.mud.track import Track

ARM_M = 0.12
GOOD = WalkedStride("firm", 0.0, 0.03, 0.12, 1.6, 0.0)


# names of failures


@pytest.mark.parametrize(
    ("step_m", "pushed_back_m", "recovered", "name"),
    [
        (0.12, 0.0, False, ""),
        (0.06, 0.0, False, ""),  # half an arm
        (0.0599, 0.0, False, SLIPPAGE),
        (0.12, 0.01, False, ""),  # a normal extraction pushes the body back as much
        (0.12, 0.0101, False, EXTRACTION),
        (0.01, 0.08, False, EXTRACTION),  # the body lost its advance
        (0.12, 0.0, True, RECOVERED),
        (0.12, 0.08, True, EXTRACTION),
    ],
)
def test_a_stride_slips_below_half_an_arm_and_fails_to_extract_when_pushed_back(
    step_m: float, pushed_back_m: float, recovered: bool, name: str
) -> None:
    stride = GOOD._replace(step_m=step_m, pushed_back_m=pushed_back_m, recovered=recovered)
    assert stride.failure(ARM_M) == name


def test_speed_is_distance_over_time_and_not_the_mean_of_speeds() -> None:
    slow = GOOD._replace(step_m=0.03, duration_s=3.4)
    assert speed_m_s([GOOD, slow]) == pytest.approx(0.15 / 5.0)


# the record

PHASES = (Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION, Phase.SWING, Phase.INSERTION, Phase.STANCE)
STRIDES = (0, 0, 0, 0, 1, 1)
POSITIONS_M = (0.00, 0.09, 0.06, 0.08, 0.10, 0.15)  # the loss of 3 cm at the end of the stance does not count


def one_stride(
    body_m: Sequence[float], phases: Sequence[Phase] = PHASES, strides: Sequence[int] = STRIDES
) -> WalkedStride:
    """Record ticks 0.1 s apart, in which the ordered depth grows by 1 mm each; the plates are 6 cm in front."""
    record = StrideRecord(lambda position_m: "soft" if position_m > 0.05 else "firm")
    for i, (stride, phase, x_m) in enumerate(zip(strides, phases, body_m, strict=True)):
        record.update(WalkTick(0.1 * i, stride, phase, 0.03 + 0.001 * i, x_m, x_m + 0.06))
    (made,) = record.strides
    return made


def test_a_stride_lasts_from_one_insertion_to_the_next() -> None:
    made = one_stride(POSITIONS_M)
    assert (made.mud, made.recovered) == ("soft", False)
    assert made[1:6] == pytest.approx((0.06, 0.033, 0.10, 0.4, 0.0))


def test_only_a_loss_after_the_stance_counts_as_pushed_back() -> None:
    assert one_stride((0.0, 0.05, 0.02, 0.09, 0.08, 0.15), (*PHASES[:2], *PHASES[1:4], PHASES[4]),
                      (0, 0, 0, 0, 0, 1)).pushed_back_m == pytest.approx(0.01)  # fmt: skip


def test_without_a_pose_at_its_ends_a_stride_has_no_length_and_in_between_no_push_back() -> None:
    unseen = [one_stride((*POSITIONS_M[:i], nan, *POSITIONS_M[i + 1 :])) for i in (0, 4, 2)]
    assert [(each.mud, isnan(each.step_m), isnan(each.pushed_back_m)) for each in unseen] == [
        ("", True, False), ("soft", True, False), ("soft", False, True),
    ]  # fmt: skip


@pytest.mark.parametrize("strides", [(-1,) * 6, (0, 0, 0, 0, 2, 2), (0, 0, 0, 0, -1, -1)])
def test_a_stride_whose_end_is_unknown_is_left_out(strides: Sequence[int]) -> None:
    with pytest.raises(ValueError, match="not enough values"):
        one_stride(POSITIONS_M, strides=strides)


# a log against the plant

TRACK = Track([(0.3, Clay("soft", 1000.0)), (1.0, Clay("firm", 5000.0))])
DEPTHS_M = (0.03, 0.05)  # of two walks
COUNT = 3  # of each


class LoggedWalks(NamedTuple):
    log: Log
    truth: Sequence[WalkedStride]
    configuration: Configuration


def mud_at(position_m: float) -> str:
    return TRACK.ground_at(position_m).name


@pytest.fixture(scope="module")
def walks(tmp_path_factory: pytest.TempPathFactory, configuration: Configuration) -> LoggedWalks:
    """Record two walks in one log; in the second one flippers get stuck, and no swing waits for them."""
    path = tmp_path_factory.mktemp("log") / "walks.mcap"
    held = replace(configuration, recovery=replace(configuration.recovery, attempts=0))
    recorder = Recorder(path, held.text, {"robot": "test"})
    lockstep = Lockstep(held, TRACK, recorder=recorder, motion_capture=MotionCaptureParameters(noise_m=0.0))
    lockstep.arm()
    truth: list[WalkedStride] = []
    for depth_m in DEPTHS_M:
        lockstep.walk(WalkOrder(depth_m, adaptive=False, strides=COUNT))
        record = StrideRecord(mud_at)
        while lockstep.loop.mode is Mode.WALKING:
            lockstep.step()
            record.update(tick_of(lockstep))
        truth += record.strides[:COUNT]  # the tick in which the walk ends adds another record
        lockstep.run_until(lambda: lockstep.loop.mode is Mode.HOLD, 5.0)
    assert recorder.close(20.0) and recorder.dropped == 0
    return LoggedWalks(read_log(path), truth, held)


def test_the_log_gives_the_strides_that_the_plant_made(walks: LoggedWalks) -> None:
    reported = logged_strides(walks.log, walks.configuration, mud_at)
    assert len(reported) == len(walks.truth) == 2 * COUNT
    for stride, true in zip(reported, walks.truth, strict=True):
        assert (stride.mud, stride.depth_m, stride.recovered) == (true.mud, true.depth_m, true.recovered)
        assert stride.step_m == pytest.approx(true.step_m, abs=1e-9)
        assert stride.duration_s == pytest.approx(true.duration_s, abs=1e-9)
        assert stride.position_m == pytest.approx(true.position_m, abs=1e-3)  # a joint angle is 1 ms old
        assert stride.pushed_back_m == pytest.approx(true.pushed_back_m, abs=1e-9)
        assert stride.failure(ARM_M) == true.failure(ARM_M)
    first, second, *_ = walks.truth  # the arms are at the front of their sweep where strides join; the servo yields
    assert second.position_m - first.position_m == pytest.approx(first.step_m, abs=0.002)


def test_drop_outs_of_motion_capture_lose_strides_but_never_invent_one(walks: LoggedWalks) -> None:
    """Poses are missing for 0.5 s in every 2.3 s."""
    ticks = walks.log.ticks.copy()
    ticks["body_x_m"][ticks["stamp_s"] % 2.3 < 0.5] = nan
    strides = logged_strides(walks.log._replace(ticks=ticks), walks.configuration, mud_at)
    assert len(strides) == 2 * COUNT
    known = [(each, true) for each, true in zip(strides, walks.truth, strict=True) if not isnan(each.step_m)]
    assert 0 < len(known) < 2 * COUNT
    assert all(each.step_m == pytest.approx(true.step_m, abs=1e-9) for each, true in known)
