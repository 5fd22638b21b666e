"""Kinematics of one flipper.

The adduction axis is fixed to the body and points fore and aft; the sweep axis tilts with it. With the sweep angle
α, the adduction angle β (up positive), the arm length l and the drop h from the arm down to the plate's lower edge,
the lower edge's middle lies at

    p = R_x(β) · [l sin α, l cos α, -h]
      = (l sin α, l cos α cos β + h sin β, l cos α sin β - h cos β)        x forward, y outward, z up

from the intersection of the axes, at the height H above the mud. A plate of another shape (plate_outline.py) has its
lowest corner at that drop, and "the lower edge's middle" is the point at l along the arm and h below it. The paper
describes this robot without its drop (figure 2); with h = 0 its force matrix is rows x and z of J / l². Drop and height
are from the authors' controller. The published lengths disagree (0.115 m in the paper, 0.120 m in the controller):
measure your robot.
"""

from dataclasses import dataclass
from functools import cached_property
from math import asin, atan2, cos, hypot, radians, sin, sqrt
from typing import Annotated, NamedTuple

from control.bounds import Bounds, Meaning
from control.plate_outline import Corner, PlateOutline, mounted_outline, rectangle

MIN_LEVER_M = 0.01  # below it the adduction joint moves the plate sideways, not down: refuse to command it


class Jacobian(NamedTuple):
    """Metres of the lower edge per radian of joint angle."""

    x_sweep: float
    x_adduction: float
    y_sweep: float
    y_adduction: float
    z_sweep: float
    z_adduction: float


@dataclass(frozen=True)
class FlipperGeometry:
    flipper_length_m: Annotated[
        float, Bounds(0.02, 1.0), Meaning("sweep axis to the middle of the plate, along the arm")
    ] = 0.120
    drop_m: Annotated[float, Bounds(0.0, 0.5), Meaning("arm to the plate's lower edge")] = 0.050
    axis_height_m: Annotated[float, Bounds(0.0, 1.0), Meaning("adduction axis above the mud's nominal surface")] = (
        0.0645
    )
    plate_width_m: Annotated[float, Bounds(0.002, 0.5), Meaning("plate's extent along the arm")] = 0.025
    plate_thickness_m: Annotated[float, Bounds(0.0002, 0.1), Meaning("plate's extent fore and aft")] = 0.004
    plate_height_m: Annotated[float, Bounds(0.002, 0.5), Meaning("plate's extent from its lower to its upper edge")] = (
        0.070
    )
    plate_corners_m: Annotated[
        tuple[Corner, ...],
        Meaning("[outward, upward] in m of each corner of a plate that is no rectangle, instead of width and height"),
    ] = ()
    plate_angle_deg: Annotated[
        float, Bounds(-45.0, 45.0), Meaning("by which the mounted plate is turned in its plane, lower end outward")
    ] = 0.0

    @cached_property
    def plate(self) -> PlateOutline:
        """The outline of the plate as mounted."""
        corners = self.plate_corners_m or rectangle(self.plate_width_m, self.plate_height_m)
        return mounted_outline(corners, self.plate_angle_deg)

    @property
    def has_level_rectangle(self) -> bool:
        """Whether the plate is the paper's: a rectangle with a level lower edge."""
        return not (self.plate_corners_m or self.plate_angle_deg)

    @property
    def clearance_m(self) -> float:
        """Height of the lower edge above the mud with the arm level."""
        return self.axis_height_m - self.drop_m

    def edge_position(self, sweep_rad: float, adduction_rad: float) -> tuple[float, float, float]:
        """Return (x, y, z) in metres from the intersection of the axes."""
        l, h = self.flipper_length_m, self.drop_m  # noqa: E741
        sa, ca, sb, cb = sin(sweep_rad), cos(sweep_rad), sin(adduction_rad), cos(adduction_rad)
        return l * sa, l * ca * cb + h * sb, l * ca * sb - h * cb

    def jacobian(self, sweep_rad: float, adduction_rad: float) -> Jacobian:
        l, h = self.flipper_length_m, self.drop_m  # noqa: E741
        sa, ca, sb, cb = sin(sweep_rad), cos(sweep_rad), sin(adduction_rad), cos(adduction_rad)
        return Jacobian(l * ca, 0.0, -l * sa * cb, h * cb - l * ca * sb, -l * sa * sb, h * sb + l * ca * cb)

    def depth_m(self, sweep_rad: float, adduction_rad: float) -> float:
        """Return the depth of the lower edge below the nominal surface: h cos β - l cos α sin β - H."""
        tilted_drop = self.drop_m * cos(adduction_rad)
        return tilted_drop - self.flipper_length_m * cos(sweep_rad) * sin(adduction_rad) - self.axis_height_m

    def adduction_rad(self, sweep_rad: float, depth_m: float) -> float:
        """Return the adduction angle with the lower edge at `depth_m`: the depth law solved for β.

        -β = asin((z + H) / √((l cos α)² + h²)) - atan2(h, l cos α). Raises ValueError if the flipper does not reach.
        """
        reach_m = self.flipper_length_m * cos(sweep_rad)
        radius_m = hypot(reach_m, self.drop_m)
        below_axis_m = depth_m + self.axis_height_m
        if abs(below_axis_m) > radius_m:
            raise ValueError(f"depth {depth_m:.4f} m at sweep {sweep_rad:.3f} rad is out of the flipper's reach")
        return atan2(self.drop_m, reach_m) - asin(below_axis_m / radius_m)

    def adduction_velocity_rad_s(
        self, sweep_rad: float, adduction_rad: float, sweep_velocity_rad_s: float, depth_velocity_m_s: float
    ) -> float:
        """Return β̇ from the derivative of the depth law: ż = l sin α sin β · α̇ - (l cos α cos β + h sin β) · β̇."""
        lever_m = self.vertical_lever_m(sweep_rad, adduction_rad)
        sinking_m = self.flipper_length_m * sin(sweep_rad) * sin(adduction_rad)
        return (sinking_m * sweep_velocity_rad_s - depth_velocity_m_s) / lever_m

    def vertical_lever_m(self, sweep_rad: float, adduction_rad: float) -> float:
        """Return the rise of the lower edge in metres per radian of adduction: the lever of a vertical force."""
        return self.flipper_length_m * cos(sweep_rad) * cos(adduction_rad) + self.drop_m * sin(adduction_rad)

    def deepest_m(self, sweep_angle_deg: float) -> float:
        """Return the greatest depth that the flipper can hold over a sweep of ±`sweep_angle_deg`."""
        return self._deepest_at_m(radians(sweep_angle_deg))

    def is_reachable(self, sweep_rad: float, depth_m: float) -> bool:
        """Return whether the pose exists and leaves the adduction joint a vertical lever of at least MIN_LEVER_M."""
        return abs(depth_m + self.axis_height_m) <= self._deepest_at_m(sweep_rad) + self.axis_height_m

    def _deepest_at_m(self, sweep_rad: float) -> float:
        """Return the depth √(r² - d²) - H at which the vertical lever is still d.

        Adduction moves the edge on a circle of radius r = √((l cos α)² + h²).
        """
        radius_m = hypot(self.flipper_length_m * cos(sweep_rad), self.drop_m)
        return sqrt(max(0.0, radius_m * radius_m - MIN_LEVER_M * MIN_LEVER_M)) - self.axis_height_m
