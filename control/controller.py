"""The controller turns a mode into wanted torques: hold a pose, walk, raise the flippers, or brake the joints.

It owns the gait, the recovery of stuck flippers, and the paths into and out of the gait. In modes without torque it
wants none. The limits decide which torques leave for the drives (control/limits.py).
"""

from collections.abc import Callable, Sequence
from math import inf
from typing import NamedTuple

from control.faults import Fault, FaultKind
from control.gait.gait import Gait
from control.gait.joint_path import JointPath, still
from control.gait.recovery import Recovery
from control.gait.stride_table import stride_duration_s, swing_duration_s
from control.geometry import FlipperGeometry
from control.joint_pd import VelocityPrediction, damping_torques_nm, joint_torques_nm
from control.modes import HELD, MOVING, Mode
from control.monitors.stillness import Stillness
from control.parameters.arm_mass import ArmMass
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import GaitPath
from control.parameters.joint_gains import JointGains
from control.parameters.motion_parameters import MotionParameters
from control.records import (
    TWO_FLIPPERS,
    DriveStates,
    GaitTarget,
    JointAngles,
    Joints,
    JointTarget,
    JointTargets,
    Phase,
    Rig,
    Torques,
    same_for_all,
    same_for_each,
)

UP_RAD = 0.12  # from level: the edge of a 12 cm arm is then 1.4 cm lower, still out of the mud
RAISING_S = 1.0  # longest wait for flippers that are stuck in the mud
SOFT_STOP_S = 3.0  # longest duration of a soft stop
DAMPING_S = 3.0  # longest damping, for joints that do not come to rest
SETTLED_S = 0.3  # rest of all joints after which damping ends
SETTLED_RAD = 0.02  # motion that still counts as rest
DAMPING_NM = 0.4  # largest damping torque of a joint: half of the motors' limit

HoldLaw = Callable[[Torques, DriveStates], Torques]  # from the torques that hold the pose to those wanted instead


class WalkOrder(NamedTuple):
    depth_m: float  # of every stride; of the first one if adaptive
    adaptive: bool = True
    strides: int = 0  # 0: until a stop is requested
    depths_m: tuple[float, ...] = ()  # of the strides in turn, which show how a mud changes with depth; or none
    gait: GaitParameters | GaitPath | None = None  # None: as configured

    def depth_of(self, stride: int) -> float:
        """Return the depth of a stride of a walk that does not adapt."""
        return self.depths_m[stride % len(self.depths_m)] if self.depths_m else self.depth_m


def measured_angles(states: DriveStates) -> JointAngles:
    return states.map(lambda state: state.angle_rad)


RESTING = GaitTarget(
    phase=Phase.REST,
    stride=-1,
    sweep_rad=0.0,
    sweep_velocity_rad_s=0.0,
    depth_m=0.0,
    depth_velocity_m_s=0.0,
)


class Controller:
    present: DriveStates | None = None  # the states of the last step, as they should be now

    def __init__(
        self,
        gait: GaitParameters,
        geometry: FlipperGeometry,
        gains: JointGains,
        mass: ArmMass,
        motion: MotionParameters,
        recovery: Recovery,
        rig: Rig = TWO_FLIPPERS,
        asked: Sequence[bool] = (),
    ) -> None:
        """`asked`: for each joint, whether its drive answers only when asked; empty: none does."""
        self.rig = rig
        self._asked = asked
        self._flippers = len(rig.flippers)
        self.gait = Gait(gait, geometry)
        self._later: Gait | None = None  # of the right flipper, where it follows the left one's gait later
        self.geometry = geometry
        self.gains = gains
        self.mass = mass
        self.motion = motion
        self.recovery = recovery
        self.order = WalkOrder(0.0)
        self.hold_law: HoldLaw | None = None  # an experiment may replace the torques in HOLD
        self._no_torque: Torques = same_for_all(0.0, rig)
        self.reset()

    def reset(self) -> None:
        self.recovery.reset()
        self._mode = Mode.IDLE
        self._predict = VelocityPrediction(self._asked, self.mass).update if any(self._asked) else None
        self._path: JointPath | None = None
        self._move: JointPath | None = None  # to another pose, in hold
        self._pose: JointTargets = still(same_for_all(0.0, self.rig))
        self._fade = 0.0
        self._up = False
        self._waited_s = 0.0  # since the path that ends a walk arrived
        self.cut_short = False  # the pose that is held is one out of a walk, perhaps in the mud
        self._stillness = [Stillness(SETTLED_RAD) for _ in self.rig.joints]
        self._since_s = self._resting_s = 0.0  # the mode began, all joints rest
        self.target = RESTING
        self.joint_targets: JointTargets | None = None  # of the last step with stiffness
        self.present = None
        self._follows = True  # the torques of the last step, those targets: a hold law did not replace them

    @property
    def walk_finished(self) -> bool:
        """All ordered strides are complete, those of the left flipper where the right one is later."""
        return 0 < self.order.strides <= self.target.stride

    @property
    def raised(self) -> bool:
        """The flippers are up at the end of a walk, or the wait for them is over."""
        waited = self._waited_s > RAISING_S or self._since_s > SOFT_STOP_S
        return self._mode is Mode.STOPPING and (self._up or waited)

    @property
    def settled(self) -> bool:
        """Damped joints are at rest, or the longest damping is over."""
        return self._mode is Mode.DAMPING and (self._resting_s > SETTLED_S or self._since_s > DAMPING_S)

    @property
    def rested(self) -> bool:
        """The pose was held for the configured longest time without a request."""
        return self._mode is Mode.HOLD and 0.0 < self.motion.longest_hold_s < self._since_s

    @property
    def followed_targets(self) -> JointTargets | None:
        """The joint targets of the last step, where the torques follow them."""
        return self.joint_targets if self._mode in HELD and self._follows else None

    @property
    def _held_rad(self) -> JointAngles:
        return self._pose.map(lambda target: target.angle_rad)

    @property
    def moving(self) -> bool:
        """The joints move to a requested pose."""
        return self._move is not None

    def end_move(self) -> None:
        """Stop a move; the joints rest at their present targets."""
        self.hold_pose(self._held_rad)

    def move(self, angles: Sequence[float | None], speed_rad_s: float = inf) -> None:
        """Move the joints slowly to these angles, one for each joint; None leaves a joint at its held angle.

        The speed is the mean one of the joint with the longest path, and never above the configured one.
        """
        held_rad = self._held_rad
        there = Joints(*(angle if angle is not None else here for angle, here in zip(angles, held_rad, strict=True)))
        self.follow_path([there], min(speed_rad_s, self.motion.path_speed_rad_s))

    def follow_path(self, way_points: Sequence[JointAngles], speed_rad_s: float) -> None:
        """In hold, move smoothly from the held pose through these poses, and hold the last one.

        Joints that move already go on without a jump of their velocity.
        """
        begun_rad_s = [target.velocity_rad_s for target in self._pose] if self.moving else []
        self._move = JointPath(self._held_rad, way_points, speed_rad_s, begun_rad_s)

    def hold_pose(self, angles: JointAngles) -> None:
        """In hold, replace the held pose at once."""
        self._move, self._pose = None, still(angles)

    @property
    def fault(self) -> Fault | None:
        """The fault of flippers that every attempt of the recovery left stuck."""
        held = self.recovery.given_up
        if not held:
            return None
        flipper = held[0] if len(held) == 1 else ""  # no single one if several are stuck
        return FaultKind.FLIPPER_STUCK.fault(flipper, attempts=self.recovery.parameters.attempts)

    def is_up(self, states: DriveStates) -> bool:
        return all(abs(adduction.angle_rad) < UP_RAD for _, adduction in states.flippers)

    def step(
        self,
        dt_s: float,
        mode: Mode,
        states: DriveStates,
        trusted: Joints[bool] | None = None,
        elapsed_s: float = 0.0,
        sent_nm: Torques | None = None,
    ) -> Torques:
        """Return the wanted torques; `target` then holds the gait's target that they belong to.

        Joints whose encoder is not `trusted` are not damped, because their speed may be wrong; None: all are trusted.
        `elapsed_s` is the time since the last step if that is more than `dt_s`; paths and gait do not catch up after a
        gap. `sent_nm` are the torques that left in the tick before; None: none.
        """
        if mode is not self._mode:
            self._enter(mode, states)
        self.target = RESTING
        self.present = present = self._predict(states, sent_nm or self._no_torque) if self._predict else states
        if elapsed_s < dt_s:
            elapsed_s = dt_s
        self._since_s += elapsed_s
        if mode not in MOVING:
            return self._no_torque
        if mode is Mode.DAMPING:
            trusted = trusted or same_for_all(True, self.rig)
            self._watch_rest(elapsed_s, states, trusted)
            return damping_torques_nm(present, self.gains, trusted, DAMPING_NM)
        if self._fade < 1.0:
            self._fade = min(1.0, self._fade + dt_s / max(self.motion.fade_in_s, dt_s))
        if mode is Mode.STOPPING and self._path is not None and self._path.finished:
            self._up = self.is_up(states)
            self._waited_s += elapsed_s
        self.joint_targets = self._targets(dt_s, mode, states)
        torques_nm = joint_torques_nm(self.joint_targets, present, self.gains, self.mass, self._fade)
        law = self.hold_law if mode is Mode.HOLD else None
        self._follows = law is None
        return law(torques_nm, states) if law else torques_nm

    def _watch_rest(self, elapsed_s: float, states: DriveStates, trusted: Joints[bool]) -> None:
        still = [each.update(state.angle_rad, elapsed_s) for each, state in zip(self._stillness, states, strict=True)]
        rests = all(quiet or not trust for quiet, trust in zip(still, trusted, strict=True))
        self._resting_s = self._resting_s + elapsed_s if rests else 0.0

    def _enter(self, mode: Mode, states: DriveStates) -> None:
        self.recovery.reset()
        self._move = None
        self._since_s = self._resting_s = 0.0
        for stillness in self._stillness:
            stillness.reset()
        here = measured_angles(states)
        self.cut_short = mode is Mode.HOLD and self._mode is Mode.WALKING
        if mode is Mode.HOLD:
            # flippers that the mud kept from rising stay where they are, or they would pull at it at full torque
            self._pose = self._pose if self._mode is Mode.STOPPING and self._up else still(here)
        elif mode is Mode.WALKING:
            self._begin_gait()
            self._path = self._path_to_start(here)
        elif mode is Mode.STOPPING:
            self._path = JointPath(here, [self._raised(here)], self.motion.path_speed_rad_s)
            self._up, self._waited_s = False, 0.0
        if mode not in MOVING:
            self._fade = 0.0
        self._mode = mode

    def _raised(self, angles: JointAngles) -> JointAngles:
        """Return the pose with level arms, in which the lower edges are `clearance_m` above the mud."""
        return Joints(*(value for sweep_rad, _ in angles.flippers for value in (sweep_rad, 0.0)))

    def _begin_gait(self) -> None:
        depth_m, gait = self.order.depth_m, self.order.gait
        self.gait.reset(depth_m, gait)
        self._later = None
        if gait is None:
            return
        self.recovery.reset(swing_duration_s(gait, self.geometry))
        if isinstance(gait, GaitPath) and gait.right_offset_fraction and self._flippers > 1:
            self._later = Gait(self.gait.parameters, self.geometry)
            late_s = gait.right_offset_fraction * stride_duration_s(gait, self.geometry, depth_m)
            self._later.reset(depth_m, gait, late_s)

    def _path_to_start(self, here: JointAngles) -> JointPath:
        sweep_rad, depth_m = self.gait.start
        up_rad = self.geometry.adduction_rad(sweep_rad, depth_m) if self.gait.path else 0.0  # 0: without rounding
        way_points = [self._raised(here), same_for_each(sweep_rad, up_rad, self.rig)]
        return JointPath(here, way_points, self.motion.path_speed_rad_s)

    def _targets(self, dt_s: float, mode: Mode, states: DriveStates) -> JointTargets:
        if mode is Mode.HOLD or self._path is None:
            return self._held_pose(dt_s)
        if mode is Mode.STOPPING or not self._path.finished:
            self._pose = self._path.step(dt_s)
            return self._pose
        return self._gait_targets(dt_s, states)

    def _held_pose(self, dt_s: float) -> JointTargets:
        if self._move is not None:
            self._pose = self._move.step(dt_s)
            self._since_s = 0.0  # the pose is in use
            if self._move.finished:
                self._move = None
        return self._pose

    def _gait_targets(self, dt_s: float, states: DriveStates) -> JointTargets:
        """Return the gait's targets, or those of the recovery while flippers are stuck before the swing."""
        if self._later is not None:
            return self._targets_apart(dt_s, states, self._later)
        stuck = self.recovery.stuck(states) if self.gait.swing_is_near else ()
        self.target = self.gait.step(dt_s, may_swing=not stuck)
        waits_for = stuck if self.gait.waits else ()
        targets = self.recovery.step(dt_s, waits_for, states, self._follow(self.target))
        if self.recovery.attempt:
            self.target = self.target._replace(phase=Phase.RECOVERY)
        return targets

    def _targets_apart(self, dt_s: float, states: DriveStates, later: Gait) -> JointTargets:
        """Return the targets of flippers at different points of the gait: all stand still while one is stuck."""
        gaits = dict(zip(self.rig.flippers, (self.gait, later), strict=True))
        stuck = [flipper for flipper in self.recovery.stuck(states) if gaits[flipper].swing_is_near]
        stands = any(gaits[flipper].waits for flipper in stuck)
        targets = [
            gait.step(0.0 if stands and flipper not in stuck else dt_s, flipper not in stuck)
            for flipper, gait in gaits.items()
        ]
        adaptive = self.order.adaptive
        later.next_depth_m = self.gait.next_depth_m if adaptive else self.order.depth_of(later.stride + 1)
        self.target = targets[0]._replace(phase=Phase.STROKE)
        wanted: JointTargets = Joints(*(joint for target in targets for joint in self._follow(target)[:2]))
        waits_for = [flipper for flipper in stuck if gaits[flipper].waits]
        at_work = [flipper for flipper in gaits if flipper not in waits_for]
        joints = self.recovery.step(dt_s, waits_for, states, wanted, at_work)
        if self.recovery.attempt:
            self.target = self.target._replace(phase=Phase.RECOVERY)
        return joints

    def _follow(self, target: GaitTarget) -> JointTargets:
        """Return the joint targets of a gait target, the same for all flippers."""
        sweep = JointTarget(target.sweep_rad, target.sweep_velocity_rad_s)
        angle_rad = self.geometry.adduction_rad(target.sweep_rad, target.depth_m)
        velocity_rad_s = self.geometry.adduction_velocity_rad_s(
            target.sweep_rad, angle_rad, target.sweep_velocity_rad_s, target.depth_velocity_m_s
        )
        adduction = JointTarget(angle_rad, velocity_rad_s)
        return Joints(*(sweep, adduction) * self._flippers)
