"""Batches of equal travel: what they keep of the samples, and what they do not depend on."""

from collections.abc import Iterable
from math import isfinite, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.strokes.stroke import LONGEST, MOSTLY, MOVING, Batch, Stroke

STEP_M, SPEED_M_S = 0.0015, 0.1
Row = tuple[float, float]  # time and travel


def row(
    now_s: float, travel_m: float, saturated: bool = False, body_m: float | None = None
) -> tuple[float, float, float, float, float, float, float, bool]:
    """Return a sample whose values are in proportion to its travel, so that the mean of a batch shows in each of
    them.
    """
    body_m = 6.0 * travel_m if body_m is None else body_m
    return now_s, travel_m, 2.0 * travel_m, 3.0 * travel_m, 4.0 * travel_m, 5.0 * travel_m, body_m, saturated


def even(rate_hz: float, path_m: float = 0.045, start_m: float = -0.0145) -> list[Row]:
    count = round(path_m / SPEED_M_S * rate_hz)
    return [(i / rate_hz, start_m + SPEED_M_S * i / rate_hz) for i in range(count)]


def stroke_of(rows: Iterable[Row]) -> Stroke:
    stroke, now_s, travel_m = Stroke(STEP_M), 0.0, 0.0
    for now_s, travel_m in rows:
        stroke.update(*row(now_s, travel_m))
    stroke.close(now_s, travel_m)
    return stroke


@given(st.lists(st.floats(-0.02, 0.02), min_size=1, max_size=LONGEST))
def test_batches_are_means_of_all_samples_in_their_order_less_than_a_step_from_their_first(
    travels_m: list[float],
) -> None:
    begin = 0
    for batch in stroke_of((0.01 * i, travel_m) for i, travel_m in enumerate(travels_m)).batches:
        travels = travels_m[begin : begin + batch.samples]
        begin += batch.samples
        mean_m = float(np.mean(travels))
        assert batch[:6] == pytest.approx(tuple(factor * mean_m for factor in (1, 2, 3, 4, 5, 6)), abs=1e-15)
        assert all(abs(travel_m - travels[0]) < STEP_M for travel_m in travels)
    assert begin == len(travels_m)


@pytest.mark.parametrize("start_m", [-0.0145, 0.0, 0.03])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_even_motion_leaves_batches_of_equal_travel_in_either_direction(direction: float, start_m: float) -> None:
    rows = [(now_s, direction * travel_m) for now_s, travel_m in even(3800.0, start_m=start_m)]
    travels_m = np.array([batch.travel_m for batch in stroke_of(rows).batches[:-1]])
    per_sample_m = SPEED_M_S / 3800.0
    assert np.diff(travels_m) == pytest.approx(direction * STEP_M, abs=1.01 * per_sample_m)


def test_a_flipper_that_stands_still_adds_to_one_batch() -> None:
    rows = even(380.0, path_m=0.015)
    end_s, end_m = rows[-1]
    held = [*rows, *((end_s + i / 380.0, end_m) for i in range(1, 5000))]
    assert len(stroke_of(held).batches) == len(stroke_of(rows).batches)


def test_a_stroke_without_end_takes_no_more_memory() -> None:
    stroke = stroke_of(even(380.0, path_m=10.0))
    assert len(stroke.batches) == LONGEST
    assert stroke.batches[-1].travel_m < (LONGEST + 10) * STEP_M


def test_a_lost_body_position_loses_only_the_position() -> None:
    stroke = Stroke(STEP_M)
    for i in range(10):
        stroke.update(*row(0.01 * i, 0.0, body_m=nan if i == 3 else 1.0))
    stroke.close(0.1, 0.0)
    (batch,) = stroke.batches
    assert not isfinite(batch.body_m)
    assert isfinite(sum(batch[:5]))


@pytest.mark.parametrize(("clipped", "saturated"), [(0, False), (3, False), (4, True), (10, True)])
def test_a_batch_is_saturated_from_a_third_of_its_samples_on(clipped: int, saturated: bool) -> None:
    assert 0.3 <= MOSTLY < 0.4
    stroke = Stroke(STEP_M)
    for i in range(10):
        stroke.update(*row(0.01 * i, 0.0, saturated=i < clipped))
    stroke.close(0.1, 0.0)
    assert stroke.batches[0].saturated is saturated


# speed, and which batches count as moving


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_speed_is_that_along_the_stroke(direction: float) -> None:
    for batch in stroke_of((now_s, direction * travel_m) for now_s, travel_m in even(380.0)).batches[:-1]:
        assert batch.speed_m_s == pytest.approx(SPEED_M_S, rel=1e-9)


@pytest.mark.parametrize("times_s", [(1.0, 1.0, 1.0), (3.0, 2.0, 1.0)])
def test_a_clock_that_stands_or_runs_backward_makes_no_speed(times_s: tuple[float, ...]) -> None:
    stroke = stroke_of([(now_s, 0.002 * i) for i, now_s in enumerate(times_s)])
    assert [batch.speed_m_s for batch in stroke.batches] == [0.0, 0.0, 0.0]


def moving(speeds_m_s: list[float]) -> list[float]:
    stroke = Stroke(STEP_M)
    stroke.batches = [Batch(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False, 1, speed_m_s) for speed_m_s in speeds_m_s]
    return [batch.speed_m_s for batch in stroke.moving()]


@given(st.lists(st.floats(0.0, 1.0), max_size=LONGEST))
def test_what_counts_as_moving_is_one_piece_whose_ends_are_quick(speeds_m_s: list[float]) -> None:
    kept = moving(speeds_m_s)
    assert bool(kept) == bool(speeds_m_s)
    if kept:
        least = MOVING * sorted(speeds_m_s)[len(speeds_m_s) // 2]
        assert kept[0] >= least
        assert kept[-1] >= least
        assert any(speeds_m_s[i : i + len(kept)] == kept for i in range(len(speeds_m_s)))


# beginning and end


def test_ending_a_stroke_twice_or_without_samples_adds_nothing() -> None:
    stroke = stroke_of(even(380.0))
    batches = list(stroke.batches)
    stroke.close(9.0, 9.0)
    assert stroke.batches == batches
    assert stroke_of([]).batches == []


def test_a_reset_forgets_everything() -> None:
    stroke = stroke_of(even(380.0))
    stroke.update(*row(5.0, 1.0))
    stroke.reset()
    for now_s, travel_m in even(190.0):
        stroke.update(*row(now_s, travel_m))
    stroke.close(*even(190.0)[-1])
    fresh = stroke_of(even(190.0))
    assert stroke.batches == fresh.batches
    assert stroke.first_m == fresh.first_m
