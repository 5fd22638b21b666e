"""A flipper that meets two surfaces in one trial reports both; one that meets a single surface reports one."""

from itertools import pairwise

import numpy as np
import pytest

from control.records import Phase, StrideEstimate
from estimation.flipper import TWO_SURFACES
from estimation.strokes.surface import Surface
from estimation.strokes.surface_memory import SurfaceMemory
from tests.estimation.test_flipper import MUD, closed, coefficients, estimator, motion, noisy, rows_of

ERROR_M = 0.001
BASES = pytest.mark.parametrize("fixed_base", [True, False])


def strides_over(surfaces_m: list[float]) -> list[StrideEstimate]:
    """Return one stride on each surface, with the noise of the authors' currents."""
    moments = motion(strides=len(surfaces_m))
    begins = [0, *(i for i, (a, b) in enumerate(pairwise(moments), 1) if a.phase is not b.phase is Phase.INSERTION)]
    begins = [*begins[:1], *begins[2:], len(moments)]
    rows = [
        row
        for (first, last), surface_m in zip(pairwise(begins), surfaces_m, strict=True)
        for row in rows_of(moments[first:last], MUD.times(2.0)._replace(surface_m=surface_m))
    ]
    return closed(noisy(rows, 1), estimator(surface_error_m=0.0005))


def test_strides_in_a_hole_and_next_to_it_report_both_surfaces_by_name() -> None:
    in_hole = [False, True, False, True, True, False]
    strides = strides_over([0.006 * deep for deep in in_hole])
    assert len(strides) == len(in_hole)
    for stride, deep in list(zip(strides, in_hole, strict=True))[-2:]:
        assert stride.other_surface_m == pytest.approx(0.0 if deep else 0.006, abs=0.0015)
        assert all(each.valid and each.reason == TWO_SURFACES for each in coefficients(stride))


def test_strides_on_one_surface_report_one() -> None:
    for stride in strides_over([0.003] * 8):
        assert np.isnan(stride.other_surface_m)
        assert all(each.reason == "" for each in coefficients(stride))


def others_m(depths_m: list[float], fixed_base: bool) -> list[float]:
    memory = SurfaceMemory(1e-5, fixed_base)
    return [memory.update(Surface(depth_m, ERROR_M, 0.0, 0.1, True), 0.0).other_m for depth_m in depths_m]


@BASES
def test_the_other_surface_is_the_mean_of_the_other_finds(fixed_base: bool) -> None:
    others = others_m([0.0, 0.001, 0.010, 0.0105, 0.0005], fixed_base)
    assert np.isnan(others[:3]).all()  # each surface needs two finds
    assert others[3:] == [pytest.approx(0.0005, abs=1e-6), pytest.approx(0.01025, abs=1e-6)]


@BASES
@pytest.mark.parametrize("count", [4, 8])
@pytest.mark.parametrize(("apart_m", "least", "most"), [(0.0, 0.0, 0.04), (0.006, 0.88, 1.0), (0.009, 0.98, 1.0)])
def test_two_surfaces_are_found_as_often_as_predicted(
    count: int, apart_m: float, least: float, most: float, fixed_base: bool
) -> None:
    random, hits = np.random.default_rng(count), 0
    for _ in range(150):
        depths_m = ERROR_M * random.standard_normal(count) + apart_m * (np.arange(count) % 2)
        hits += bool(np.isfinite(others_m(depths_m.tolist(), fixed_base)[-1]))
    assert least <= hits / 150 <= most
