"""The robot's mechanics: two arms with two joints each, and a body on a rail.

Arms have a constant inertia about each joint, gravity and a little viscous friction; their mass is small beside the
body's, so they do not throw it about. The rail's drag and the drag pad in the mud hold the body elastically until
they yield. What earlier strokes left behind is each arm's own history, off by default. Semi-implicit Euler at STEP_S:
the stiffest spring, mud along a plate 5 cm deep in the stiffest of the paper's muds, makes the arm swing at about
400 rad/s.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, sin
from operator import add
from random import Random

from control.geometry import FlipperGeometry
from control.joint_pd import ArmMass
from control.records import JointAngles, Torques
from simulation.clay import Clay, rate_factor
from simulation.disturbances import NONE, Disturbances, StrokeHistory, clinging_torques_nm
from simulation.flipper_contact import NO_CONTACT, ContactForce, FlipperContact, contact_force, lowest_m
from simulation.stones import NO_PUSH, StoneContact, push_wrench
from simulation.track import Track

STEP_S = 0.001
DRAG_STIFFNESS_N_M = 5000.0
DRAG_DAMPING_N_S_M = 71.0  # half of critical with the body's mass: dry friction lets nothing ring
END_STOPS_RAD = (radians(100.0), radians(85.0))  # sweep, adduction: the arm meets the body


@dataclass(frozen=True)
class PlantParameters:
    geometry: FlipperGeometry = FlipperGeometry()
    arm_mass: ArmMass = ArmMass()
    joint_friction_nm_s: float = 0.002
    body_mass_kg: float = 1.0
    rail_drag_n: float = 2.5  # the paper's, without the pad
    rail_damping_n_s_m: float = 6.0  # how drag grows with speed: fitted to Table I with the muds' strengths
    pad_width_m: float = 0.015
    pad_depth_m: float = 0.02
    disturbances: Disturbances = NONE
    fixed_base: bool = False  # the body never moves, as in the paper's trials of a single flipper


class Arm:
    """Owns the motion of one flipper arm."""

    def __init__(self, parameters: PlantParameters, track: Track, seed: int) -> None:
        self.parameters = parameters
        self.track = track
        self.contact = FlipperContact(parameters.geometry, parameters.disturbances.relaxation)
        self.history = StrokeHistory(parameters.disturbances, seed)
        self.stones = StoneContact(track.stones) if track.stones else None
        self._disturbed = parameters.disturbances != NONE
        self.reset()

    def reset(self) -> None:
        """At rest with the plate's edge on the mud, as a robot lies when its motors are off."""
        self.history.reset()
        self.relief_m = self.track.surface_m(0.0)
        self.sweep_rad = 0.0
        self.adduction_rad = self.parameters.geometry.adduction_rad(0.0, self.surface_m)
        self.sweep_velocity_rad_s = self.adduction_velocity_rad_s = 0.0
        self.contact.reset()
        if self.stones:
            self.stones.reset()
        self.force = NO_CONTACT
        self.clay = self.track.clay_at(0.0)

    @property
    def surface_m(self) -> float:
        """How far the mud that this flipper meets lies below its nominal height."""
        return self.relief_m + self.history.surface_m

    def step(self, dt_s: float, body_m: float, body_m_s: float, sweep_nm: float, lift_nm: float) -> None:
        self._look_at_mud(body_m)
        self.force = self.contact.step(
            dt_s,
            self.clay,
            self.sweep_rad,
            self.adduction_rad,
            self.sweep_velocity_rad_s,
            self.adduction_velocity_rad_s,
            body_m_s,
            self.surface_m,
        )
        if self.stones:
            self._meet_stones(self.stones, dt_s, body_m)
        load_sweep_nm, load_lift_nm = self._load_nm()
        self._move(dt_s, sweep_nm + load_sweep_nm, lift_nm + load_lift_nm)

    def _look_at_mud(self, body_m: float) -> None:
        """Which clay is under the flipper, as firm as earlier strokes have left it, and how high."""
        geometry = self.parameters.geometry
        edge_m = body_m + geometry.flipper_length_m * sin(self.sweep_rad)
        self.relief_m = self.track.surface_m(edge_m)
        if self._disturbed:
            self.history.step(lowest_m(geometry, self.sweep_rad, self.adduction_rad) - self.relief_m, edge_m)
        clay, firmness = self.track.clay_at(edge_m), self.history.firmness
        self.clay = clay if firmness == 1.0 else Clay(clay.name, firmness * clay.strength_pa, clay.layers)

    def _meet_stones(self, stones: StoneContact, dt_s: float, body_m: float) -> None:
        geometry, sweep_rad, adduction_rad = self.parameters.geometry, self.sweep_rad, self.adduction_rad
        edge_m = body_m + geometry.flipper_length_m * sin(sweep_rad)
        push = stones.step(dt_s, edge_m, lowest_m(geometry, sweep_rad, adduction_rad))
        if push is not NO_PUSH:
            pushed = contact_force(geometry, sweep_rad, push_wrench(geometry, sweep_rad, adduction_rad, push))
            self.force = ContactForce(*map(add, self.force, pushed))

    def _load_nm(self) -> tuple[float, float]:
        """Of mud, clinging mud, gravity and friction on (sweep, adduction)."""
        parameters = self.parameters
        sweep_nm, lift_nm = parameters.arm_mass.gravity_torques_nm(self.sweep_rad, self.adduction_rad)
        sweep_nm += self.force.sweep_nm - parameters.joint_friction_nm_s * self.sweep_velocity_rad_s
        lift_nm += self.force.adduction_nm - parameters.joint_friction_nm_s * self.adduction_velocity_rad_s
        weight_n = self.history.clinging_n
        if weight_n:
            hanging = clinging_torques_nm(parameters.geometry, self.sweep_rad, self.adduction_rad, weight_n)
            sweep_nm, lift_nm = sweep_nm + hanging[0], lift_nm + hanging[1]
        return sweep_nm, lift_nm

    def _move(self, dt_s: float, sweep_nm: float, lift_nm: float) -> None:
        mass = self.parameters.arm_mass
        self.sweep_velocity_rad_s += dt_s * sweep_nm / mass.sweep_inertia_kg_m2
        self.adduction_velocity_rad_s += dt_s * lift_nm / mass.adduction_inertia_kg_m2
        self.sweep_rad, self.sweep_velocity_rad_s = _moved(
            self.sweep_rad, self.sweep_velocity_rad_s, dt_s, END_STOPS_RAD[0]
        )
        self.adduction_rad, self.adduction_velocity_rad_s = _moved(
            self.adduction_rad, self.adduction_velocity_rad_s, dt_s, END_STOPS_RAD[1]
        )


def _moved(angle_rad: float, velocity_rad_s: float, dt_s: float, stop_rad: float) -> tuple[float, float]:
    angle_rad += velocity_rad_s * dt_s
    if -stop_rad < angle_rad < stop_rad:
        return angle_rad, velocity_rad_s
    return min(max(angle_rad, -stop_rad), stop_rad), 0.0


class Plant:
    """Owns the mechanical state of the robot on its track. `random` gives each flipper's history its seed."""

    def __init__(self, parameters: PlantParameters, track: Track, random: Random | None = None) -> None:
        self.parameters = parameters
        self.track = track
        random = random or Random(1)
        left, right = (Arm(parameters, track, random.getrandbits(32)) for _ in range(2))
        self.arms = (left, right)
        self.reset()

    def reset(self) -> None:
        for arm in self.arms:
            arm.reset()
        self.body_m = self.body_m_s = 0.0
        self._drag_m = 0.0

    @property
    def angles_rad(self) -> JointAngles:
        left, right = self.arms
        return left.sweep_rad, left.adduction_rad, right.sweep_rad, right.adduction_rad

    @property
    def velocities_rad_s(self) -> JointAngles:
        left, right = self.arms
        return (
            left.sweep_velocity_rad_s,
            left.adduction_velocity_rad_s,
            right.sweep_velocity_rad_s,
            right.adduction_velocity_rad_s,
        )

    def step(self, dt_s: float, torques_nm: Torques) -> None:
        left, right = self.arms
        left.step(dt_s, self.body_m, self.body_m_s, torques_nm[0], torques_nm[1])
        right.step(dt_s, self.body_m, self.body_m_s, torques_nm[2], torques_nm[3])
        if self.parameters.fixed_base:
            return
        thrust_n = left.force.thrust_n + right.force.thrust_n
        drag_n = self._drag_n(dt_s) - self.parameters.rail_damping_n_s_m * self.body_m_s
        self.body_m_s += dt_s * (thrust_n + drag_n) / self.parameters.body_mass_kg
        self.body_m += dt_s * self.body_m_s

    def _drag_n(self, dt_s: float) -> float:
        """Rail and pad together: elastic up to their yield force, then sliding."""
        parameters, clay = self.parameters, self.track.clay_at(self.body_m)
        pad_n = clay.lateral_n(parameters.pad_depth_m, parameters.pad_width_m) if parameters.pad_width_m else 0.0
        largest_n = parameters.rail_drag_n + rate_factor(abs(self.body_m_s)) * pad_n
        self._drag_m += dt_s * self.body_m_s
        elastic_n = min(max(-DRAG_STIFFNESS_N_M * self._drag_m, -largest_n), largest_n)
        self._drag_m = -elastic_n / DRAG_STIFFNESS_N_M
        return min(max(elastic_n - DRAG_DAMPING_N_S_M * self.body_m_s, -largest_n), largest_n)
