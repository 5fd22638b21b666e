"""Motion capture has the stated rate, latency and accuracy of the body's position."""

import numpy as np
import pytest

from control.rate import PERIOD_S
from simulation.body.plant import Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.devices.motion_capture import CameraFrame, MotionCapture
from simulation.devices.motion_capture_parameters import OF_THE_PAPER, MotionCaptureParameters
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

TRACK = Track([(1.0, MUDS["48.5"])])
EXACT = MotionCaptureParameters(rate_hz=120.0, noise_m=0.0)
SPEED_M_S = 0.3


@pytest.fixture
def plant() -> Plant:
    return Plant(PlantParameters(), TRACK)


def frames_of(
    capture: MotionCapture, plant: Plant, ticks: int, period_s: float = PERIOD_S
) -> list[tuple[float, CameraFrame]]:
    """Return the arrival times and frames of a body that moves at constant speed."""
    arrived = []
    for now_s in (tick * period_s for tick in range(ticks)):
        plant.body.forward_m, plant.body.forward_m_s = SPEED_M_S * now_s, SPEED_M_S
        arrived += [(now_s, frame) for frame in capture.step(now_s, plant)]
    return arrived


def test_frames_come_at_their_rate_at_any_tick_and_report_the_body_s_position(plant: Plant) -> None:
    arrived = frames_of(MotionCapture(EXACT, 1), plant, 760)
    assert len(arrived) == 240
    assert np.diff([frame.exposed_s for _, frame in arrived]) == pytest.approx(1.0 / 120.0)
    for arrival_s, frame in arrived:
        assert -1e-9 <= arrival_s - frame.exposed_s < PERIOD_S
        assert frame.x_m == pytest.approx(SPEED_M_S * frame.exposed_s, abs=1e-12)


def test_frames_arrive_late_by_the_latency_and_in_order_with_the_same_noise(plant: Plant) -> None:
    late = frames_of(MotionCapture(MotionCaptureParameters(rate_hz=120.0, latency_s=0.03), 1), plant, 380)
    late_s = [arrival_s - frame.exposed_s for arrival_s, frame in late]
    assert 0.03 <= min(late_s) <= max(late_s) < 0.03 + 2.0 * PERIOD_S
    assert len(late) == pytest.approx(120 - 0.03 * 120, abs=1)
    prompt, other = (frames_of(MotionCapture(OF_THE_PAPER, seed), plant, 380) for seed in (1, 2))
    assert [frame for _, frame in late] == [frame for _, frame in prompt][: len(late)]
    assert prompt != other


def test_drop_outs_are_bursts_of_the_stated_length_and_frequency(plant: Plant) -> None:
    parameters = MotionCaptureParameters(rate_hz=100.0, dropouts_per_s=0.5, dropout_s=0.2)
    arrived = frames_of(MotionCapture(parameters, 1), plant, 100000, 0.01)
    gaps_s = np.diff([frame.exposed_s for _, frame in arrived])
    bursts_s = gaps_s[gaps_s > 0.015] - 0.01
    assert len(bursts_s) / (1000.0 - bursts_s.sum()) == pytest.approx(0.5, rel=0.15)  # standard error of 450: 5 %
    assert np.mean(bursts_s) == pytest.approx(0.2 + 0.005, rel=0.15)  # plus half a frame on average


def test_a_camera_that_is_held_up_misses_frames_and_keeps_its_rate(plant: Plant) -> None:
    capture = MotionCapture(EXACT, 1)
    counts = [len(list(capture.step(now_s, plant))) for now_s in (0.0, 5.0, 5.001, 5.009)]
    assert counts == [1, 1, 0, 1]
