"""Without buses the robot walks as with them: the same torques at the same times, but for the rounding of frames."""

from math import pi

import pytest

from control.controller import WalkOrder
from control.faults import FaultKind
from control.modes import Mode
from drivers.drive_types import DRIVE_TYPES
from experiments.robot.lockstep_robot import simulated_configuration
from simulation.harness.direct import Direct
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track

ENCODER_STEP_RAD = 2.0 * pi / 16384


def walking(kind: type[Lockstep], strength_pa: float, drive_type: str = "odrive") -> Lockstep:
    track = Track([(10.0, Clay("mud", strength_pa))])
    robot = kind(simulated_configuration(drive_type=drive_type), track, disturbances=LAB)
    robot.run_for(1.0)  # the settings of drives on a bus are known
    robot.arm()
    robot.walk(WalkOrder(0.03, adaptive=True))
    return robot


@pytest.mark.parametrize("strength_pa", [400.0, 3000.0])
def test_it_stays_within_one_step_of_the_encoders_of_lockstep_over_a_stride(strength_pa: float) -> None:
    direct, lockstep = (walking(kind, strength_pa) for kind in (Direct, Lockstep))
    assert direct.tick_number == lockstep.tick_number
    while not lockstep.loop.learning.strides:
        direct.step()
        lockstep.step()
        for angle_rad, other_rad in zip(direct.robot.plant.angles_rad, lockstep.robot.plant.angles_rad, strict=True):
            assert abs(angle_rad - other_rad) < ENCODER_STEP_RAD
        assert direct.robot.plant.body_m == pytest.approx(lockstep.robot.plant.body_m, abs=1e-6)
    assert direct.loop.controller.gait.next_depth_m == pytest.approx(
        lockstep.loop.controller.gait.next_depth_m, abs=1e-5
    )
    for own, other in zip(direct.loop.learning.strides, lockstep.loop.learning.strides, strict=True):
        assert own.estimate.k_s.value == pytest.approx(other.estimate.k_s.value, rel=1e-3, nan_ok=True)


@pytest.mark.parametrize("drive_type", DRIVE_TYPES)
def test_a_joint_out_of_its_range_ends_the_walk_with_drives_of_any_type(drive_type: str) -> None:
    direct = walking(Direct, 1000.0, drive_type)
    direct.run_for(0.5)
    assert direct.loop.mode is Mode.WALKING and not direct.loop.faults.present
    direct.robot.plant.arms[0].sweep_rad = 1.6
    direct.run_for(0.1)
    assert direct.loop.mode is not Mode.WALKING
    assert direct.loop.fault is not None and direct.loop.fault.kind is FaultKind.JOINT_POSITION


def test_an_emergency_stop_takes_the_torque() -> None:
    direct = walking(Direct, 1000.0)
    direct.robot.turn_emergency_stop()
    direct.run_for(0.1)
    assert direct.robot.drives.map(lambda drive: drive.torque_nm(direct.now_s)) == (0.0,) * 4
