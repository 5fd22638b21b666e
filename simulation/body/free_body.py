"""The body without its rail: a rigid box that lies on the mud with its belly, rises, rolls and pitches.

Its coordinates are the position x along the track, the height of its centre of mass, which lies between the joints'
axes, and roll φ and pitch θ about it, turned in this order. The rows of the rotation matrix are the world's directions
in the body's axes (x forward, y to the left, z up):

    forward = (cos θ, sin θ sin φ, sin θ cos φ)   across = (0, cos φ, -sin φ)   up = (-sin θ, cos θ sin φ, cos θ cos φ)

A point P of the body lies at x + forward·P and height + up·P, and since ∂up/∂θ = -forward, ∂up/∂φ = cos θ across,
∂forward/∂θ = up and ∂forward/∂φ = sin θ across, every force acts on all four coordinates by the work that it does:

    Q_q = F_x ∂x_P/∂q + F_z ∂z_P/∂q        m x'' = Q_x    m z'' = Q_z - m g    I_φ φ'' = Q_φ    I_θ θ'' = Q_θ

with constant inertias: the model leaves out the box's gyroscopic terms and the reaction of the arms' acceleration.
The body neither turns about the vertical nor drifts sideways, as if the track guided it.

The belly presses on the mud at the four corners of its rectangle, each for a quarter of its area A (so it tips over
its edges, as it should, and resists small turns three times too stiffly), as an anchored elastic-plastic contact like
the plate's:

    pressure up    g(v) N_c s_u + γ d at the depth d        Prandtl's strip, and the weight of the mud next to it
    drag           g(v) a s_u A of the pressed part         adhesion, held elastically until it yields

It yields at a depth of YIELD_M, or deeper where the body is so light that it would ring too quickly for the steps. It
leaves a print that carries no load until the belly is back in it or has been clear of the mud. The print moves with the
body: mud that it slides on to is as pressed as the mud that it leaves. There is no suction under the belly (air gets
under it), and no mud is ploughed up in front of it. The drag pad sinks with the belly, and pulls at the belly. Nothing
keeps the body from rearing or tipping over: flippers that push down with more than its weight lift it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, hypot, sin, sqrt
from typing import Annotated, NamedTuple

from control.bounds import Bounds
from control.parameters.arm_mass import GRAVITY_M_S2
from control.records import FLIPPERS, TWO_FLIPPERS, Rig
from simulation.body.rail_body import BodyMotion, DragPad, DryDrag, Pusher
from simulation.mud.carriage import Carriage, plate_directions
from simulation.mud.clay import UNIT_WEIGHT_N_M3
from simulation.mud.flipper_contact import NO_CONTACT
from simulation.mud.ground_contact import Ground
from simulation.mud.track import Track
from simulation.mud.vectors import Vector, cross, dot

YIELD_M = 0.003  # a twentieth of a belly's width, after which footings on soft clay have failed
LARGEST_RAD_S = 600.0  # the fastest ringing of the body on its belly that steps of 1 ms resolve
SIDES = (1.0, -1.0)  # fore, aft; left, right
SIDE_OF = dict(zip(FLIPPERS, SIDES, strict=True))


@dataclass(frozen=True)
class BodyShape:
    """A box, with the centre of mass at the height of the joints' axes."""

    length_m: Annotated[float, Bounds(0.02, 2.0)] = 0.20
    width_m: Annotated[float, Bounds(0.02, 2.0)] = 0.06  # the joints are at its sides
    axis_above_belly_m: Annotated[float, Bounds(0.0, 1.0)] = 0.0645
    axis_forward_m: Annotated[float, Bounds(-1.0, 1.0)] = 0.0  # of the centre of mass
    roll_inertia_kg_m2: Annotated[float, Bounds(1e-4, 100.0)] = 0.0014
    pitch_inertia_kg_m2: Annotated[float, Bounds(1e-4, 100.0)] = 0.0039  # of a box 8 cm high


class Axes(NamedTuple):
    """The world's directions in the body's axes."""

    forward: Vector
    across: Vector
    up: Vector


def axes_of(roll_rad: float, pitch_rad: float) -> Axes:
    sr, cr, sp, cp = sin(roll_rad), cos(roll_rad), sin(pitch_rad), cos(pitch_rad)
    return Axes((cp, sp * sr, sp * cr), (0.0, cr, -sr), (-sp, cp * sr, cp * cr))


def own_axes(axes: Axes, side: float) -> Axes:
    """Return the axes of the flipper on the left (1) or on the right (-1), whose y points to the right."""
    if side > 0.0:
        return axes
    (fx, fy, fz), (_, ay, az), (ux, uy, uz) = axes
    return Axes((fx, -fy, fz), (0.0, ay, -az), (ux, -uy, uz))


def in_world(axes: Axes, point: Vector) -> Vector:
    """Return (ahead, across, above) of the centre of mass."""
    return dot(axes.forward, point), dot(axes.across, point), dot(axes.up, point)


class BodyLoad(NamedTuple):
    """Generalised force: work per unit of each coordinate."""

    forward_n: float
    upward_n: float
    roll_nm: float
    pitch_nm: float


def load_at(axes: Axes, lever_m: Vector, forward_n: float, upward_n: float) -> BodyLoad:
    """Return the load of a force in the world that acts `lever_m` from the centre of mass, in the world's axes."""
    ahead_m, across_m, above_m = lever_m
    roll_nm = (axes.forward[0] * upward_n - axes.up[0] * forward_n) * across_m
    return BodyLoad(forward_n, upward_n, roll_nm, above_m * forward_n - ahead_m * upward_n)


def load_of_flipper(axes: Axes, joint: Vector, flipper: Pusher, side: float) -> BodyLoad:
    """Return the load of the mud through a flipper, in the flipper's own axes; `side`: 1 on the left, -1 on the right.

    Moments about the axes that tilt with adduction are rotated upright, and moved from the joints to the middle.
    """
    force = flipper.force
    n, r, s = plate_directions(flipper.sweep_rad, flipper.adduction_rad)
    f_n, f_r, f_s = force.normal_n, force.outward_n, force.upward_n
    push_n = (f_n * n[0] + f_r * r[0], f_n * n[1] + f_r * r[1] + f_s * s[1], f_n * n[2] + f_r * r[2] + f_s * s[2])
    sb, cb = -s[1], s[2]
    levered = cross(joint, push_n)
    moment_nm = (
        levered[0] + force.adduction_nm,
        levered[1] + cb * force.tilting_nm + sb * force.sweep_nm,
        levered[2] + sb * force.tilting_nm - cb * force.sweep_nm,
    )
    pitch_nm = dot(axes.across, moment_nm)
    return BodyLoad(dot(axes.forward, push_n), dot(axes.up, push_n), side * moment_nm[0], pitch_nm)


class BellyQuarter:
    """Owns the print of a quarter of the belly."""

    def __init__(self, area_m2: float, mass_kg: float) -> None:
        """`mass_kg`: the mass that a push on its corner moves."""
        self.area_m2 = area_m2
        self.mass_kg = mass_kg
        self.reset()

    def reset(self) -> None:
        self._print_m = self._stiffness_n_m = 0.0
        self.pressed = False

    def step(self, ground: Ground, traction: float, depth_m: float, sinking_m_s: float) -> float:
        """Return the force up. The damping is half of critical."""
        if depth_m <= 0.0:
            self.reset()
            return 0.0
        slow_n = ground.bearing_pa(depth_m) * self.area_m2
        stiffness_n_m = min(slow_n / YIELD_M, self.mass_kg * LARGEST_RAD_S**2)
        elastic_n = min(stiffness_n_m * self._strain_m(stiffness_n_m, depth_m), traction * slow_n)
        floating_n = UNIT_WEIGHT_N_M3 * self.area_m2 * depth_m
        self.pressed = elastic_n > 0.0
        if not self.pressed:
            return floating_n
        self._print_m = depth_m - elastic_n / stiffness_n_m
        damping_n = sqrt(stiffness_n_m * self.mass_kg) * sinking_m_s
        return floating_n + min(max(elastic_n + damping_n, 0.0), traction * slow_n)

    def _strain_m(self, stiffness_n_m: float, depth_m: float) -> float:
        """Return the strain above the print. Where the mud becomes stiffer the force stays, as along a plate."""
        strain_m = depth_m - self._print_m
        if strain_m > 0.0 and 0.0 < self._stiffness_n_m < stiffness_n_m:
            strain_m *= self._stiffness_n_m / stiffness_n_m
        self._stiffness_n_m = stiffness_n_m
        return strain_m


class FreeBody:
    """Owns the body's position and attitude, and the mud's memory of its belly."""

    def __init__(self, mass_kg: float, shape: BodyShape, pad: DragPad, track: Track, rig: Rig = TWO_FLIPPERS) -> None:
        self.mass_kg = mass_kg
        self.shape = shape
        self.pad = pad
        self.track = track
        ahead_m, aside_m, area_m2 = shape.length_m / 2.0, shape.width_m / 2.0, shape.length_m * shape.width_m
        below_m = -shape.axis_above_belly_m
        self._belly = (0.0, 0.0, below_m)
        self._corners = tuple((way * ahead_m, side * aside_m, below_m) for way in SIDES for side in SIDES)
        pitched_kg = shape.pitch_inertia_kg_m2 / shape.length_m**2
        rolled_kg = shape.roll_inertia_kg_m2 / shape.width_m**2
        moved_kg = min(mass_kg / 4.0, pitched_kg, rolled_kg)  # of the four corners together, the lightest motion
        self._quarters = tuple(BellyQuarter(area_m2 / 4.0, moved_kg) for _ in self._corners)
        self._joint = (shape.axis_forward_m, shape.width_m / 2.0, 0.0)  # of either flipper, in its own axes
        self._sides = tuple(SIDE_OF[flipper] for flipper in rig.flippers)
        self._drag = DryDrag()
        self.reset()

    def reset(self) -> None:
        """Level, with the belly on the mud's surface."""
        self.forward_m = self.forward_m_s = 0.0
        self.height_m = self.shape.axis_above_belly_m  # of the centre of mass above the mud's nominal surface
        self.upward_m_s = 0.0
        self.roll_rad = self.pitch_rad = self.roll_rad_s = self.pitch_rad_s = 0.0
        for quarter in self._quarters:
            quarter.reset()
        self._drag.reset()

    def put_down(self) -> None:
        """Set the body on its belly where it is along the track: it may have overturned or sunk."""
        forward_m = self.forward_m
        self.reset()
        self.forward_m = forward_m

    @property
    def motion(self) -> BodyMotion:
        return BodyMotion(
            (self.forward_m_s, 0.0, self.upward_m_s), self.roll_rad, self.pitch_rad, self.roll_rad_s, self.pitch_rad_s
        )

    @property
    def carriages(self) -> tuple[Carriage, ...]:
        axes = axes_of(self.roll_rad, self.pitch_rad)
        return tuple(self._carriage(own_axes(axes, side), side * self.roll_rad_s) for side in self._sides)

    def _carriage(self, axes: Axes, roll_rad_s: float) -> Carriage:
        """Return the carriage in the flipper's own axes: on the right a roll has the opposite sign."""
        (fx, fy, fz), (_, ay, az), (ux, uy, uz) = axes
        turning = (roll_rad_s, ay * self.pitch_rad_s, az * self.pitch_rad_s)
        levered = cross(turning, self._joint)
        ahead_m_s, up_m_s = self.forward_m_s, self.upward_m_s
        velocity_m_s = (
            fx * ahead_m_s + ux * up_m_s + levered[0],
            fy * ahead_m_s + uy * up_m_s + levered[1],
            fz * ahead_m_s + uz * up_m_s + levered[2],
        )
        return Carriage(self.height_m + dot(axes.up, self._joint), axes.up, velocity_m_s, turning)

    def step(self, dt_s: float, *flippers: Pusher) -> None:
        axes = axes_of(self.roll_rad, self.pitch_rad)
        forward_n = upward_n = roll_nm = pitch_nm = 0.0
        for load in (*self.flipper_loads(axes, *flippers), *self._belly_loads(dt_s, axes)):
            forward_n += load.forward_n
            upward_n += load.upward_n
            roll_nm += load.roll_nm
            pitch_nm += load.pitch_nm
        self.forward_m_s += dt_s * forward_n / self.mass_kg
        self.upward_m_s += dt_s * (upward_n / self.mass_kg - GRAVITY_M_S2)
        self.roll_rad_s += dt_s * roll_nm / self.shape.roll_inertia_kg_m2
        self.pitch_rad_s += dt_s * pitch_nm / self.shape.pitch_inertia_kg_m2
        self.forward_m += dt_s * self.forward_m_s
        self.height_m += dt_s * self.upward_m_s
        self.roll_rad += dt_s * self.roll_rad_s
        self.pitch_rad += dt_s * self.pitch_rad_s

    def flipper_loads(self, axes: Axes, *flippers: Pusher) -> Iterator[BodyLoad]:
        """Yield the loads of the flippers that touch the mud."""
        for flipper, side in zip(flippers, self._sides, strict=True):
            if flipper.force is not NO_CONTACT:
                yield load_of_flipper(own_axes(axes, side), self._joint, flipper, side)

    def _belly_loads(self, dt_s: float, axes: Axes) -> Iterator[BodyLoad]:
        lever_m = in_world(axes, self._belly)
        sliding_m_s, _ = self._speeds_m_s(axes, lever_m)
        sticking_n = 0.0
        for quarter, corner in zip(self._quarters, self._corners, strict=True):
            corner_m = in_world(axes, corner)
            ground = self.track.ground_at(self.forward_m + corner_m[0])
            depth_m = -self.height_m - corner_m[2]
            _, rising_m_s = self._speeds_m_s(axes, corner_m)
            traction = ground.rate_factor(hypot(sliding_m_s, rising_m_s))
            upward_n = quarter.step(ground, traction, depth_m, -rising_m_s)
            yield load_at(axes, corner_m, 0.0, upward_n)
            if quarter.pressed:
                sticking_n += ground.sticking_pa(depth_m) * quarter.area_m2
        ground = self.track.ground_at(self.forward_m)
        pad_n = self.pad.yield_n(ground, -self.height_m - lever_m[2])
        largest_n = ground.rate_factor(abs(sliding_m_s)) * (sticking_n + pad_n)
        yield load_at(axes, lever_m, self._drag.step(dt_s, sliding_m_s, largest_n), 0.0)

    def _speeds_m_s(self, axes: Axes, lever_m: Vector) -> tuple[float, float]:
        """Return (forward, up) in the world of a point on the body, `lever_m` from the centre of mass."""
        ahead_m, across_m, above_m = lever_m
        rolling_m_s = across_m * self.roll_rad_s
        return (
            self.forward_m_s + above_m * self.pitch_rad_s - axes.up[0] * rolling_m_s,
            self.upward_m_s - ahead_m * self.pitch_rad_s + axes.forward[0] * rolling_m_s,
        )
