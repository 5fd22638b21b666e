"""The surface of a trial, from finds that are more or less accurate than they claim."""

from math import inf, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.strokes.surface import NO_SURFACE, Surface
from estimation.strokes.surface_memory import SurfaceMemory

BASES = pytest.mark.parametrize("fixed_base", [True, False])
depth_values, errors = st.floats(-0.02, 0.02), st.floats(1e-5, 0.02)


def find(depth_m: float, error_m: float = 0.0003) -> Surface:
    return Surface(depth_m, error_m, 0.3, 0.1, True)


def surfaces(memory: SurfaceMemory, depths_m: list[float], error_m: float = 0.0003) -> list[Surface]:
    return [memory.update(find(depth_m, error_m), 0.0) for depth_m in depths_m]


@BASES
@given(errors, errors, st.floats(0.0, 0.005), st.floats(-0.9, 0.9))
def test_a_first_find_within_its_errors_is_combined_by_precision(
    fixed_base: bool, error_m: float, expected_m: float, sample_m: float, deviations: float
) -> None:
    """The result is that of two independent normal readings: one at the depth, one at the nominal height, zero."""
    own_m2 = error_m**2 + sample_m**2 / 3.0
    depth_m = deviations * sqrt(own_m2 + expected_m**2)
    surface = SurfaceMemory(expected_m, fixed_base).update(find(depth_m, error_m), sample_m)
    assert surface.depth_m == pytest.approx(depth_m * expected_m**2 / (own_m2 + expected_m**2), rel=1e-9, abs=1e-15)
    assert surface.std_error_m == pytest.approx((1.0 / own_m2 + expected_m**-2) ** -0.5, rel=1e-9)
    assert (surface.level_n, surface.level_std_error_n, surface.found) == (0.3, 0.1, True)


@BASES
@given(st.lists(st.tuples(depth_values, errors), min_size=1, max_size=20), st.floats(0.0, 0.005))
def test_a_surface_lies_between_the_nominal_height_and_the_finds(
    fixed_base: bool, finds: list[tuple[float, float]], sample_m: float
) -> None:
    memory = SurfaceMemory(0.001, fixed_base)
    for depth_m, error_m in finds:
        surface = memory.update(find(depth_m, error_m), sample_m)
    lowest_m, highest_m = min(depth_m for depth_m, _ in finds), max(depth_m for depth_m, _ in finds)
    assert min(0.0, lowest_m) - 1e-12 <= surface.depth_m <= max(0.0, highest_m) + 1e-12
    assert 0.0 < surface.std_error_m < inf


def test_on_a_bench_finds_that_scatter_beyond_their_claims_hardly_move_the_surface() -> None:
    """The truth is the nominal height; the finds scatter by 3 mm and claim 0.6 mm, as in the authors' logs."""
    random, depths_m = np.random.default_rng(1), []
    for _ in range(100):
        memory = SurfaceMemory(0.0003, fixed_base=True)
        found = surfaces(memory, (0.003 * random.standard_normal(5)).tolist(), 0.0006)
        depths_m += [surface.depth_m for surface in found]
    assert np.std(depths_m) < 0.0003


def test_on_a_bench_the_claims_of_good_finds_are_those_of_the_surfaces() -> None:
    """The truths scatter by 1.5 mm, as configured: the errors are as large as the surfaces claim."""
    random, missed = np.random.default_rng(2), []
    for _ in range(200):
        truths_m = 0.0015 * random.standard_normal(3)
        finds_m = truths_m + 0.0005 * random.standard_normal(3)
        memory = SurfaceMemory(0.0015, fixed_base=True)
        for truth_m, surface in zip(truths_m, surfaces(memory, finds_m.tolist(), 0.0005), strict=True):
            missed.append((surface.depth_m - truth_m) / surface.std_error_m)
    assert 0.8 < np.std(missed) < 1.2


def test_under_a_body_that_sank_the_finds_prevail() -> None:
    memory = SurfaceMemory(0.001, fixed_base=False)
    for depth_m, surface in zip(
        [-0.009, -0.006, -0.012, 0.01], surfaces(memory, [-0.009, -0.006, -0.012, 0.01]), strict=True
    ):
        assert surface.depth_m == pytest.approx(depth_m, abs=0.0005)


def test_finds_that_agree_replace_a_wrong_nominal_height() -> None:
    memory = SurfaceMemory(0.0003, fixed_base=True)
    last = surfaces(memory, [-0.005, -0.0052, -0.0049, -0.0051, -0.005])[-1]
    assert last.depth_m == pytest.approx(-0.005, abs=0.0005)


@BASES
def test_a_stroke_without_a_find_lies_at_the_offset_of_those_before(fixed_base: bool) -> None:
    memory = SurfaceMemory(0.001, fixed_base)
    first = memory.update(NO_SURFACE, 0.001)
    assert (first.depth_m, first.std_error_m, first.found) == (0.0, 0.001, False)
    assert first.own_error_m == (0.0 if fixed_base else 0.001)
    surfaces(memory, [-0.001, -0.0012, -0.0011, -0.0009, -0.001])
    later = memory.update(NO_SURFACE, 0.001)
    assert -0.0011 < later.depth_m < -0.0004
    assert later.std_error_m >= 0.001


@BASES
def test_slow_messages_make_a_find_count_less(fixed_base: bool) -> None:
    weights = [
        SurfaceMemory(0.0015, fixed_base).update(find(0.001), sample_m).depth_m / 0.001
        for sample_m in (0.0, 0.001, 0.005, 0.02)
    ]
    assert weights == sorted(weights, reverse=True)
    assert weights[0] > 0.95
    assert weights[-1] < 0.05


@BASES
def test_a_reset_forgets_the_trial(fixed_base: bool) -> None:
    memory = SurfaceMemory(0.001, fixed_base)
    first = surfaces(memory, [-0.004, 0.003])
    memory.reset()
    assert surfaces(memory, [-0.004, 0.003]) == first


# the two errors


def test_the_strokes_of_a_bench_differ_by_their_finds_and_share_the_levelling() -> None:
    """The bench's surface is off by 2 mm in all trials, and each find by 0.5 mm: own_error_m is the scatter in a trial,
    std_error_m the distance from the truth.
    """
    random, own, missed = np.random.default_rng(3), [], []
    for _ in range(300):
        truth_m = 0.002 * random.standard_normal()
        finds_m = truth_m + 0.0005 * random.standard_normal(4)
        found = surfaces(SurfaceMemory(0.002, fixed_base=True), finds_m.tolist(), 0.0005)
        own.append((found[-1].depth_m - truth_m) / found[-1].own_error_m)
        missed.append((found[-1].depth_m - truth_m) / found[-1].std_error_m)
        assert found[-1].own_error_m < found[-1].std_error_m
    assert 0.7 < np.std(own) < 1.3
    assert 0.7 < np.std(missed) < 1.3


@BASES
def test_a_find_far_below_the_highest_may_be_the_bottom_of_a_hole_of_a_body_that_walks(fixed_base: bool) -> None:
    memory = SurfaceMemory(0.005, fixed_base)
    fresh, hole = surfaces(memory, [0.0, 0.03], 0.0005)
    assert fresh.std_error_m < 0.001
    if fixed_base:
        assert hole.own_error_m < 0.005
    else:
        assert hole.std_error_m == hole.own_error_m == pytest.approx(0.03 / sqrt(3.0), rel=0.02)
        assert surfaces(memory, [0.0005], 0.0005)[0].std_error_m < 0.001
