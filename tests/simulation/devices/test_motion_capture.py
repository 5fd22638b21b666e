"""Motion capture has the stated rate, latency and accuracy of the body's position."""

from math import isfinite, isnan

import numpy as np
import pytest

from control.controller import WalkOrder
from control.rate import PERIOD_S
from control.records import BodyPose
from firmware_host.configuration.configuration import Configuration
from simulation.body.plant import Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.devices.motion_capture import CameraFrame, MotionCapture, SimulatedPose
from simulation.devices.motion_capture_parameters import AT_EVERY_TICK, OF_THE_PAPER, MotionCaptureParameters
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

TRACK = Track([(1.0, MUDS["48.5"])])
EXACT = MotionCaptureParameters(rate_hz=120.0, noise_m=0.0)


def make_plant(x_m: float = 0.0, speed_m_s: float = 0.0) -> Plant:
    plant = Plant(PlantParameters(), TRACK)
    plant.body.forward_m, plant.body.forward_m_s = x_m, speed_m_s
    return plant


def frames_of(
    parameters: MotionCaptureParameters, seconds: float, speed_m_s: float = 0.0, seed: int = 1
) -> list[tuple[float, CameraFrame]]:
    """Return the arrival times and frames of a body that moves at constant speed."""
    capture, arrived = MotionCapture(parameters, seed), []
    for tick in range(round(seconds / PERIOD_S)):
        plant = make_plant(speed_m_s * tick * PERIOD_S, speed_m_s)
        arrived += [(tick * PERIOD_S, frame) for frame in capture.step(tick * PERIOD_S, plant)]
    return arrived


def test_frames_come_at_their_rate_at_any_tick_and_report_the_body_s_position() -> None:
    arrived = frames_of(EXACT, 2.0, speed_m_s=0.3)
    assert len(arrived) == 240
    assert np.diff([frame.exposed_s for _, frame in arrived]) == pytest.approx(1.0 / 120.0)
    for arrival_s, frame in arrived:
        assert -1e-9 <= arrival_s - frame.exposed_s < PERIOD_S
        assert frame.x_m == pytest.approx(0.3 * frame.exposed_s, abs=1e-12)


def test_at_a_rate_of_zero_every_tick_has_its_frame_with_noise_as_stated() -> None:
    arrived = frames_of(MotionCaptureParameters(noise_m=0.002), 10.0)
    assert [arrival_s for arrival_s, _ in arrived] == [frame.exposed_s for _, frame in arrived]
    assert len(arrived) == 3800
    assert np.std([frame.x_m for _, frame in arrived]) == pytest.approx(
        0.002, rel=0.05
    )  # standard error of 3800 draws: 1.2 %


def test_frames_arrive_late_by_the_latency_and_in_order() -> None:
    arrived = frames_of(MotionCaptureParameters(rate_hz=120.0, latency_s=0.03), 1.0)
    late_s = [arrival_s - frame.exposed_s for arrival_s, frame in arrived]
    assert 0.03 <= min(late_s) <= max(late_s) < 0.03 + 2.0 * PERIOD_S
    assert len(arrived) == pytest.approx(120 - 0.03 * 120, abs=1)


def test_drop_outs_are_bursts_of_the_stated_length_and_frequency() -> None:
    parameters = MotionCaptureParameters(rate_hz=100.0, dropouts_per_s=0.5, dropout_s=0.2)
    capture, plant = MotionCapture(parameters, 1), make_plant()
    exposed_s = [frame.exposed_s for step in range(100000) for frame in capture.step(step * 0.01, plant)]
    gaps_s = np.diff(exposed_s)
    bursts_s = gaps_s[gaps_s > 0.015] - 0.01
    seen_s = 1000.0 - bursts_s.sum()
    assert len(bursts_s) / seen_s == pytest.approx(0.5, rel=0.15)  # standard error of 450 bursts: 5 %
    assert np.mean(bursts_s) == pytest.approx(0.2 + 0.005, rel=0.15)  # plus half a frame on average


def test_noise_is_the_same_for_the_same_seed_and_disabled_noise_draws_nothing() -> None:
    assert frames_of(OF_THE_PAPER, 1.0) == frames_of(OF_THE_PAPER, 1.0) != frames_of(OF_THE_PAPER, 1.0, seed=2)
    late = frames_of(MotionCaptureParameters(rate_hz=120.0, latency_s=0.01), 1.0)
    prompt = frames_of(OF_THE_PAPER, 1.0)
    assert [frame for _, frame in late] == [frame for _, frame in prompt][: len(late)]


def test_a_camera_that_is_held_up_misses_frames_and_keeps_its_rate() -> None:
    capture, plant = MotionCapture(EXACT, 1), make_plant()
    assert len(list(capture.step(0.0, plant))) == 1
    assert len(list(capture.step(5.0, plant))) == 1
    assert list(capture.step(5.001, plant)) == []
    assert len(list(capture.step(5.009, plant))) == 1


def test_a_reset_deletes_frames_in_transit_and_restarts_the_noise() -> None:
    capture, plant = MotionCapture(MotionCaptureParameters(rate_hz=120.0, latency_s=0.01), 1), make_plant()
    first = [frame.x_m for tick in range(100) for frame in capture.step(tick * PERIOD_S, plant)]
    capture.reset()
    assert [frame.x_m for tick in range(100) for frame in capture.step(tick * PERIOD_S, plant)] == first


def test_between_frames_the_pose_repeats_and_its_stamp_is_when_it_was_read() -> None:
    plant = make_plant(speed_m_s=0.3)
    pose = SimulatedPose(plant, EXACT, 1)
    read = []
    for tick in range(380):
        plant.body.forward_m = 0.3 * tick * PERIOD_S
        read.append(pose.read(tick * PERIOD_S))
    assert len({pose.stamp_s for pose in read}) == len({pose.x_m for pose in read}) == 120
    assert all(tick * PERIOD_S - pose.stamp_s < 1.0 / 120.0 for tick, pose in enumerate(read))


def test_a_pose_that_is_lost_for_six_frames_is_none() -> None:
    plant = make_plant()
    pose = SimulatedPose(plant, MotionCaptureParameters(rate_hz=1.0, noise_m=0.0), 1)
    assert pose.read(0.0) == pose.read(0.049) == BodyPose(0.0, 0.0)
    assert isnan(pose.read(0.051).x_m)
    assert isfinite(pose.read(1.0).x_m)


def test_the_loop_gets_120_positions_a_second_from_such_cameras(configuration: Configuration) -> None:
    seen: dict[MotionCaptureParameters, set[float]] = {AT_EVERY_TICK: set(), OF_THE_PAPER: set()}
    for parameters, positions_m in seen.items():
        lockstep = Lockstep(configuration, TRACK, motion_capture=parameters)
        lockstep.arm()
        lockstep.walk(WalkOrder(0.03))
        for _ in range(380):
            lockstep.step()
            positions_m.add(lockstep.loop.body.x_m)
    assert len(seen[AT_EVERY_TICK]) == 380
    assert len(seen[OF_THE_PAPER]) in (120, 121)  # its second may begin between two frames
