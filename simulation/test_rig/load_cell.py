"""A plate on a load cell: the force of a mud on a flipper's plate, measured without the flipper.

As in a laboratory's reference measurement, a stiff carrier moves the plate straight through the mud, at a constant
speed and in a fixed attitude, and records force against depth. An estimate that a flipper makes with its joints and
motors is compared with that. The contact model is the same as under the robot. The surface is at depth 0, depths are
those of the middle of the lower edge, forces are the mud's on the plate.

With x forward, y outward, z up, a plate at the sweep angle α and the adduction angle β has its normal, its lower edge
and its height along

    n = (cos α, -sin α cos β, -sin α sin β)    r = (sin α, cos α cos β, cos α sin β)    s = (0, -sin β, cos β)
"""

from math import ceil, cos, fsum

from control.geometry import FlipperGeometry
from control.plate_integrals import submerged_part
from simulation.mud.carriage import plate_directions
from simulation.mud.flipper_contact import contact_of, plate_size
from simulation.mud.ground_contact import Ground
from simulation.mud.mud_springs import SIDEWAYS_YIELD_M
from simulation.mud.rigid_plate import Attitude, Twist, lowest_point_m

STEP_S = 0.0005


# depth, submerged volume and upward force in the order of time; of a joint's cell Φ (plate_integrals.py) and the moment
Curve = list[tuple[float, float, float]]


class LoadCell:
    """Owns the plate on its carrier: its depth and its contact."""

    def __init__(
        self, ground: Ground, geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float, relaxation: float = 0.0
    ) -> None:
        self.axes = plate_directions(sweep_rad, adduction_rad)
        self.ground, self._geometry = ground, geometry
        self.plate = contact_of(ground, plate_size(geometry), relaxation)
        self._upright = Attitude(0.0, -self.axes[1][2], self.axes[2][2], -self.axes[0][2])
        self.clear_m = -lowest_point_m(self._upright, self.plate.size)  # depth at which the plate is just out
        self.reset()

    def reset(self) -> None:
        self.plate.reset()
        self.depth_m = self.clear_m

    def step(self, dt_s: float, forward_m_s: float, upward_m_s: float) -> tuple[float, float]:
        """Return the force (forward, upward) at the end of a step of this motion."""
        self.depth_m -= dt_s * upward_m_s
        twist = Twist(*(axis[0] * forward_m_s + axis[2] * upward_m_s for axis in self.axes))
        wrench = self.plate.step(dt_s, self.ground, self._upright._replace(depth_m=self.depth_m), twist)
        forces_n = wrench[:3]  # along the three axes
        forward_n = fsum(force_n * axis[0] for force_n, axis in zip(forces_n, self.axes, strict=True))
        return forward_n, fsum(force_n * axis[2] for force_n, axis in zip(forces_n, self.axes, strict=True))

    def lower(self, to_depth_m: float, speed_m_s: float) -> Curve:
        """Move straight down or up to a depth, in whole steps."""
        path_m = to_depth_m - self.depth_m
        steps = max(1, ceil(abs(path_m) / (speed_m_s * STEP_S)))
        curve: Curve = []
        for _ in range(steps):
            upward_n = self.step(STEP_S, 0.0, -path_m / (steps * STEP_S))[1]
            part = submerged_part(self._geometry, self.depth_m, self._upright.per_outward, self._upright.per_upward)
            curve.append((self.depth_m, self._geometry.plate_thickness_m * part.area_m2, upward_n))
        return curve

    def slide(self, path_m: float, speed_m_s: float) -> list[float]:
        """Drag the plate backward; return the forward force after each step."""
        return [self.step(STEP_S, -speed_m_s, 0.0)[0] for _ in range(ceil(path_m / (speed_m_s * STEP_S)))]

    def hold(self, hold_s: float) -> None:
        for _ in range(round(hold_s / STEP_S)):
            self.step(STEP_S, 0.0, 0.0)


def measure_shear(
    ground: Ground,
    geometry: FlipperGeometry,
    sweep_rad: float,
    adduction_rad: float,
    depth_m: float,
    speed_m_s: float,
    distance_m: float = 0.2,
) -> float:
    """Return the forward force on a plate dragged backward at a depth: the mean over the second half of the distance.

    The plate goes down at the same speed before, as in the paper; mud with a memory is then softer by a twentieth.
    Raises ValueError where the first half is too short for all the mud to yield.
    """
    needed_m = 2.0 * SIDEWAYS_YIELD_M * ground.rate_factor(speed_m_s) / cos(sweep_rad)
    if distance_m < needed_m:
        raise ValueError(f"distance_m = {distance_m:g}: must be at least {needed_m:.3f} for the mud to yield")
    cell = LoadCell(ground, geometry, sweep_rad, adduction_rad)
    cell.lower(depth_m, speed_m_s)
    forces_n = cell.slide(distance_m, speed_m_s)
    steady_n = forces_n[len(forces_n) // 2 :]
    return fsum(steady_n) / len(steady_n)
