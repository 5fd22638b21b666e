"""A load cell in a flipper's adduction joint: the plate carried along its own arc, and what the mud does to it there.

A stage that pushes a leaning plate straight down presses its face through the mud, and part of that load points up:
nothing in 2 cm of clay, a seventh of the whole at 5 cm. A flipper's plate moves down along an arc on which it leans
more and more, and the load on its face is no part of k_p and k_e (control/plate). So here the joint turns the plate
at one sweep angle, with one speed of its lower edge and in equal steps of depth, and the cell reads the moment of all
forces within the plate's plane. The contact model is the same as under the robot.
"""

from math import degrees, hypot
from typing import NamedTuple

from control.geometry import FlipperGeometry
from control.plate_integrals import stroke_moment_m4, submerged_plate
from simulation.mud.clay import Clay
from simulation.mud.flipper_contact import ArmMotion, attitude_of, contact_force, plate_size, twist_of
from simulation.mud.plate_contact import PlateContact

STEP_M = 0.0001
HOLD_STEP_S = 0.0005


class ArcCurve(NamedTuple):
    """One pose after the other, in the order of time."""

    depths_m: list[float]  # of the lower edge's middle below the surface
    moments_m4: list[float]  # Φ of control/plate
    moments_nm: list[float]  # that lift the plate


class ArcStroke(NamedTuple):
    down: ArcCurve
    up: ArcCurve


class JointCell:
    """Owns the plate on its arm: its angle and its contact."""

    def __init__(
        self, clay: Clay, geometry: FlipperGeometry, sweep_rad: float, surface_m: float, relaxation: float
    ) -> None:
        self._clay = clay
        self._geometry = geometry
        self._sweep_rad = sweep_rad
        self._surface_m = surface_m
        self._plate = PlateContact(plate_size(geometry), relaxation)
        self.clear_m = -max(abs(outward_m) for outward_m, _ in geometry.plate.corners)  # all corners out, at any lean
        self._adduction_rad = self._angle_at_rad(self.clear_m)
        self._depth_m = self.clear_m

    @property
    def deepest_m(self) -> float:
        """The greatest depth below the surface that the arm reaches."""
        return self._geometry.deepest_m(degrees(abs(self._sweep_rad))) - self._surface_m

    def _angle_at_rad(self, depth_m: float) -> float:
        return self._geometry.adduction_rad(self._sweep_rad, depth_m + self._surface_m)

    def move(self, to_depth_m: float, speed_m_s: float) -> ArcCurve:
        """Move down or up, in whole steps of depth."""
        from_m, path_m = self._depth_m, to_depth_m - self._depth_m
        steps = max(1, round(abs(path_m) / STEP_M))
        curve = ArcCurve([], [], [])
        for step in range(1, steps + 1):
            self._depth_m = from_m + path_m * step / steps
            curve.moments_nm.append(self._turn(self._angle_at_rad(self._depth_m), speed_m_s))
            plate = submerged_plate(self._geometry, self._sweep_rad, self._adduction_rad, self._surface_m)
            curve.moments_m4.append(stroke_moment_m4(self._geometry, plate, self._sweep_rad))
            curve.depths_m.append(self._depth_m)
        return curve

    def hold(self, hold_s: float) -> None:
        for _ in range(round(hold_s / HOLD_STEP_S)):
            self._step(HOLD_STEP_S, 0.0)

    def _turn(self, angle_rad: float, speed_m_s: float) -> float:
        geometry, turn_rad = self._geometry, angle_rad - self._adduction_rad
        unit = twist_of(geometry, ArmMotion(self._sweep_rad, angle_rad, adduction_rad_s=1.0))
        path_m = abs(turn_rad) * hypot(unit.normal_m_s, unit.outward_m_s, unit.upward_m_s)
        self._adduction_rad = angle_rad
        return self._step(path_m / speed_m_s, turn_rad)

    def _step(self, dt_s: float, turn_rad: float) -> float:
        geometry, sweep_rad = self._geometry, self._sweep_rad
        attitude = attitude_of(geometry, sweep_rad, self._adduction_rad, self._surface_m)
        twist = twist_of(geometry, ArmMotion(sweep_rad, self._adduction_rad, adduction_rad_s=turn_rad / dt_s))
        wrench = self._plate.step(dt_s, self._clay, attitude, twist)
        within = wrench._replace(normal_n=0.0, normal_outward_nm=0.0, normal_upward_nm=0.0)
        return contact_force(geometry, sweep_rad, within).adduction_nm


def measure_arc(
    clay: Clay,
    geometry: FlipperGeometry,
    sweep_rad: float,
    surface_m: float,
    depth_m: float,
    speed_m_s: float,
    relaxation: float = 0.0,
    hold_s: float = 0.0,
) -> ArcStroke:
    """Measure from free air down to `depth_m` below the surface, or to the arm's reach; after a hold, up again."""
    cell = JointCell(clay, geometry, sweep_rad, surface_m, relaxation)
    down = cell.move(min(depth_m, cell.deepest_m), speed_m_s)
    cell.hold(hold_s)
    return ArcStroke(down, cell.move(cell.clear_m, speed_m_s))
