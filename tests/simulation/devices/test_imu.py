"""The unit's samples against motions whose accelerations and rates are known without it."""

from math import cos, pi, sin

import numpy as np
import pytest

from simulation.body.free_body import FreeBody
from simulation.body.plant import STEP_S, Plant, PlantParameters
from simulation.body.rail_body import BodyMotion
from simulation.devices.imu import Imu, ImuParameters, ImuSample
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

TRACK = Track([(9.0, MUDS["48.5"])])
AT_REST = BodyMotion((0.0, 0.0, 0.0))
PERIOD_S = 1.0 / 200.0


def watched(imu: Imu, motions: list[BodyMotion], period_s: float = PERIOD_S) -> list[ImuSample]:
    samples = [imu.update(step * period_s, motion) for step, motion in enumerate(motions)]
    return [sample for sample in samples if sample is not None]


@pytest.mark.parametrize(
    ("roll_rad", "pitch_rad", "direction"),
    [(0.0, 0.0, (0.0, 0.0, 1.0)), (0.3, 0.0, (0.0, sin(0.3), cos(0.3))), (0.0, 0.3, (-sin(0.3), 0.0, cos(0.3)))],
)
def test_at_rest_it_reads_gravity_upward(
    roll_rad: float, pitch_rad: float, direction: tuple[float, float, float]
) -> None:
    lying = AT_REST._replace(roll_rad=roll_rad, pitch_rad=pitch_rad)
    (sample,) = watched(Imu(ImuParameters()), [lying, lying])
    assert sample.specific_force_m_s2 == pytest.approx([9.81 * part for part in direction])
    assert sample.angular_rate_rad_s == (0.0, 0.0, 0.0)


def test_in_free_fall_it_reads_nothing() -> None:
    plant = Plant(PlantParameters(free_body=True), TRACK)
    assert isinstance(plant.body, FreeBody)
    plant.body.height_m += 0.2
    imu, samples = Imu(ImuParameters()), []
    for step in range(100):
        plant.body.step(STEP_S, *plant.arms)
        samples.append(imu.update(step * STEP_S, plant.motion))
    forces = [sample.specific_force_m_s2 for sample in samples if sample is not None]
    assert len(forces) == 19
    assert np.abs(forces).max() < 1e-9


def test_on_the_rail_it_reads_the_body_s_acceleration() -> None:
    speeding = [BodyMotion((0.01 * step, 0.0, 0.0)) for step in range(5)]
    for sample in watched(Imu(ImuParameters()), speeding):
        assert sample.specific_force_m_s2 == pytest.approx((0.01 * 200.0, 0.0, 9.81))


def test_pitching_and_rolling_read_their_rates() -> None:
    pitching = AT_REST._replace(pitch_rad=0.4, pitch_rad_s=-0.7)
    rolling = AT_REST._replace(roll_rad=0.4, roll_rad_s=0.5)
    both = AT_REST._replace(roll_rad=pi / 2.0, pitch_rad_s=0.7)  # on its left's edge it pitches about its own vertical
    for motion, rates in ((pitching, (0.0, -0.7, 0.0)), (rolling, (0.5, 0.0, 0.0)), (both, (0.0, 0.0, -0.7))):
        (sample,) = watched(Imu(ImuParameters()), [motion, motion])
        assert sample.angular_rate_rad_s == pytest.approx(rates)


def test_samples_come_at_the_stated_rate() -> None:
    samples = watched(Imu(ImuParameters(rate_hz=100.0)), [AT_REST] * 1001, period_s=0.001)
    assert len(samples) == 100
    assert np.diff([sample.stamp_s for sample in samples]) == pytest.approx(0.01)


def test_noise_and_bias_are_as_stated_and_the_bias_stays() -> None:
    noisy = ImuParameters(force_noise_m_s2=0.05, rate_noise_rad_s=0.002)
    samples = watched(Imu(noisy), [AT_REST] * 4001)
    forces, rates = (np.array([sample[place] for sample in samples]) for place in (1, 2))
    assert np.std(forces, axis=0) == pytest.approx(0.05, rel=0.05)  # 4000 draws tell it to 1 %
    assert np.std(rates, axis=0) == pytest.approx(0.002, rel=0.05)
    assert np.mean(forces, axis=0) == pytest.approx([0.0, 0.0, 9.81], abs=0.004)
    biased = ImuParameters(force_bias_m_s2=0.2, rate_bias_rad_s=0.01)
    biases = np.array([watched(Imu(biased, seed), [AT_REST] * 3)[-1][1:] for seed in range(1000)])
    assert np.std(biases[:, 0, 0]) == pytest.approx(0.2, rel=0.1)
    assert np.std(biases[:, 1, 2]) == pytest.approx(0.01, rel=0.1)
    first, second = watched(Imu(biased), [AT_REST] * 3)
    assert first[1:] == second[1:]


def test_a_seed_repeats_its_samples_also_after_a_reset() -> None:
    parameters = ImuParameters(force_noise_m_s2=0.05, force_bias_m_s2=0.2)
    imu = Imu(parameters, 3)
    first = watched(imu, [AT_REST] * 20)
    imu.reset()
    assert watched(imu, [AT_REST] * 20) == first != watched(Imu(parameters, 4), [AT_REST] * 20)
