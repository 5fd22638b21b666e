"""A robot on blocks, as for the bench: its base does not move, and idle flippers lie on something soft below it."""

from dataclasses import replace
from math import radians

from control.geometry import FlipperGeometry
from firmware_host.configuration.configuration import Configuration
from simulation.harness.world import World
from simulation.mud.clay import Clay
from simulation.mud.track import Track

RESTING_RAD = radians(-30.0)  # adduction of idle flippers, which lie lower than the robot on its blocks
CUSHION = Track([(1.0, Clay("cushion", 1e3))])  # supports an idle arm and yields under a falling one


def resting_drop_m(geometry: FlipperGeometry) -> float:
    """Return how far below its axis an idle flipper's edge should lie on the bench."""
    return -geometry.edge_position(0.0, RESTING_RAD)[2]


def on_blocks(configuration: Configuration) -> World:
    """Make the world of a bench, with realistic drives: some lag, some cogging, and delayed messages."""
    geometry = replace(configuration.geometry, axis_height_m=resting_drop_m(configuration.geometry))
    robot = {"fixed_base": True, "geometry": geometry, "joint_coulomb_nm": 0.005}
    drives = {"current_lag_s": 0.0005, "cogging_nm": 0.003, "message_delay_s": 0.0005}
    return World(CUSHION, robot_changes=robot, drive_changes=drives)
