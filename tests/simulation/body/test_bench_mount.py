"""On a bench the torques of arm and weight equal the slope of their potential energy, and no energy is created."""

from __future__ import annotations

from math import cos, sin

import pytest

from control.parameters.arm_mass import GRAVITY_M_S2, ArmMass
from simulation.body.bench_mount import BenchMount
from simulation.body.plant import Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.mud.track import paper_track

ARM = ArmMass()
MASS_KG, LEVER_M = 0.4, 0.115
POSES = [(0.0, 0.0), (0.3, -0.2), (-0.5, 0.4), (0.1, -0.9)]


def height_m(on_side: bool, radius_m: float, sweep_rad: float, adduction_rad: float) -> float:
    return radius_m * (sin(sweep_rad) if on_side else cos(sweep_rad) * sin(adduction_rad))


def energy_j(mount: BenchMount, sweep_rad: float, adduction_rad: float) -> float:
    arm_j = ARM.arm_mass_kg * height_m(mount.on_side, ARM.center_of_mass_m, sweep_rad, adduction_rad)
    return GRAVITY_M_S2 * (arm_j + mount.mass_kg * height_m(mount.on_side, mount.lever_m, sweep_rad, adduction_rad))


@pytest.mark.parametrize("on_side", [False, True])
@pytest.mark.parametrize("pose", POSES)
def test_gravity_is_the_slope_of_the_height(on_side: bool, pose: tuple[float, float]) -> None:
    mount, step = BenchMount(on_side), 1e-6
    mount.hang(MASS_KG, LEVER_M)
    sweep_rad, adduction_rad = pose
    slopes = (
        (energy_j(mount, sweep_rad + step, adduction_rad) - energy_j(mount, sweep_rad - step, adduction_rad)),
        (energy_j(mount, sweep_rad, adduction_rad + step) - energy_j(mount, sweep_rad, adduction_rad - step)),
    )
    expected = [-slope / (2.0 * step) for slope in slopes]
    assert mount.gravity_torques_nm(ARM, sweep_rad, adduction_rad) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("on_side", [False, True])
def test_a_released_weight_falls_without_making_energy(on_side: bool) -> None:
    plant = Plant(PlantParameters(joint_friction_nm_s=0.0), paper_track())
    arm, mount = plant.arms[1], BenchMount(on_side)
    arm.mount = mount
    arm.put_back()
    mount.hang(MASS_KG, LEVER_M)
    inertia = mount.inertias_kg_m2(ARM)[0 if on_side else 1]
    for _ in range(1000):
        arm.step(0.0001, 0.0, 0.0, 0.0, 0.0)
    speed = arm.sweep_velocity_rad_s if on_side else arm.adduction_velocity_rad_s
    fallen_j = -energy_j(mount, arm.sweep_rad, arm.adduction_rad)
    assert fallen_j > 0.05
    assert 0.5 * inertia * speed**2 == pytest.approx(fallen_j, rel=0.02)


def test_a_held_arm_stays_under_any_torque() -> None:
    arm = Plant(PlantParameters(), paper_track()).arms[0]
    arm.mount = BenchMount(held=True)
    arm.put_back()
    arm.mount.hang(5.0, 0.2)
    for _ in range(100):
        arm.step(0.001, 0.0, 0.0, 1.0, -1.0)
    assert (arm.sweep_rad, arm.adduction_rad, arm.adduction_velocity_rad_s) == (0.0, 0.0, 0.0)


def test_a_removed_weight_exerts_no_torque() -> None:
    mount = BenchMount()
    mount.hang(MASS_KG, LEVER_M)
    mount.take_off()
    assert mount.gravity_torques_nm(ARM, 0.2, -0.3) == ARM.gravity_torques_nm(0.2, -0.3)
    assert mount.inertias_kg_m2(ARM) == (ARM.sweep_inertia_kg_m2, ARM.adduction_inertia_kg_m2)


def test_a_weight_is_a_number() -> None:
    with pytest.raises(ValueError, match="at least 0"):
        BenchMount().hang(-0.1, 0.1)
    with pytest.raises(ValueError, match="at least 0"):
        BenchMount().hang(0.1, float("nan"))
