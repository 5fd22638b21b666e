"""A robot on blocks, as the bench wants it: its base stands still, and idle flippers lie on something soft below it."""

from __future__ import annotations

from dataclasses import replace
from math import radians

from control.geometry import FlipperGeometry
from firmware_host.configuration.configuration import Configuration
from simulation.harness.world import World
from simulation.mud.clay import Clay
from simulation.mud.track import Track

LYING_RAD = radians(-30.0)  # adduction of idle flippers: blocks lift the robot above what they lie on
CUSHION = Track([(1.0, Clay("cushion", 1e3))])  # bears an idle arm, and gives way to one that falls


def lying_m(geometry: FlipperGeometry) -> float:
    """How far below its axis an idle flipper's edge should lie on the bench."""
    return -geometry.edge_position(0.0, LYING_RAD)[2]


def on_blocks(configuration: Configuration) -> World:
    """With drives that are neither ideal nor odd: some lag, some cogging, messages that come when they come."""
    geometry = replace(configuration.geometry, axis_height_m=lying_m(configuration.geometry))
    robot = {"fixed_base": True, "geometry": geometry, "joint_coulomb_nm": 0.005}
    drives = {"current_lag_s": 0.0005, "cogging_nm": 0.003, "message_delay_s": 0.0005}
    return World(CUSHION, robot_changes=robot, drive_changes=drives)
