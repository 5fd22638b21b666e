"""The stage: where it is when, whatever the steps it is asked in."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulation.plate_stage import LIFTED_M, PlateStage, StageParameters, ramped_duration_s, ramped_way_m


class Air:
    """A CarriedPlate that feels how deep it is, in newtons a metre; forward it feels its way."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.depth_m = self.way_m = 0.0

    def step(self, dt_s: float, forward_m_s: float, upward_m_s: float) -> tuple[float, float]:
        self.depth_m -= dt_s * upward_m_s
        self.way_m += dt_s * forward_m_s
        return self.way_m, self.depth_m


@given(st.floats(0.001, 0.5), st.floats(0.005, 0.5), st.floats(0.1, 20.0))
def test_a_ramped_way_ends_where_and_when_it_should(way_m: float, speed_m_s: float, acceleration: float) -> None:
    duration_s = ramped_duration_s(way_m, speed_m_s, acceleration)
    assert ramped_way_m(0.0, way_m, speed_m_s, acceleration) == 0.0
    assert ramped_way_m(duration_s, way_m, speed_m_s, acceleration) == pytest.approx(way_m)
    assert ramped_way_m(duration_s / 2.0, way_m, speed_m_s, acceleration) == pytest.approx(way_m / 2.0)
    step_s = 1e-4 * duration_s
    steps = [ramped_way_m(i * 100 * step_s + step_s, way_m, speed_m_s, acceleration) for i in range(100)]
    before = [ramped_way_m(i * 100 * step_s, way_m, speed_m_s, acceleration) for i in range(100)]
    speeds = [(b - a) / step_s for a, b in zip(before, steps, strict=True)]
    assert min(speeds) >= 0.0 and max(speeds) <= speed_m_s * (1.0 + 1e-6)


def test_an_insertion_goes_down_holds_and_comes_up() -> None:
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


def test_lowering_and_lifting_end_at_their_depths_and_a_drag_goes_backward() -> None:
    air = Air()
    stage = PlateStage(air)
    stage.place_over(air, sideways=True)
    stage.mean_force_n(0.0)
    stage.lower(0.0, 0.03)
    stage.mean_force_n(2.0)
    assert air.depth_m == pytest.approx(0.03)
    stage.drag(2.0, 0.2, 0.1)
    stage.mean_force_n(5.0)
    assert (air.way_m, stage.force_n) == pytest.approx((-0.2, -0.2))
    stage.lift(5.0)
    stage.mean_force_n(7.0)
    assert air.depth_m == pytest.approx(-LIFTED_M)


def test_the_cell_reads_the_mean_since_the_last_time_and_what_hangs_on_it() -> None:
    stage = PlateStage(Air(), StageParameters(1e6, cell_sign=-1.0))
    stage.reset()
    stage.mean_force_n(0.0)
    stage.hung_n = 2.0
    assert stage.mean_force_n(0.5) == pytest.approx(-2.0 + LIFTED_M)
    stage.hung_n = 0.0
    stage.insert(0.5, 0.0, 0.1, 0.0)  # 2 cm down within 0.2 s
    assert stage.mean_force_n(0.7) == pytest.approx(LIFTED_M / 2.0, rel=0.01)
