"""The paper's law below a known surface gives the right coefficient, also while the body advances."""

from __future__ import annotations

import numpy as np
import pytest

from control.records import Phase
from experiments.trials.stride_profile import StrideProfile
from experiments.walk.known_surface import k_s_of
from tests.experiments.synthetic_strides import CONFIGURATION, GEOMETRY, make_profile, make_stride

SWEEPS_DEG = list(np.linspace(30.0, -30.0, 61))
K, DEPTH_M, SURFACE_M = 0.3e6, 0.03, 0.005
MOMENT_M3 = GEOMETRY.plate_width_m * (DEPTH_M - SURFACE_M) ** 2 / 2.0


def stance(advance_m: float = 0.0) -> StrideProfile:
    """Return a stance with f_x = k_s b z²/2 while the body advances by `advance_m`."""
    torques_nm = K * MOMENT_M3 * GEOMETRY.flipper_length_m / np.cos(np.radians(SWEEPS_DEG))
    positions_m = np.linspace(0.0, advance_m, len(SWEEPS_DEG))
    return make_profile(
        Phase.STANCE, SWEEPS_DEG, [DEPTH_M] * len(SWEEPS_DEG), sweep_nm=list(torques_nm), body_m=list(positions_m)
    )


def test_the_fit_gives_the_laws_coefficient_below_the_known_surface() -> None:
    estimate = k_s_of(stance(), make_stride(surface_m=SURFACE_M), CONFIGURATION, 0.0)
    assert estimate["valid"]
    assert estimate["value"] == pytest.approx(K)


def test_half_of_the_drag_is_added_while_the_body_advances() -> None:
    estimate = k_s_of(stance(0.1), make_stride(surface_m=SURFACE_M), CONFIGURATION, 2.5)
    assert estimate["value"] == pytest.approx(K + 1.25 / MOMENT_M3)


def test_no_drag_is_added_while_the_body_stands_or_has_no_pose() -> None:
    for advance_m in (0.001, float("nan")):
        estimate = k_s_of(stance(advance_m), make_stride(surface_m=SURFACE_M), CONFIGURATION, 2.5)
        assert estimate["value"] == pytest.approx(K)


def test_a_stride_without_rows_gives_no_estimate() -> None:
    assert not k_s_of(make_profile(Phase.SWING, [0.0], [-0.01]), make_stride(), CONFIGURATION, 2.5)["valid"]
