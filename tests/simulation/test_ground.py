"""Stones, ridges, layers and random strength of the ground act on the robot's arms and body."""

from math import pi
from random import Random

import pytest

from control.geometry import FlipperGeometry
from control.records import Joints
from simulation.body.plant import STEP_S, Arm, Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.mud.clay import MUDS, Clay
from simulation.mud.disturbances import Disturbances
from simulation.mud.flipper_contact import ContactForce, attitude_of, plate_size
from simulation.mud.layer import Layer
from simulation.mud.rigid_plate import lowest_point_m
from simulation.mud.stones import Stone
from simulation.mud.track import LEVEL, Track
from simulation.mud.unevenness import Ridges
from tests.control.synthetic_states import NO_TORQUE


def press(plant: Plant, lift_nm: float) -> Plant:
    """Apply the same adduction torque to both arms for a second."""
    for _ in range(1000):
        plant.step(STEP_S, Joints(0.0, lift_nm, 0.0, lift_nm))
    return plant


def pressed_arm(track: Track, lift_nm: float) -> Arm:
    """Return an arm of a fixed body after it was pressed down for a second at the start of the track."""
    return press(Plant(PlantParameters(fixed_base=True), track), lift_nm).arms[0]


def depth_m(arm: Arm) -> float:
    return lowest_m(arm.parameters.geometry, arm.sweep_rad, arm.adduction_rad)


def lowest_m(geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float) -> float:
    return lowest_point_m(attitude_of(geometry, sweep_rad, adduction_rad), plate_size(geometry))


@pytest.mark.parametrize("lift_nm", [-0.2, -1.66])
def test_a_flipper_that_comes_down_on_a_stone_stops_there(lift_nm: float) -> None:
    """The torque is up to that of 20 A, which sinks it deeper next to the stone; 1 mm of the stone's spring is 20 N."""
    soft = [(9.0, MUDS["53.1"])]
    other, arm = (pressed_arm(Track(soft, [Stone(start_m, 9.0, 0.02)]), lift_nm) for start_m in (0.01, -0.01))
    assert depth_m(other) > 0.025
    assert 0.0 < depth_m(arm) - 0.02 < 0.001
    assert arm.adduction_velocity_rad_s == pytest.approx(0.0, abs=1e-6)


def test_a_stone_acts_in_addition_to_the_mud_and_only_at_its_position() -> None:
    """The arm is half a millimetre below the stone's top, in mud, or in a trough so deep that there is no mud."""
    geometry, sunk_rad = PlantParameters().geometry, -0.4
    stone = Stone(0.5, 0.6, lowest_m(geometry, 0.0, sunk_rad) - 0.0005)

    def force(stones: list[Stone], body_m: float, surface_m: float) -> ContactForce:
        arm = Plant(PlantParameters(), Track([(9.0, MUDS["48.5"])], stones)).arms[0]
        arm.adduction_rad, arm.adduction_velocity_rad_s, arm.history.surface_m = sunk_rad, -0.1, surface_m
        arm.step(STEP_S, body_m, 0.0, 0.0, 0.0)
        return arm.force

    without, elsewhere = force([], 0.55, 0.0), force([stone], 0.4, 0.0)
    assert elsewhere == without
    of_stone = force([stone], 0.55, 0.1)
    assert of_stone.adduction_nm > 0.5
    assert force([stone], 0.55, 0.0) == pytest.approx([a + b for a, b in zip(without, of_stone, strict=True)])


def test_ridges_lift_the_mud_under_each_flipper_by_its_own_position_on_top_of_its_own_unevenness() -> None:
    """The flippers are a quarter of a ridge to the front and the rear."""
    disturbed = PlantParameters(disturbances=Disturbances(surface_sd_m=0.001))
    level, ridged = (
        Plant(disturbed, Track([(9.0, MUDS["48.5"])], ridges=ridges), Random(3))
        for ridges in (LEVEL, Ridges(0.005, 0.48))
    )
    for plant in (level, ridged):
        for arm, sweep_rad in zip(plant.arms, (pi / 2.0, -pi / 2.0), strict=True):
            arm.sweep_rad = sweep_rad
        plant.step(STEP_S, NO_TORQUE)
    lifts_m = [plain.surface_m - lifted.surface_m for plain, lifted in zip(level.arms, ridged.arms, strict=True)]
    assert lifts_m == pytest.approx([0.005, -0.005])


def test_a_crust_carries_an_arm_that_sinks_without_it() -> None:
    """The arm weighs 0.4 N at the plate; this mud without a crust carries 0.1 N."""
    soup = Clay("soup", 200.0)
    sunk = pressed_arm(Track([(9.0, soup)]), 0.0)
    crusted = pressed_arm(Track([(9.0, soup._replace(layers=(Layer(0.0, 0.005, 10.0),)))]), 0.0)
    assert depth_m(crusted) < 0.005 < depth_m(sunk)
