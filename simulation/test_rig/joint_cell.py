"""A load cell in a flipper's adduction joint: the plate carried along its own arc, and what the mud does to it there.

A stage that pushes a leaning plate straight down presses its face through the mud, and part of that load points up:
nothing in 2 cm of clay, a seventh of the whole at 5 cm. A flipper's plate moves down along an arc on which it leans
more and more, and the load on its face is no part of k_p and k_e (plate_integrals.py). So here the joint turns the
plate at one sweep angle, with one speed of its lower edge and in equal steps of depth, and the cell reads the moment of
all forces within the plate's plane. The contact model is the same as under the robot.
"""

from math import ceil, degrees, hypot

from control.geometry import FlipperGeometry
from control.plate_integrals import stroke_moment_m4, submerged_plate
from simulation.mud.flipper_contact import ArmMotion, attitude_of, contact_force, contact_of, plate_size, twist_of
from simulation.mud.ground_contact import Ground
from simulation.test_rig.load_cell import Curve, LoadCell

STEP_M = 0.0001
SLIDE_STEP_M = 0.001
HOLD_STEP_S = 0.0005


class JointCell:
    """Owns the plate on its arm: its angle and its contact."""

    def __init__(
        self, ground: Ground, geometry: FlipperGeometry, sweep_rad: float, surface_m: float, relaxation: float
    ) -> None:
        self._ground = ground
        self._geometry = geometry
        self._sweep_rad = sweep_rad
        self._surface_m = surface_m
        self._plate = contact_of(ground, plate_size(geometry), relaxation)
        self.clear_m = -max(abs(outward_m) for outward_m, _ in geometry.plate.corners)  # all corners out, at any lean
        self._adduction_rad = self._angle_at_rad(self.clear_m)
        self._depth_m = self.clear_m

    def _angle_at_rad(self, depth_m: float) -> float:
        return self._geometry.adduction_rad(self._sweep_rad, depth_m + self._surface_m)

    def lower(self, to_depth_m: float, speed_m_s: float) -> Curve:
        """Move down or up, at most to the arm's reach, in whole steps of depth."""
        deepest_m = self._geometry.deepest_m(degrees(abs(self._sweep_rad))) - self._surface_m
        from_m, path_m = self._depth_m, min(to_depth_m, deepest_m) - self._depth_m
        steps = max(1, round(abs(path_m) / STEP_M))
        curve: Curve = []
        for step in range(1, steps + 1):
            self._depth_m = from_m + path_m * step / steps
            lifting_nm = self._turn(self._angle_at_rad(self._depth_m), speed_m_s)
            plate = submerged_plate(self._geometry, self._sweep_rad, self._adduction_rad, self._surface_m)
            curve.append((self._depth_m, stroke_moment_m4(self._geometry, plate, self._sweep_rad), lifting_nm))
        return curve

    def slide(self, path_m: float, speed_m_s: float) -> None:
        """Move the plate back across its face, in place."""
        steps = ceil(path_m / SLIDE_STEP_M)
        for _ in range(steps):
            self._step(path_m / steps / speed_m_s, 0.0, -speed_m_s / self._geometry.flipper_length_m)

    def hold(self, hold_s: float) -> None:
        for _ in range(round(hold_s / HOLD_STEP_S)):
            self._step(HOLD_STEP_S, 0.0)

    def _turn(self, angle_rad: float, speed_m_s: float) -> float:
        geometry, turn_rad = self._geometry, angle_rad - self._adduction_rad
        unit = twist_of(geometry, ArmMotion(self._sweep_rad, angle_rad, adduction_rad_s=1.0))
        path_m = abs(turn_rad) * hypot(unit.normal_m_s, unit.outward_m_s, unit.upward_m_s)
        self._adduction_rad = angle_rad
        return self._step(path_m / speed_m_s, turn_rad)

    def _step(self, dt_s: float, turn_rad: float, sweep_rad_s: float = 0.0) -> float:
        geometry, sweep_rad = self._geometry, self._sweep_rad
        attitude = attitude_of(geometry, sweep_rad, self._adduction_rad, self._surface_m)
        twist = twist_of(geometry, ArmMotion(sweep_rad, self._adduction_rad, sweep_rad_s, turn_rad / dt_s))
        wrench = self._plate.step(dt_s, self._ground, attitude, twist)
        within = wrench._replace(normal_n=0.0, normal_outward_nm=0.0, normal_upward_nm=0.0)
        return contact_force(geometry, sweep_rad, within).adduction_nm


def measure_stroke(
    cell: LoadCell | JointCell, depth_m: float, speed_m_s: float, hold_s: float = 0.0, slide_m: float = 0.0
) -> tuple[Curve, Curve]:
    """Measure from just above the mud down to a depth, and after a slide across the face and a hold up again."""
    down = cell.lower(depth_m, speed_m_s)
    cell.slide(slide_m, speed_m_s)
    cell.hold(hold_s)
    return down, cell.lower(cell.clear_m, speed_m_s)
