"""On a bench the torques of arm and weight equal the slope of their potential energy, and no energy is created."""

from math import cos, sin

import pytest

from control.parameters.arm_mass import GRAVITY_M_S2, ArmMass
from simulation.body.bench_mount import BenchMount
from simulation.body.plant import Arm, Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.mud.track import paper_track

ARM = ArmMass()
each_side = pytest.mark.parametrize("on_side", [False, True])


def energy_j(mount: BenchMount, sweep_rad: float, adduction_rad: float) -> float:
    moment_kg_m = ARM.arm_mass_kg * ARM.center_of_mass_m + mount.mass_kg * mount.lever_m
    return GRAVITY_M_S2 * moment_kg_m * (sin(sweep_rad) if mount.on_side else cos(sweep_rad) * sin(adduction_rad))


def loaded(on_side: bool) -> BenchMount:
    mount = BenchMount(on_side)
    mount.hang(0.4, 0.115)
    return mount


def arm_on(mount: BenchMount) -> Arm:
    arm = Plant(PlantParameters(joint_friction_nm_s=0.0), paper_track()).arms[1]
    arm.mount = mount
    arm.put_back()
    return arm


@each_side
@pytest.mark.parametrize("pose", [(0.0, 0.0), (0.3, -0.2), (-0.5, 0.4), (0.1, -0.9)])
def test_gravity_is_the_slope_of_the_height(on_side: bool, pose: tuple[float, float]) -> None:
    mount, (a, b), step = loaded(on_side), pose, 1e-6
    slopes = (
        energy_j(mount, a + step, b) - energy_j(mount, a - step, b),
        energy_j(mount, a, b + step) - energy_j(mount, a, b - step),
    )
    expected = [-slope / (2.0 * step) for slope in slopes]
    assert mount.gravity_torques_nm(ARM, a, b) == pytest.approx(expected, abs=1e-6)


@each_side
def test_a_released_weight_falls_without_making_energy(on_side: bool) -> None:
    mount = loaded(on_side)
    arm = arm_on(mount)
    for _ in range(1000):
        arm.step(0.0001, 0.0, 0.0, 0.0, 0.0)
    speeds_rad_s = (arm.adduction_velocity_rad_s, arm.sweep_velocity_rad_s)
    fallen_j = -energy_j(mount, arm.sweep_rad, arm.adduction_rad)
    assert fallen_j > 0.05
    inertia_kg_m2 = mount.inertias_kg_m2(ARM)[0 if on_side else 1]
    assert 0.5 * inertia_kg_m2 * speeds_rad_s[on_side] ** 2 == pytest.approx(fallen_j, rel=0.02)


def test_a_removed_weight_exerts_no_torque_and_a_weight_is_a_number() -> None:
    mount = loaded(False)
    mount.take_off()
    assert mount.gravity_torques_nm(ARM, 0.2, -0.3) == ARM.gravity_torques_nm(0.2, -0.3)
    assert mount.inertias_kg_m2(ARM) == (ARM.sweep_inertia_kg_m2, ARM.adduction_inertia_kg_m2)
    for mass_kg, lever_m in ((-0.1, 0.1), (0.1, float("nan"))):
        with pytest.raises(ValueError, match="at least 0"):
            mount.hang(mass_kg, lever_m)
