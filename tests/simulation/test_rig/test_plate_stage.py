"""The stage's position follows its motion profile in steps of any length."""

from itertools import pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulation.test_rig.plate_stage import LIFTED_M, PlateStage, StageParameters
from simulation.test_rig.stage_motion import ManualMotion, ManualMotionParameters, RampedMotion


class Air:
    """A CarriedPlate whose upward force is its depth in newtons a metre, and whose forward force is its travel."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.depth_m = self.path_m = 0.0

    def step(self, dt_s: float, forward_m_s: float, upward_m_s: float) -> tuple[float, float]:
        self.depth_m -= dt_s * upward_m_s
        self.path_m += dt_s * forward_m_s
        return self.path_m, self.depth_m


@given(st.floats(0.001, 0.5), st.floats(0.005, 0.5), st.floats(0.1, 20.0))
def test_a_ramped_motion_ends_at_the_right_distance_and_time(
    path_m: float, speed_m_s: float, acceleration: float
) -> None:
    motion = RampedMotion(path_m, speed_m_s, acceleration)
    duration_s = motion.duration_s
    assert motion.path_m(0.0) == 0.0
    assert motion.path_m(duration_s) == pytest.approx(path_m)
    assert motion.path_m(duration_s / 2.0) == pytest.approx(path_m / 2.0)
    step_s = 1e-4 * duration_s
    steps = [motion.path_m(i * 100 * step_s + step_s) for i in range(100)]
    before = [motion.path_m(i * 100 * step_s) for i in range(100)]
    speeds = [(b - a) / step_s for a, b in zip(before, steps, strict=True)]
    assert min(speeds) >= 0.0 and max(speeds) <= speed_m_s * (1.0 + 1e-6)


def test_an_insertion_lowers_holds_and_lifts() -> None:
    stage = PlateStage(Air(), StageParameters(2.0))
    stage.reset()
    stage.mean_force_n(0.0)
    stage.insert(1.0, 0.03, 0.1, 3.0)
    stroke_s = 0.05 / 0.1 + 0.1 / 2.0
    depths_m = {}
    for at_s in (0.9, 1.0 + stroke_s, 1.0 + stroke_s + 2.9, stage.ends_s + 0.1):
        stage.mean_force_n(at_s)
        depths_m[at_s] = stage.plate.depth_m
    assert list(depths_m.values()) == pytest.approx([-LIFTED_M, 0.03, 0.03, -LIFTED_M])
    assert stage.ends_s == pytest.approx(1.0 + 2.0 * stroke_s + 3.0)


def test_the_cell_reads_the_mean_since_the_last_reading_and_a_hanging_weight() -> None:
    stage = PlateStage(Air(), StageParameters(1e6))
    stage.reset()
    stage.mean_force_n(0.0)
    stage.hung_weight_n = 2.0
    assert stage.mean_force_n(0.5) == pytest.approx(2.0 - LIFTED_M)
    stage.hung_weight_n = 0.0
    stage.insert(0.5, 0.0, 0.1, 0.0)  # 2 cm down within 0.2 s
    assert stage.mean_force_n(0.7) == pytest.approx(-LIFTED_M / 2.0, rel=0.01)


@given(st.floats(0.003, 0.3), st.integers(0, 10**6))
def test_a_manual_motion_covers_its_distance_forward_within_its_fastest_speed(path_m: float, seed: int) -> None:
    hand = ManualMotionParameters()
    motion = ManualMotion(path_m, hand, Random(seed))
    step_s = motion.duration_s / 500.0
    positions_m = [motion.path_m(i * step_s) for i in range(501)]
    assert (positions_m[0], positions_m[-1]) == (0.0, path_m)
    speeds_m_s = [(after - before) / step_s for before, after in pairwise(positions_m)]
    assert min(speeds_m_s) >= -1e-9 and max(speeds_m_s) <= 1.01 * hand.fastest_m_s


def test_an_encoder_on_the_stage_counts_every_stroke_and_nothing_else() -> None:
    stage = PlateStage(Air(), StageParameters(manual=ManualMotionParameters()))
    stage.mean_force_n(0.0)
    stage.insert(1.0, 0.03, 0.1, 3.0)
    down_s = stage.ends_s
    for at_s in (1.3, 1.4, 3.0, down_s):
        stage.mean_force_n(at_s)
        assert -stage.travelled_m(at_s) == pytest.approx(stage.plate.depth_m + LIFTED_M, abs=1e-6)
    stage.move_over(stage.plate, sideways=True)
    stage.drag(down_s, 0.2, 0.1)
    assert stage.travelled_m(down_s) == pytest.approx(0.0, abs=1e-9)
    assert stage.travelled_m(stage.ends_s) == pytest.approx(-0.2)
