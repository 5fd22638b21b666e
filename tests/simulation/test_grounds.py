"""A robot walks from one kind of ground on to another."""

from control.controller import WalkOrder
from experiments.robot.lockstep_robot import simulated_configuration
from simulation.harness.direct import Direct
from simulation.mud.clay import Clay
from simulation.mud.grounds.sand import Sand
from simulation.mud.grounds.sand_contact import SandContact
from simulation.mud.grounds.thixotropic_mud import ThixotropicContact, ThixotropicMud
from simulation.mud.track import Track


def test_a_robot_walks_from_clay_over_thixotropic_mud_on_to_sand() -> None:
    clay = Clay("clay", 1500.0)
    track = Track([(0.02, clay), (0.15, ThixotropicMud(clay)), (9.0, Sand("sand", 1.55e6))])
    robot, met = Direct(simulated_configuration(), track), set[type]()
    robot.arm()
    robot.walk(WalkOrder(0.03, adaptive=False))
    while robot.robot.plant.body_m < 0.17 and robot.now_s < 12.0:
        robot.run_for(0.25)
        met.add(type(robot.robot.plant.arms[0].contact.plate))
    assert {ThixotropicContact, SandContact} < met
    assert robot.robot.plant.body_m > 0.17 and not robot.loop.fault
