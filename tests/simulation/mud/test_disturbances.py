"""Each disturbance has its stated effect on the mud, the arm or the drives, and none if it is off."""

from dataclasses import replace
from math import exp, hypot
from random import Random
from statistics import mean, pstdev

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from control.records import Joints
from simulation.body.plant import STEP_S, Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.mud.clay import MUDS
from simulation.mud.disturbances import (
    CLINGING_ABOVE_EDGE_M,
    LAB,
    Disturbances,
    StrokeHistory,
    clinging_torques_nm,
)
from simulation.mud.track import Track

GEOMETRY = FlipperGeometry()
ABOVE_M = -0.014  # where the plate swings
SOFT = Track([(5.0, MUDS["53.1"])])


def history_of(**disturbances: float) -> StrokeHistory:
    return StrokeHistory(Disturbances(**disturbances), 1)


def lowered(history: StrokeHistory, position_m: float = 0.0, depth_m: float = 0.02) -> StrokeHistory:
    history.step(ABOVE_M, position_m)
    history.step(depth_m, position_m)
    return history


def raised(history: StrokeHistory) -> StrokeHistory:
    for _ in range(2):
        history.step(ABOVE_M, 0.0)
    return history


def stroke(history: StrokeHistory, depth_m: float = 0.03) -> StrokeHistory:
    return raised(lowered(history, depth_m=depth_m))


# clinging mud


@given(st.floats(-0.6, 0.6), st.floats(-1.2, 0.5))
def test_clinging_mud_pulls_at_the_joints_as_a_weight_on_the_plate(sweep_rad: float, adduction_rad: float) -> None:
    """The reference is the slope of the weight's potential energy; the weight is 15 mm above the edge."""
    upright = replace(GEOMETRY, drop_m=GEOMETRY.drop_m - CLINGING_ABOVE_EDGE_M)
    slopes = upright.jacobian(sweep_rad, adduction_rad)
    torques_nm = (-0.7 * slopes.z_sweep, -0.7 * slopes.z_adduction)
    assert clinging_torques_nm(GEOMETRY, sweep_rad, adduction_rad, 0.7) == pytest.approx(torques_nm, abs=1e-12)


def test_each_extraction_takes_another_amount_of_mud_along_whose_weight_scatters_evenly() -> None:
    history, shaken = history_of(clinging_n=1.0), history_of(clinging_n=1.0, shaken_fraction=1.0)
    amounts_n = []
    for _ in range(2000):
        before_n = history.clinging_n
        assert lowered(history).clinging_n == before_n  # until the extraction
        amounts_n.append(raised(history).clinging_n)
        assert stroke(shaken).clinging_n == amounts_n[-1] != before_n  # after any loss
    assert mean(amounts_n) == pytest.approx(1.0, abs=0.02)  # four standard errors
    assert pstdev(amounts_n) == pytest.approx(0.4 / 3.0**0.5, rel=0.05)
    assert [min(amounts_n), max(amounts_n)] == pytest.approx([0.6, 1.4], abs=0.01)


@pytest.mark.parametrize(
    ("shaken_fraction", "heights_m", "remaining"),
    [
        (0.3, (0.014, 0.0105, 0.007, 0.0, -0.02), (1.0, 0.925, 0.85, 0.7, 0.7)),  # in the mud it stays
        (0.3, (0.007, 0.010, 0.014, 0.014), (1.0,) * 4),  # and while the flipper rises and swings
        (0.3, (0.014, 0.007, 0.012, 0.014, 0.007, 0.028, 0.014), (1.0, *[0.85] * 6)),  # half a longer path, once
        (1.0, (0.001, 0.0008, 0.001, 0.0008), (1.0, 0.96, 0.96, 0.96)),  # trembling just above the mud
    ],
)
def test_mud_falls_off_on_the_way_down_in_proportion_to_it(
    shaken_fraction: float, heights_m: tuple[float, ...], remaining: tuple[float, ...]
) -> None:
    history = lowered(history_of(clinging_n=0.7, shaken_fraction=shaken_fraction))
    history.step(-0.001, 0.0)
    weight_n = history.clinging_n
    for height_m, fraction in zip(heights_m, remaining, strict=True):
        history.step(-height_m, 0.0)
        assert history.clinging_n == pytest.approx(fraction * weight_n)


# remoulding


@pytest.mark.parametrize("depth_m", [0.004, 0.006])
def test_a_touch_of_less_than_half_a_centimetre_is_no_stroke(depth_m: float) -> None:
    history = stroke(history_of(clinging_n=0.7, remoulding=1.0), depth_m)
    counts = depth_m > 0.005
    assert ((history.clinging_n > 0.0), (lowered(history).firmness < 1.0)) == (counts, counts)


@pytest.mark.parametrize("remoulding", [1.0, 0.5])
def test_strokes_at_the_same_position_find_softer_mud(remoulding: float) -> None:
    history = history_of(remoulding=remoulding)
    for earlier in range(8):
        assert lowered(history).firmness == pytest.approx(1.0 - remoulding * 0.5 * (1.0 - exp(-0.4 * earlier)))
        raised(history)


def test_a_stroke_s_mud_is_that_of_its_entry_within_a_centimetre_and_a_half() -> None:
    for position_m, earlier in ((0.0, 1), (0.014, 1), (-0.014, 1), (0.016, 0), (-0.12, 0)):
        history = lowered(stroke(history_of(remoulding=1.0)), position_m)
        for slipped_m in (0.0, -0.02, -0.06):
            history.step(0.02, position_m + slipped_m)
            assert history.firmness == pytest.approx(0.5 + 0.5 * exp(-0.4 * earlier))


# surfaces


def surfaces_m(history: StrokeHistory, strokes: int) -> list[float]:
    found_m = []
    for _ in range(strokes):
        found_m.append(lowered(history).surface_m)
        raised(history)
    return found_m


def test_every_stroke_meets_its_own_surface() -> None:
    found_m = surfaces_m(history_of(surface_sd_m=0.0015), 2000)
    assert len(set(found_m)) == len(found_m)
    assert mean(found_m) == pytest.approx(0.0, abs=1.4e-4)  # four standard errors
    assert pstdev(found_m) == pytest.approx(0.0015, rel=0.07)
    moved = StrokeHistory(Disturbances(surface_sd_m=0.0015), 1, trial_surface_m=0.002)
    differences_m = [b - a for a, b in zip(found_m[:50], surfaces_m(moved, 50), strict=True)]
    assert differences_m == pytest.approx([0.002] * 50)
    assert surfaces_m(StrokeHistory(LAB, 1), 50) == found_m[:50]  # other disturbances change no draws


def test_a_trial_s_surface_is_common_to_both_flippers_and_scatters_from_trial_to_trial() -> None:
    trial, both = Disturbances(trial_surface_sd_m=0.0008), Disturbances(surface_sd_m=0.0015, trial_surface_sd_m=0.0008)
    found_m: dict[Disturbances, list[float]] = {trial: [], both: []}
    for disturbances, depths_m in found_m.items():
        for seed in range(1000):
            left_m, right_m = (
                arm.surface_m for arm in Plant(PlantParameters(disturbances=disturbances), SOFT, Random(seed)).arms
            )
            depths_m.append(left_m)
            assert (left_m == right_m) is (disturbances == trial)
    assert mean(found_m[trial]) == pytest.approx(0.0, abs=1.1e-4)  # four standard errors
    assert pstdev(found_m[trial]) == pytest.approx(0.0008, rel=0.09)
    assert pstdev(found_m[both]) == pytest.approx(both.surface_error_m, rel=0.09)
    assert both.surface_error_m == hypot(0.0015, 0.0008)


def test_a_seed_repeats_its_history_after_a_reset_and_another_seed_differs() -> None:
    first, second, other = (StrokeHistory(LAB, seed) for seed in (1, 1, 2))
    found_m = surfaces_m(first, 5)
    assert surfaces_m(second, 5) == found_m != surfaces_m(other, 5)
    first.reset()
    assert (first.clinging_n, first.firmness) == (0.0, 1.0)
    assert surfaces_m(first, 5) == found_m


# friction


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("joint", ["sweep", "adduction"])
def test_friction_adds_to_that_of_the_plant_and_holds_one_resting_joint(joint: str, direction: float) -> None:
    """Above it the other torque accelerates the joint as a torque without friction does."""
    speeds_rad_s = []
    for friction_nm, torque_nm in ((0.05, 0.0499), (0.05, 0.06), (0.02, 0.03)):
        disturbances = Disturbances(**{f"{joint}_friction_nm": friction_nm - 0.02})
        parameters = PlantParameters(
            disturbances=disturbances,
            joint_coulomb_nm=0.02,
            arm_mass=replace(PlantParameters().arm_mass, arm_mass_kg=0.0),
        )
        plant = Plant(parameters, SOFT)
        for arm in plant.arms:
            arm.adduction_rad = 1.0  # far above the mud
        torques_nm = (torque_nm, 0.0) if joint == "sweep" else (0.0, torque_nm)
        plant.step(STEP_S, Joints(*(direction * each for each in torques_nm * 2)))
        speeds_rad_s.append([getattr(arm, f"{joint}_velocity_rad_s") for arm in plant.arms])
    held, moved, same = speeds_rad_s
    assert held == [0.0, 0.0] and direction * moved[0] > 0.0
    assert moved == pytest.approx(same)
