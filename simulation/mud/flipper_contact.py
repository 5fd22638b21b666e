"""One flipper in the ground: the motion of its joints as the plate's, and the plate's forces as torques and thrust.

The plate hangs under the arm, normal n in the direction of the sweep, in-plane directions r (outward along the arm)
and s (up along the plate). In the frame that tilts with adduction, the point u outward and s up from the middle of
the lower edge lies at ((l + u) sin α, (l + u) cos α, s - h) and moves with

    v_n = (l + u) α' + X' cos α - (h - s) sin α β'    v_r = X' sin α + (h - s) cos α β'    v_s = (l + u) cos α β'

where X' is the body's speed. The same coefficients, transposed, turn the mud's forces into joint torques and thrust;
its depth is ζ = z - u cos α sin β - s cos β. A body that also rises and turns adds to all of this: see carriage.py.
"""

from math import cos, sin
from typing import NamedTuple

from control.geometry import FlipperGeometry
from simulation.mud.carriage import Carriage, carried_attitude, carried_twist
from simulation.mud.clay import Clay
from simulation.mud.ground_contact import Ground, GroundContact
from simulation.mud.grounds.sand import Sand
from simulation.mud.grounds.sand_contact import SandContact
from simulation.mud.grounds.thixotropic_mud import ThixotropicContact, ThixotropicMud
from simulation.mud.plate_contact import PlateContact
from simulation.mud.rigid_plate import Attitude, PlateSize, Twist, Wrench


class ArmMotion(NamedTuple):
    """Angles and velocities of one arm's joints, and the forward speed of the body that carries it."""

    sweep_rad: float
    adduction_rad: float
    sweep_rad_s: float = 0.0
    adduction_rad_s: float = 0.0
    body_m_s: float = 0.0


class ContactForce(NamedTuple):
    sweep_nm: float
    adduction_nm: float
    thrust_n: float  # forward, on the body
    normal_n: float  # along the plate's normal
    outward_n: float  # along the arm
    upward_n: float  # along the plate, up: in insertion positive
    tilting_nm: float = 0.0  # on the body, about the outward axis that tilts with adduction, through the joints' axes


NO_CONTACT = ContactForce(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def plate_size(geometry: FlipperGeometry) -> PlateSize:
    if geometry.has_level_rectangle:
        return PlateSize(geometry.plate_width_m, geometry.plate_height_m, geometry.plate_thickness_m)
    plate = geometry.plate
    return PlateSize(plate.width_m, plate.height_m, geometry.plate_thickness_m, plate.corners)


def attitude_of(
    geometry: FlipperGeometry,
    sweep_rad: float,
    adduction_rad: float,
    surface_m: float = 0.0,
    carriage: Carriage | None = None,
) -> Attitude:
    """`surface_m`: how far the mud's surface lies below its nominal height; `carriage`: of a body off its rail."""
    if carriage is not None:
        return carried_attitude(geometry, carriage, sweep_rad, adduction_rad, surface_m)
    depth_m = geometry.depth_m(sweep_rad, adduction_rad) - surface_m
    lean = sin(adduction_rad)
    return Attitude(depth_m, -cos(sweep_rad) * lean, cos(adduction_rad), sin(sweep_rad) * lean)


def twist_of(geometry: FlipperGeometry, motion: ArmMotion) -> Twist:
    """Return the plate's motion through the mud, which is the same at any adduction angle."""
    sweep_rad, _, sweep_rad_s, adduction_rad_s, body_m_s = motion
    length_m, drop_m, sa, ca = geometry.flipper_length_m, geometry.drop_m, sin(sweep_rad), cos(sweep_rad)
    return Twist(
        length_m * sweep_rad_s + body_m_s * ca - drop_m * sa * adduction_rad_s,
        body_m_s * sa + drop_m * ca * adduction_rad_s,
        length_m * ca * adduction_rad_s,
        sweep_rad_s,
        sa * adduction_rad_s,
        -ca * adduction_rad_s,
        ca * adduction_rad_s,
    )


def contact_force(geometry: FlipperGeometry, sweep_rad: float, wrench: Wrench) -> ContactForce:
    """The transpose of `twist_of`: torques and thrust do the same work on joints and body as the mud on the plate."""
    length_m, drop_m, sa, ca = geometry.flipper_length_m, geometry.drop_m, sin(sweep_rad), cos(sweep_rad)
    normal_n, outward_n, upward_n, normal_outward_nm, normal_upward_nm, outward_upward_nm, upward_outward_nm = wrench
    across_nm = drop_m * normal_n - normal_upward_nm
    outward_nm = drop_m * outward_n - outward_upward_nm
    lifting_nm = length_m * upward_n + upward_outward_nm
    return ContactForce(
        length_m * normal_n + normal_outward_nm,
        ca * (outward_nm + lifting_nm) - sa * across_nm,
        ca * normal_n + sa * outward_n,
        normal_n,
        outward_n,
        upward_n,
        -sa * (outward_nm + lifting_nm) - ca * across_nm,
    )


def contact_of(ground: Ground, size: PlateSize, relaxation: float = 0.0) -> GroundContact:
    """Make a plate's contact with a kind of ground; `relaxation` is that of clay."""
    if isinstance(ground, Sand):
        return SandContact(size)
    return ThixotropicContact(size) if isinstance(ground, ThixotropicMud) else PlateContact(size, relaxation)


class FlipperContact:
    """Owns the contact of one flipper's plate, a new one where the kind of ground changes."""

    def __init__(self, geometry: FlipperGeometry, relaxation: float = 0.0) -> None:
        self.geometry = geometry
        self.size = plate_size(geometry)
        self.relaxation = relaxation
        self.plate: GroundContact = PlateContact(self.size, relaxation)
        self._kind: type[Ground] = Clay

    def reset(self) -> None:
        self.plate.reset()

    def step(
        self,
        dt_s: float,
        ground: Ground,
        motion: ArmMotion,
        attitude: Attitude,
        carriage: Carriage | None = None,
        edge_m: float = 0.0,
    ) -> ContactForce:
        """`attitude`: of the plate in its ground, below the surface that this flipper meets, at `edge_m` along it."""
        if type(ground) is not self._kind:
            self._kind, self.plate = type(ground), contact_of(ground, self.size, self.relaxation)
        if self.plate.leaves(dt_s, attitude):  # as in swing: nothing else to compute
            return NO_CONTACT
        geometry = self.geometry
        twist = twist_of(geometry, motion) if carriage is None else carried_twist(geometry, carriage, *motion[:4])
        wrench = self.plate.press(dt_s, ground, attitude, twist, edge_m)
        return contact_force(geometry, motion.sweep_rad, wrench)
