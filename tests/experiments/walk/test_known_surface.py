"""The paper's law below a known surface gives the right coefficient, also while the body advances."""

from dataclasses import replace

import numpy as np
import pytest
from pandas import DataFrame

from control.records import FLIPPERS, Phase, Rig
from experiments.walk.known_surface import k_s_of
from tests.experiments.synthetic_strides import CONFIGURATION, GEOMETRY, make_profile, make_stride

SWEEPS_DEG = list(np.linspace(30.0, -30.0, 61))
K, DEPTH_M, SURFACE_M = 0.3e6, 0.03, 0.005
MOMENT_M3 = GEOMETRY.plate_width_m * (DEPTH_M - SURFACE_M) ** 2 / 2.0


def stance(advance_m: float) -> DataFrame:
    """Return a stance with f_x = k_s b z²/2 while the body advances by `advance_m`."""
    torques_nm = K * MOMENT_M3 * GEOMETRY.flipper_length_m / np.cos(np.radians(SWEEPS_DEG))
    positions_m = np.linspace(0.0, advance_m, len(SWEEPS_DEG))
    depths_m = [DEPTH_M] * len(SWEEPS_DEG)
    return make_profile(Phase.STANCE, SWEEPS_DEG, depths_m, sweep_load_nm=torques_nm, body_x_m=positions_m)


@pytest.mark.parametrize(
    ("advance_m", "drag_n", "flippers", "added_n"),
    [
        (0.0, 0.0, FLIPPERS, 0.0),
        (0.1, 0.0, FLIPPERS, 0.0),
        (0.1, 2.5, FLIPPERS, 1.25),
        (0.1, 2.5, ("right",), 2.5),
        (0.001, 2.5, FLIPPERS, 0.0),
        (float("nan"), 2.5, FLIPPERS, 0.0),
    ],
)
def test_the_law_below_the_known_surface_has_a_flippers_part_of_the_drag_while_the_body_advances(
    advance_m: float, drag_n: float, flippers: tuple[str, ...], added_n: float
) -> None:
    robot = replace(CONFIGURATION, rig=Rig(flippers))
    estimate = k_s_of(stance(advance_m), make_stride(surface_m=SURFACE_M), robot, drag_n)
    assert estimate["valid"]
    assert estimate["value"] == pytest.approx(K + added_n / MOMENT_M3)


def test_a_stride_without_rows_gives_no_estimate() -> None:
    assert not k_s_of(make_profile(Phase.SWING, [0.0], [-0.01]), make_stride(), CONFIGURATION, 2.5)["valid"]
