"""The strides of a walk read back from its log, compared with the plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isnan, nan
from typing import NamedTuple

import numpy as np
import pytest

from control.controller import WalkOrder
from control.modes import Mode
from control.records import Phase
from experiments.trackway.log_strides import walked_strides
from experiments.trackway.walk import EXTRACTION, RECOVERED, StrideRecord, WalkedStride
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import Recorder
from firmware_host.log_reading.log_reader import Log, read_log
from firmware_host.log_reading.tick_array import tick_type
from simulation.devices.motion_capture import MotionCaptureParameters
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import Clay
from simulation.mud.track import Track

TRACK = Track([(0.3, Clay("soft", 1000.0)), (1.0, Clay("firm", 5000.0))])
ARM_M = 0.12
DEPTHS_M = (0.03, 0.05)  # of two walks
COUNT = 3  # of each


class LoggedWalks(NamedTuple):
    log: Log
    truth: Sequence[WalkedStride]
    configuration: Configuration


def mud_at(position_m: float) -> str:
    return TRACK.clay_at(position_m).name


@pytest.fixture(scope="module")
def walks(tmp_path_factory: pytest.TempPathFactory, configuration: Configuration) -> LoggedWalks:
    """Two walks one after the other, in one log; in the second one flippers get stuck, and no swing waits for them."""
    path = tmp_path_factory.mktemp("log") / "walks.mcap"
    held = replace(configuration, recovery=replace(configuration.recovery, attempts=0))
    recorder = Recorder(path, held.text, {"robot": "test"})
    lockstep = Lockstep(held, TRACK, recorder=recorder, motion_capture=MotionCaptureParameters(noise_m=0.0))
    lockstep.arm()
    truth: list[WalkedStride] = []
    for depth_m in DEPTHS_M:
        lockstep.walk(WalkOrder(depth_m, adaptive=False, strides=COUNT))
        record = StrideRecord(lockstep, TRACK)
        while lockstep.loop.mode is Mode.WALKING:
            lockstep.step()
            record.update()
        truth += record.strides[:COUNT]  # the next is the tick in which the walk ended
        lockstep.run_until(lambda: lockstep.loop.mode is Mode.HOLD, 5.0)
    assert recorder.close(20.0) and recorder.dropped == 0
    return LoggedWalks(read_log(path), truth, held)


def test_the_log_gives_the_strides_that_the_plant_made(walks: LoggedWalks) -> None:
    reported = walked_strides(walks.log, walks.configuration, mud_at)
    assert len(reported) == len(walks.truth) == 2 * COUNT
    for stride, true in zip(reported, walks.truth, strict=True):
        assert (stride.mud, stride.depth_m, stride.recovered) == (true.mud, true.depth_m, true.recovered)
        assert stride.step_m == pytest.approx(true.step_m, abs=1e-9)
        assert stride.duration_s == pytest.approx(true.duration_s, abs=1e-9)
        assert stride.position_m == pytest.approx(true.position_m, abs=1e-3)  # a joint angle is 1 ms old
        assert stride.pushed_back_m == pytest.approx(true.pushed_back_m, abs=1e-9)
        assert stride.failure(ARM_M) == true.failure(ARM_M)


def test_the_walks_have_both_muds_and_both_depths_and_a_failure(walks: LoggedWalks) -> None:
    """Or the comparison says nothing."""
    assert {stride.mud for stride in walks.truth} == {"soft", "firm"}
    assert EXTRACTION in {stride.failure(ARM_M) for stride in walks.truth}
    assert {stride.depth_m for stride in walks.truth} == set(DEPTHS_M)


def synthetic_log(strides: Sequence[int], phases: Sequence[Phase], body_m: Sequence[float], mode: Mode) -> Log:
    """A tick every 0.1 s; as in a log, `strides` and `phases` are those of the tick before."""
    ticks = np.zeros(len(strides), dtype=tick_type())
    ticks["stamp_s"], ticks["mode"] = 0.1 * np.arange(len(strides)), mode
    ticks["stride"], ticks["phase"], ticks["body_x_m"], ticks["stride_depth_m"] = strides, phases, body_m, 0.03
    return Log({}, "", ticks, [], [], True)


PHASES = (Phase.REST, Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION, Phase.SWING, Phase.INSERTION, Phase.STANCE)
STRIDES = (-1, 0, 0, 0, 0, 1, 1)
POSITIONS_M = (0.00, 0.02, 0.11, 0.08, 0.10, 0.11, 0.15)  # of the same ticks


def one_stride(configuration: Configuration, body_m: Sequence[float], mode: Mode = Mode.WALKING) -> WalkedStride:
    (stride,) = walked_strides(synthetic_log(STRIDES, PHASES, body_m, mode), configuration, lambda position_m: "mud")
    return stride


def test_a_stride_goes_from_one_insertion_to_the_next(configuration: Configuration) -> None:
    """A row names the target of the tick before it: the insertions begin in the first and in the fifth row."""
    stride = one_stride(configuration, POSITIONS_M)
    assert (stride.mud, stride.position_m, stride.depth_m, stride.recovered) == ("mud", 0.0, 0.03, False)
    assert (stride.step_m, stride.duration_s, stride.pushed_back_m) == pytest.approx((0.10, 0.4, 0.03))


def test_a_stride_without_a_pose_at_its_ends_has_no_length_and_no_mud(configuration: Configuration) -> None:
    unseen = one_stride(configuration, (nan, *POSITIONS_M[1:]))
    assert isnan(unseen.step_m) and isnan(unseen.position_m) and unseen.mud == ""
    assert unseen.pushed_back_m == pytest.approx(0.03)
    unseen = one_stride(configuration, (*POSITIONS_M[:4], nan, *POSITIONS_M[5:]))
    assert isnan(unseen.step_m) and unseen.mud == "mud"


def test_a_push_back_during_lost_poses_is_unknown(configuration: Configuration) -> None:
    unseen = one_stride(configuration, (*POSITIONS_M[:3], nan, *POSITIONS_M[4:]))
    assert isnan(unseen.pushed_back_m) and unseen.step_m == pytest.approx(0.10)


def test_a_log_without_walking_has_no_strides(configuration: Configuration) -> None:
    assert walked_strides(synthetic_log(STRIDES, PHASES, POSITIONS_M, Mode.HOLD), configuration, mud_at) == []
    assert walked_strides(synthetic_log((), (), (), Mode.HOLD), configuration, mud_at) == []


def test_a_stride_whose_end_was_lost_is_left_out(configuration: Configuration) -> None:
    log = synthetic_log((-1, 0, 0, 0, 0, 2, 2), PHASES, POSITIONS_M, Mode.WALKING)
    assert walked_strides(log, configuration, mud_at) == []


def test_a_recovery_is_reported(configuration: Configuration) -> None:
    phases = (*PHASES[:4], Phase.RECOVERY, *PHASES[5:])
    (stride,) = walked_strides(synthetic_log(STRIDES, phases, POSITIONS_M, Mode.WALKING), configuration, mud_at)
    assert stride.recovered and stride.failure(ARM_M) in (RECOVERED, EXTRACTION)


def test_drop_outs_of_motion_capture_lose_strides_but_never_invent_one(walks: LoggedWalks) -> None:
    """Poses are missing for 0.5 s in every 2.3 s."""
    ticks = walks.log.ticks.copy()
    ticks["body_x_m"][ticks["stamp_s"] % 2.3 < 0.5] = nan
    strides = walked_strides(walks.log._replace(ticks=ticks), walks.configuration, mud_at)
    assert len(strides) == 2 * COUNT
    known = [(each, true) for each, true in zip(strides, walks.truth, strict=True) if not isnan(each.step_m)]
    assert 0 < len(known) < 2 * COUNT
    assert all(each.step_m == pytest.approx(true.step_m, abs=1e-9) for each, true in known)
