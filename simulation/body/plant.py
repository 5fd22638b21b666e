"""The robot's mechanics: arms with two joints each, and a body on a rail, on a fixed base or free.

Arms have a constant inertia about each joint, the gravity of a level body, and friction. Their mass is small compared
with the body's, so their acceleration does not move the body. Viscous friction grows with speed. Coulomb friction, off
at 0, opposes a turning joint with a constant torque and holds a resting one against less than that. It is solved for
the velocity at the end of a step, which it brings to zero but never reverses, so a joint sticks and steps of any length
are stable. Belts with play, off at 0, let each motor turn apart from its joint (belt.py). Each arm has its own history
of earlier strokes, whose effects are off by default. The sources write `lift_nm` for the torque that raises the
adduction joint. The integrator is semi-implicit Euler at STEP_S: the stiffest spring, mud along a plate 5 cm deep in
the stiffest of the paper's muds, makes the arm swing at about 400 rad/s.
"""

from itertools import chain
from math import radians, sin
from operator import add
from random import Random

from control.records import JointAngles, Joints, Torques
from simulation.body.belt import Belt, slowed
from simulation.body.bench_mount import BenchMount
from simulation.body.free_body import FreeBody
from simulation.body.plant_parameters import PlantParameters
from simulation.body.rail_body import Body, BodyMotion, DragPad, RailBody
from simulation.mud.carriage import Carriage
from simulation.mud.disturbances import NONE, StrokeHistory, clinging_torques_nm
from simulation.mud.flipper_contact import (
    NO_CONTACT,
    ArmMotion,
    ContactForce,
    FlipperContact,
    attitude_of,
    contact_force,
)
from simulation.mud.rigid_plate import Attitude, lowest_point_m
from simulation.mud.stones import NO_PUSH, StoneContact, push_wrench
from simulation.mud.track import Track

STEP_S = 0.001
END_STOPS_RAD = (radians(100.0), radians(85.0))  # sweep, adduction: the arm meets the body


class Arm:
    """Owns the motion of one flipper arm."""

    def __init__(self, parameters: PlantParameters, track: Track, seed: int, trial_surface_m: float = 0.0) -> None:
        self.parameters = parameters
        self.track = track
        self.history = StrokeHistory(parameters.disturbances, seed, trial_surface_m)
        self.stones = StoneContact(track.stones) if track.stones else None
        self._disturbed = parameters.disturbances != NONE
        self.mount: BenchMount | None = None  # over the edge of a bench, in place of the mud
        play_rad, mass = radians(parameters.disturbances.play_deg), parameters.arm_mass
        inertias_kg_m2 = (mass.sweep_inertia_kg_m2, mass.adduction_inertia_kg_m2) if play_rad else ()
        self.belts = tuple(Belt(play_rad, inertia_kg_m2) for inertia_kg_m2 in inertias_kg_m2)
        self.reset()

    def reset(self) -> None:
        """Put the arm at rest with the plate's edge on the mud, as a robot lies when its motors are off."""
        self.contact = FlipperContact(self.parameters.geometry, self.parameters.disturbances.relaxation)
        self.history.reset()
        self.put_back()
        self.force = NO_CONTACT
        self.ground = self.track.ground_at(0.0)

    def put_back(self, body_m: float = 0.0) -> None:
        """Move the arm as an operator does by hand: straight out, the plate's edge on the mud; level on a bench.

        The mud keeps the effects of earlier strokes. `body_m`: the body's position along the track.
        """
        self.relief_m = self.track.surface_m(body_m)  # depth of the track's own surface, without earlier strokes
        self.sweep_rad = self.sweep_velocity_rad_s = self.adduction_velocity_rad_s = self.adduction_rad = 0.0
        if not self.mount:
            self.adduction_rad = self.parameters.geometry.adduction_rad(0.0, self.surface_m)
        self.contact.reset()
        if self.stones:
            self.stones.reset()
        for belt, angle_rad in zip(self.belts, (self.sweep_rad, self.adduction_rad), strict=False):
            belt.put(angle_rad)

    @property
    def motors(self) -> tuple[float, float, float, float]:
        """The angle and the velocity of the (sweep, adduction) motors, which their encoders measure."""
        if self.belts:
            sweep, adduction = self.belts
            return sweep.angle_rad, sweep.velocity_rad_s, adduction.angle_rad, adduction.velocity_rad_s
        return self.sweep_rad, self.sweep_velocity_rad_s, self.adduction_rad, self.adduction_velocity_rad_s

    @property
    def surface_m(self) -> float:
        """The depth of the mud under this flipper below its nominal surface."""
        return self.relief_m + self.history.surface_m

    def step(
        self,
        dt_s: float,
        body_m: float,
        body_m_s: float,
        sweep_nm: float,
        lift_nm: float,
        carriage: Carriage | None = None,
    ) -> None:
        """`carriage`: how a free body carries this arm."""
        if self.belts:
            sweep_nm, lift_nm = self._transmit(dt_s, sweep_nm, lift_nm)
        if self.mount:
            self._step_on_bench(self.mount, dt_s, sweep_nm, lift_nm)
            return
        sweep_rad, adduction_rad, geometry = self.sweep_rad, self.adduction_rad, self.parameters.geometry
        attitude = attitude_of(geometry, sweep_rad, adduction_rad, carriage=carriage)
        edge_m = body_m + geometry.flipper_length_m * sin(sweep_rad)
        self._meet_mud(edge_m, attitude)
        rates = self.sweep_velocity_rad_s, self.adduction_velocity_rad_s
        motion = ArmMotion(sweep_rad, adduction_rad, *rates, body_m_s)
        surface_m = self.surface_m
        below = attitude.below(surface_m) if surface_m else attitude
        self.force = self.contact.step(dt_s, self.ground, motion, below, carriage, edge_m)
        if self.stones:
            self._meet_stones(self.stones, dt_s, edge_m, attitude)
        load_sweep_nm, load_lift_nm = self._load_nm()
        mass = self.parameters.arm_mass
        self._move(
            dt_s,
            sweep_nm + load_sweep_nm,
            lift_nm + load_lift_nm,
            mass.sweep_inertia_kg_m2,
            mass.adduction_inertia_kg_m2,
        )

    def come_to_rest(self, dt_s: float) -> None:
        self._turn(dt_s, self.sweep_velocity_rad_s / 2.0, self.adduction_velocity_rad_s / 2.0)
        self.sweep_velocity_rad_s = self.adduction_velocity_rad_s = 0.0
        for belt in self.belts:
            belt.angle_rad += dt_s * belt.velocity_rad_s / 2.0
            belt.velocity_rad_s = 0.0

    def _transmit(self, dt_s: float, sweep_nm: float, lift_nm: float) -> tuple[float, float]:
        """Turn the motors for a step; return the torques of their belts on the arm."""
        sweep, lift = self.belts
        return (
            sweep.transmit(dt_s, sweep_nm, self.sweep_rad, self.sweep_velocity_rad_s),
            lift.transmit(dt_s, lift_nm, self.adduction_rad, self.adduction_velocity_rad_s),
        )

    def _step_on_bench(self, mount: BenchMount, dt_s: float, sweep_nm: float, lift_nm: float) -> None:
        if mount.held:
            self.sweep_velocity_rad_s = self.adduction_velocity_rad_s = 0.0
            return
        mass, friction_nm_s = self.parameters.arm_mass, self.parameters.joint_friction_nm_s
        gravity_sweep_nm, gravity_lift_nm = mount.gravity_torques_nm(mass, self.sweep_rad, self.adduction_rad)
        sweep_nm += gravity_sweep_nm - friction_nm_s * self.sweep_velocity_rad_s
        lift_nm += gravity_lift_nm - friction_nm_s * self.adduction_velocity_rad_s
        self._move(dt_s, sweep_nm, lift_nm, *mount.inertias_kg_m2(mass))

    def _meet_mud(self, edge_m: float, attitude: Attitude) -> None:
        """Find the ground under the flipper, its remaining firmness after earlier strokes, and its height."""
        self.relief_m = self.track.surface_m(edge_m)
        if self._disturbed:
            deepest_m = lowest_point_m(attitude, self.contact.size)
            self.history.step(deepest_m - self.relief_m, edge_m)
        ground, firmness = self.track.ground_at(edge_m), self.history.firmness
        self.ground = ground if firmness == 1.0 else ground.scaled(firmness)

    def _meet_stones(self, stones: StoneContact, dt_s: float, edge_m: float, attitude: Attitude) -> None:
        geometry, sweep_rad = self.parameters.geometry, self.sweep_rad
        push = stones.step(dt_s, edge_m, lowest_point_m(attitude, self.contact.size))
        if push is not NO_PUSH:
            pushed = contact_force(geometry, sweep_rad, push_wrench(geometry, sweep_rad, attitude, push))
            self.force = ContactForce(*map(add, self.force, pushed))

    def _load_nm(self) -> tuple[float, float]:
        """Return the torque of mud, clinging mud, gravity and friction on (sweep, adduction)."""
        parameters, force = self.parameters, self.force
        sweep_nm, lift_nm = parameters.arm_mass.gravity_torques_nm(self.sweep_rad, self.adduction_rad)
        sweep_nm += force.sweep_nm - parameters.joint_friction_nm_s * self.sweep_velocity_rad_s
        lift_nm += force.adduction_nm - parameters.joint_friction_nm_s * self.adduction_velocity_rad_s
        weight_n = self.history.clinging_n
        if weight_n:
            hanging = clinging_torques_nm(parameters.geometry, self.sweep_rad, self.adduction_rad, weight_n)
            sweep_nm, lift_nm = sweep_nm + hanging[0], lift_nm + hanging[1]
        return sweep_nm, lift_nm

    def _move(
        self, dt_s: float, sweep_nm: float, lift_nm: float, sweep_inertia_kg_m2: float, lift_inertia_kg_m2: float
    ) -> None:
        if self.belts:  # which turn the rotors
            sweep_inertia_kg_m2 -= self.belts[0].rotor_kg_m2
            lift_inertia_kg_m2 -= self.belts[1].rotor_kg_m2
        coulomb_nm, disturbances = self.parameters.joint_coulomb_nm, self.parameters.disturbances
        sweep_dry_nm = coulomb_nm + disturbances.sweep_friction_nm
        lift_dry_nm = coulomb_nm + disturbances.adduction_friction_nm
        sweep_rad_s = self.sweep_velocity_rad_s + dt_s * sweep_nm / sweep_inertia_kg_m2
        lift_rad_s = self.adduction_velocity_rad_s + dt_s * lift_nm / lift_inertia_kg_m2
        if sweep_dry_nm:
            sweep_rad_s = slowed(sweep_rad_s, dt_s * sweep_dry_nm / sweep_inertia_kg_m2)
        if lift_dry_nm:
            lift_rad_s = slowed(lift_rad_s, dt_s * lift_dry_nm / lift_inertia_kg_m2)
        self._turn(dt_s, sweep_rad_s, lift_rad_s)

    def _turn(self, dt_s: float, sweep_rad_s: float, lift_rad_s: float) -> None:
        """Turn the joints at these velocities, as far as their stops."""
        self.sweep_rad, self.sweep_velocity_rad_s = _moved(self.sweep_rad, sweep_rad_s, dt_s, END_STOPS_RAD[0])
        self.adduction_rad, self.adduction_velocity_rad_s = _moved(
            self.adduction_rad, lift_rad_s, dt_s, END_STOPS_RAD[1]
        )


def _moved(angle_rad: float, velocity_rad_s: float, dt_s: float, stop_rad: float) -> tuple[float, float]:
    angle_rad += velocity_rad_s * dt_s
    if -stop_rad < angle_rad < stop_rad:
        return angle_rad, velocity_rad_s
    return min(max(angle_rad, -stop_rad), stop_rad), 0.0


def body_of(parameters: PlantParameters, track: Track) -> Body:
    mass_kg, pad = parameters.body_mass_kg, DragPad(parameters.pad_width_m, parameters.pad_depth_m)
    if parameters.free_body:
        return FreeBody(mass_kg, parameters.body, pad, track, parameters.rig)
    damping_n_s_m = parameters.rail_damping_n_s_m
    return RailBody(mass_kg, parameters.rail_drag_n, damping_n_s_m, pad, track, parameters.rig)


class Plant:
    """Owns the mechanical state of the robot on its track. `random` gives each flipper's history its seed."""

    def __init__(self, parameters: PlantParameters, track: Track, random: Random | None = None) -> None:
        self.parameters = parameters
        self.track = track
        random = random or Random(1)
        seeds = tuple(random.getrandbits(32) for _ in parameters.rig.flippers)
        surface_m = Random(f"surface {seeds}").gauss(0.0, parameters.disturbances.trial_surface_sd_m)
        self.arms = tuple(Arm(parameters, track, seed, surface_m) for seed in seeds)
        self.body = body_of(parameters, track)
        self.reset()

    def reset(self) -> None:
        for arm in self.arms:
            arm.reset()
        self.body.reset()

    def put_back(self) -> None:
        """Set the robot down where it is as an operator does by hand, its flippers straight out on the mud."""
        self.body.put_down()
        for arm in self.arms:
            arm.put_back(self.body_m)

    def come_to_rest(self, dt_s: float) -> None:
        """Slow the joints down evenly in time that a simulation has lost, over half of their way; the body goes on."""
        for arm in self.arms:
            arm.come_to_rest(dt_s)
        self.body.forward_m += dt_s * self.body.forward_m_s

    @property
    def body_m(self) -> float:
        """The body's position along the track."""
        return self.body.forward_m

    @property
    def body_m_s(self) -> float:
        return self.body.forward_m_s

    @property
    def motion(self) -> BodyMotion:
        return self.body.motion

    @property
    def angles_rad(self) -> JointAngles:
        return Joints(*chain.from_iterable([(arm.sweep_rad, arm.adduction_rad) for arm in self.arms]))

    @property
    def velocities_rad_s(self) -> JointAngles:
        velocities_rad_s = [(arm.sweep_velocity_rad_s, arm.adduction_velocity_rad_s) for arm in self.arms]
        return Joints(*chain.from_iterable(velocities_rad_s))

    def step(self, dt_s: float, torques_nm: Torques) -> None:
        body, joint = self.body, 0
        for arm, carriage in zip(self.arms, body.carriages, strict=True):
            arm.step(dt_s, body.forward_m, body.forward_m_s, torques_nm[joint], torques_nm[joint + 1], carriage)
            joint += 2
        if not self.parameters.fixed_base:
            body.step(dt_s, *self.arms)
