"""Rest is evaluated by the angle."""

from math import inf
from random import Random

import pytest

from control.monitors.stillness import Stillness


def test_a_joint_is_still_within_its_band_and_for_as_long_as_it_stays_there() -> None:
    stillness = Stillness(0.03)
    assert stillness.update(1.0, 0.1) and stillness.still_s == inf
    assert not stillness.update(1.1, 0.1)
    assert stillness.still_s == 0.0
    assert stillness.update(1.13 - 1e-9, 0.1)
    assert stillness.update(1.07 + 1e-9, 0.1)
    assert stillness.still_s == pytest.approx(0.2)
    assert not stillness.update(1.14, 0.1)


def test_noise_of_the_encoder_is_no_motion_and_a_slow_creep_is() -> None:
    random, stillness = Random(1), Stillness(0.03)
    stillness.update(0.5, 0.1)
    assert all(stillness.update(random.gauss(0.5, 0.002), 0.1) for _ in range(1000))
    stillness.reset()
    moved = [not stillness.update(0.001 * step, 0.1) for step in range(200)]
    assert sum(moved) == 199 // 31


def test_an_angle_that_is_no_number_is_never_still() -> None:
    stillness = Stillness(0.03)
    assert not any(stillness.update(float("nan"), 0.1) for _ in range(10))
