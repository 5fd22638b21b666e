"""The truth of a stride agrees with the clay's laws, evaluated here for an upright plate and along the flipper's arc.

At the depth z, with the edge's area A and the plate's girth G, the rate factor g and the strength s_u,

    down  F = g s_u (5.14 A + 0.25 G z)        up  F = g s_u (9 A min(z/1 cm, 1) + 0.25 G z)

and sideways N_p s_u on the face. k is the least-squares slope of F against V = A z, or F over ∫ζ dA.
"""

from dataclasses import replace
from math import cos, exp, hypot, nan, radians, sin
from typing import Any, NamedTuple

import numpy as np
import pytest

from control.geometry import FlipperGeometry
from experiments.trials.load_cell_truth import (
    PAPER_SPEED_M_S,
    REVERSAL_FRACTION,
    Truth,
    true_coefficients,
)
from simulation.body.reference_sensor import StrideTruth, StrokeTruth
from simulation.mud.clay import (
    ADHESION,
    BEARING_FACTOR,
    DEEP_FACTOR,
    MATLOCK_J,
    SUCTION_FADE_M,
    UNIT_WEIGHT_N_M3,
    Clay,
    clay_of_water,
    rate_factor,
)
from simulation.mud.grounds.thixotropic_mud import ThixotropicMud

GEOMETRY = FlipperGeometry()
EDGE_M2 = GEOMETRY.plate_width_m * GEOMETRY.plate_thickness_m
GIRTH_M = 2.0 * (GEOMETRY.plate_width_m + GEOMETRY.plate_thickness_m)
CLAY = clay_of_water(49.5)
DEPTH_M, SPEED_M_S = 0.03, 0.2
COEFFICIENT_OF = {"insertion": "k_p", "stance": "k_s", "extraction": "k_e"}
NEVER = StrokeTruth(nan, nan, nan, nan, nan, nan)


def stroke(
    sweep_rad: float = 0.0, adduction_rad: float = 0.0, deepest_m: float = DEPTH_M, speed_m_s: float = SPEED_M_S
) -> StrokeTruth:
    return StrokeTruth(sweep_rad, adduction_rad, deepest_m, speed_m_s, 0.05, 0.9 * deepest_m)


def stride(clay: Clay = CLAY, **changes: Any) -> StrideTruth:
    return replace(StrideTruth("left", 0, clay, 0.0, stroke(), stroke(), stroke()), **changes)


def with_stroke(name: str, of: StrokeTruth) -> StrideTruth:
    changes: dict[str, Any] = {name: of}
    return stride(**changes)


class Plates(NamedTuple):
    """The coefficients with the plate as the flipper carries it, and with the paper's."""

    leaning: Truth
    upright: Truth


def truth(of: StrideTruth, relaxation: float = 0.0, hold_s: float = 0.0) -> Plates:
    return Plates(*(true_coefficients(of, GEOMETRY, relaxation, hold_s, upright) for upright in (False, True)))


def slope(depths_m: np.ndarray, forces_n: np.ndarray) -> float:
    volumes = EDGE_M2 * depths_m
    return float(volumes @ forces_n / (volumes @ volumes))


# the closed law


@pytest.mark.parametrize("clay", [clay_of_water(47.6), clay_of_water(51.2)])
@pytest.mark.parametrize("depth_m", [0.02, 0.03, 0.05])
def test_an_upright_plate_has_the_coefficients_of_the_closed_laws(depth_m: float, clay: Clay) -> None:
    """k_p agrees to 1 %, because mud along the plate carries less in the first millimetre, before it yields.

    k_e agrees to 0.2 %, the carrier's step: in the last three quarters of the path all loads have reversed. k_s agrees
    up to rounding: mud that has yielded follows the clay's lateral law at the stance's mean depth.
    """
    moved, mean_m = stroke(deepest_m=depth_m), 0.9 * depth_m
    reported = truth(stride(clay, insertion=moved, extraction=moved, stance=moved)).upright
    strength_pa, z = rate_factor(SPEED_M_S) * clay.strength_pa, np.linspace(0.0, depth_m, 2001)
    bearing_n = strength_pa * (BEARING_FACTOR * EDGE_M2 + ADHESION * GIRTH_M * z)
    assert reported["k_p"] == pytest.approx(slope(z, bearing_n), rel=0.01)
    z *= 1.0 - REVERSAL_FRACTION
    suction = DEEP_FACTOR * EDGE_M2 * np.minimum(z / SUCTION_FADE_M, 1.0)
    assert reported["k_e"] == pytest.approx(slope(z, strength_pa * (suction + ADHESION * GIRTH_M * z)), rel=2e-3)
    force_n = rate_factor(SPEED_M_S) * clay.lateral_n(mean_m, GEOMETRY.plate_width_m)
    assert reported["k_s"] == pytest.approx(force_n / (GEOMETRY.plate_width_m * mean_m**2 / 2.0), rel=1e-6)


@pytest.mark.parametrize("name", COEFFICIENT_OF)
def test_each_coefficient_is_of_its_own_strokes_speed(name: str) -> None:
    slow, quick = (truth(with_stroke(name, stroke(speed_m_s=speed_m_s))).upright for speed_m_s in (0.05, 0.8))
    ratios = {k: quick[k] / slow[k] for k in slow}
    traction = rate_factor(0.8) / rate_factor(0.05)
    assert ratios.pop(COEFFICIENT_OF[name]) == pytest.approx(traction, rel=0.01)  # the carrier's steps
    assert [*ratios.values()] == [1.0, 1.0]


# the flipper's own path


SWEEP_RAD = radians(30.0)


def leaning(depth_m: float = DEPTH_M) -> StrokeTruth:
    return stroke(SWEEP_RAD, GEOMETRY.adduction_rad(SWEEP_RAD, depth_m / 2.0), depth_m)


def arc_row(depth_m: float) -> tuple[float, float]:
    """Return the leverage of the submerged volume, and the moment of edge, narrow sides and adhesion.

    Per radian of adduction each piece of the plate moves (l + u) cos α along the plate and (h - s) cos α outward.
    """
    lift_rad = GEOMETRY.adduction_rad(SWEEP_RAD, depth_m)
    u, s = np.meshgrid(np.linspace(-0.5, 0.5, 41) * GEOMETRY.plate_width_m, np.linspace(0.0, 0.07, 281))
    depths_m = depth_m - u * cos(SWEEP_RAD) * sin(lift_rad) - s * cos(lift_rad)
    piece_m2 = np.where(depths_m > 0.0, (GEOMETRY.plate_width_m / 41) * (0.07 / 281), 0.0)
    along_m = (GEOMETRY.flipper_length_m + u) * cos(SWEEP_RAD)
    outward_m = (GEOMETRY.drop_m - s) * cos(SWEEP_RAD)
    thickness_m = GEOMETRY.plate_thickness_m
    factor = np.minimum(3.0 + (UNIT_WEIGHT_N_M3 / CLAY.strength_pa + MATLOCK_J / thickness_m) * depths_m, DEEP_FACTOR)
    rows_m2 = piece_m2 * thickness_m / GEOMETRY.plate_width_m
    sticking = ADHESION * (2.0 * piece_m2 + rows_m2 * 2.0) * np.hypot(along_m, outward_m)
    wet_m2 = EDGE_M2 * np.mean(piece_m2[0] > 0.0)
    bearing = BEARING_FACTOR * wet_m2 * np.mean(along_m[0][piece_m2[0] > 0.0])
    moment = bearing + np.sum(factor * rows_m2 * np.abs(outward_m)) + np.sum(sticking)
    area_m2 = np.sum(piece_m2)
    centre_m = [np.sum(piece_m2 * each) / area_m2 for each in (along_m, outward_m)]
    return thickness_m * area_m2 * hypot(*centre_m), rate_factor(SPEED_M_S) * CLAY.strength_pa * moment


@pytest.mark.parametrize("depth_m", [0.02, 0.03, 0.045])
def test_along_the_flippers_arc_penetration_is_of_edge_sides_and_adhesion(depth_m: float) -> None:
    """They agree to 2 %, because mud yields only after a millimetre. The face adds no load at any depth."""
    reported = truth(stride(insertion=leaning(depth_m))).leaning["k_p"]
    moments_m4, moments_nm = np.array([arc_row(z) for z in np.linspace(0.0005, depth_m, 60)]).T
    assert reported == pytest.approx(moments_m4 @ moments_nm / (moments_m4 @ moments_m4), rel=0.02)


@pytest.mark.parametrize("clay", [clay_of_water(47.6), clay_of_water(53.1)])
@pytest.mark.parametrize("depth_m", [0.02, 0.03, 0.04, 0.05])
def test_flipper_arc_and_upright_plate_agree_at_any_depth(depth_m: float, clay: Clay) -> None:
    """The face of a leaning plate that went straight down would carry load too: k_p was a third higher at 5 cm."""
    reported = truth(stride(clay, insertion=leaning(depth_m), extraction=leaning(depth_m)))
    assert 1.0 < reported.leaning["k_p"] / reported.upright["k_p"] < 1.07
    assert 0.95 < reported.leaning["k_e"] / reported.upright["k_e"] < 1.0


def test_the_surface_may_lie_below_its_nominal_height() -> None:
    """Only the lean of the plate is larger there."""
    reported = [truth(stride(insertion=leaning(), surface_m=surface_m)).leaning["k_p"] for surface_m in (0.0, 0.003)]
    assert reported[1] == pytest.approx(reported[0], rel=0.02)
    assert reported[1] != reported[0]


def test_in_stance_the_plate_is_square_to_its_path() -> None:
    """The sweep angle passes through zero in stance, so only the adduction makes the flipper lean."""
    turned = stroke(sweep_rad=0.3, adduction_rad=-0.3)
    assert (
        truth(stride(stance=turned)).leaning["k_s"]
        == truth(stride(stance=turned._replace(sweep_rad=0.0))).leaning["k_s"]
    )
    assert truth(stride(stance=turned)).leaning["k_s"] != truth(stride(stance=turned)).upright["k_s"]


@pytest.mark.parametrize("plate", Plates._fields)
def test_mud_with_a_memory_is_as_soft_on_the_way_up_as_the_stance_left_it(plate: str) -> None:
    """Each plate's width of travel takes a factor exp(-Γ) of the structure λ, and the strength goes with 1 + λ.

    They agree to 2 %, because λ is that half-way up, on a straight path.
    """
    mud, path_m = ThixotropicMud(CLAY), 0.1
    of = stride(ground=mud, insertion=leaning(), extraction=leaning())
    slid = replace(of, stance=of.stance._replace(path_m=path_m))
    before, after = (getattr(truth(each), plate) for each in (of, slid))
    loss_per_m = mud.thixotropy.loss_per_strain / GEOMETRY.plate_width_m
    structure = exp(-loss_per_m * (DEPTH_M + DEPTH_M / 2.0))  # half-way up
    softer = (1.0 + structure * exp(-loss_per_m * path_m)) / (1.0 + structure)
    assert after["k_e"] == pytest.approx(softer * before["k_e"], rel=0.02)
    assert (after["k_p"], after["k_s"]) == (before["k_p"], before["k_s"])
    clay = replace(slid, ground=CLAY)
    assert truth(clay) == truth(replace(clay, stance=of.stance))


# strokes that did not happen


@pytest.mark.parametrize("name", COEFFICIENT_OF)
@pytest.mark.parametrize("gone", [NEVER, stroke(deepest_m=0.0), stroke(deepest_m=-0.01)])
def test_a_stroke_that_did_not_happen_has_no_coefficient(name: str, gone: StrokeTruth) -> None:
    for reported in truth(with_stroke(name, gone)):
        assert {*reported} == {*COEFFICIENT_OF.values()} - {COEFFICIENT_OF[name]}


def test_a_plate_that_never_slipped_is_dragged_at_the_papers_speed() -> None:
    held = truth(stride(stance=stroke(speed_m_s=nan)))
    assert held.leaning["k_s"] == truth(stride(stance=stroke(speed_m_s=PAPER_SPEED_M_S))).leaning["k_s"]


def test_relaxation_in_a_hold_is_over_on_the_way_up() -> None:
    """Relaxation reduces the load that carries the resting plate; the upward motion shears the mud again anyway."""
    at_once, held = truth(stride(), 0.13, 0.0).leaning["k_e"], truth(stride(), 0.13, 3.0).leaning["k_e"]
    assert held == pytest.approx(at_once, rel=1e-3)  # k_e begins after 7 mm, seven times the memory
