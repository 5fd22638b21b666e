"""Detects a motor whose torque is not the commanded one, by the acceleration of its joint in air.

Limits and gate bound commands. A motor whose torque constant is five times the configured one gives five times as much,
and its current looks healthy. In air the torque that moves a joint is known from its motion,

    m = I dω/dt - τ_gravity(α, β) + τ_friction(θ, ω),

so the commanded torque u follows the line u = m / gain + c. The constant c of each stroke, a motion in one direction,
holds what is not known: dry friction and the weight of clinging mud. Blocks of four ticks average the noise of the
velocity: over T = 10.5 ms its effect on u and m is correlated by no more than 1 / (2 · 4) of their variance. Only
blocks of punctual ticks count: u is the mean of commands that acted equally long.

Two regressions enclose the gain. That of m on u attenuates it where u has other causes, such as mud or cogging; that of
u on m inflates it by the noise of m:

    Σ u m / Σ u²  <=  gain  <=  Σ m² / Σ u m

A motor is too strong if the lower bound is, and too weak if the upper one is. Where the two are further apart than
SAME_FRACTION, the strokes had too little acceleration for a verdict. A rotor with the encoder that crosses the play of
a belt moves alone, up to three times as easily as its joint, and then hits it: after both, the torque has moved the
whole joint. So a sweep is too strong only over three blocks together, 32 ms, as long as a torque of 6 mN·m needs to
cross 1 degree, and without the last three of a stroke, which may end before the hit. What is left may vary too little
to show a gain, so the single blocks must agree. A sweep that the mud lets go of is thrown through that play, so no
block counts that is faster than any path, or so fast that its motor gives no torque any more. A thrown sweep is braked
from the beginning, while mud may still push its flipper: it brakes as one with a weak motor would, so a sweep is too
weak only if its stroke without these blocks says the same. A torque whose changes are as small as a step of its code
proves nothing. One stride proves a gain beyond a factor of 2, three strides together one beyond 1.6. [arm] states the
inertias, which must be as exact.

The sweep joint is watched in the swing and the adduction joint in the insertion, as far as it is in air: a body that
has sunk swings its flippers through the mud, whose resistance to an insertion looks like a weak motor. So an insertion
counts only after a swing of the same walk whose motion its torques explain. An extraction's end is not used, nor an
adduction joint that catches up in a swing: the pull of mud that lets go falls with the acceleration.
"""

from collections import deque
from collections.abc import Sequence
from math import inf
from typing import NamedTuple

from control.computing.exact_sum import exact_sum
from control.faults import Fault, FaultKind
from control.gait.recovery import lowest_point_m
from control.geometry import FlipperGeometry
from control.joint_friction import NO_FRICTION, JointFriction
from control.parameters.arm_mass import ArmMass
from control.records import DriveState, DriveStates, Phase, Torques

BLOCK_TICKS = 4
SLOW_RAD_S = 0.1  # below it dry friction has any direction
FAST_RAD_S = 10.0  # of a joint that the mud has let go: faster than its path
LEAST_BLOCKS = 7  # of a phase
LEAST_NM2 = 1e-6  # of Σ u² about the mean: a torque at its limit varies by the rounding of floats
SAME_FRACTION = 0.5  # of the bounds: r² of the regression
JOINED_BLOCKS = 3  # of a sweep, to one in which a rotor crosses the play of its belt and hits the other side
FACTOR_OF_ONE, FACTOR_OF_THREE = 2.0, 1.6
STRIDES = 3


Block = tuple[float, float]  # commanded torque u, and torque m of the motion


class WatchedJoint(NamedTuple):
    """A joint and its drive."""

    name: str
    friction: JointFriction = NO_FRICTION
    answers_only: bool = False  # when asked
    fastest_rad_s: float = inf  # up to which the motor can give the commanded torque
    torque_step_nm: float = 0.0  # between two codes of a command, of which the nearest is sent


class Moments(NamedTuple):
    """The sums about the mean, over blocks, of the commanded torque u and the torque m of the motion."""

    blocks: int = 0
    uu: float = 0.0
    um: float = 0.0
    mm: float = 0.0

    @classmethod
    def of(cls, blocks: Sequence[Block]) -> "Moments":
        """Return those of a stroke."""
        if not blocks:
            return cls()
        u, m = map(exact_sum, zip(*blocks, strict=True))
        n = len(blocks)
        about = [(a - u / n, b - m / n) for a, b in blocks]
        products = zip(*((a * a, a * b, b * b) for a, b in about), strict=True)
        return cls(n, *map(exact_sum, products))

    def plus(self, other: "Moments") -> "Moments":
        return Moments(self.blocks + other.blocks, self.uu + other.uu, self.um + other.um, self.mm + other.mm)

    @property
    def in_air(self) -> bool:
        """Return whether the torques have few causes but the motion: in mud, a lower bound of the gain near zero."""
        return self.blocks >= LEAST_BLOCKS and FACTOR_OF_THREE * self.um > self.uu

    @property
    def is_line(self) -> bool:
        """Return whether one gain explains the motion."""
        blocks, uu, um, mm = self
        return blocks >= LEAST_BLOCKS and uu >= LEAST_NM2 and um > 0.0 and um * um >= SAME_FRACTION * uu * mm

    @property
    def gain(self) -> float:
        gain: float = (self.mm / self.uu) ** 0.5
        return gain


class Stride(NamedTuple):
    """The moments of a stride's blocks, of its joined blocks, which a rotor in its play does not change, and of those
    after a joint that the mud has thrown is no longer braked.
    """

    blocks: Moments = Moments()
    joined: Moments = Moments()
    driven: Moments = Moments()

    def plus(self, other: "Stride") -> "Stride":
        blocks, joined, driven = self
        return Stride(blocks.plus(other.blocks), joined.plus(other.joined), driven.plus(other.driven))

    def gain_beyond(self, factor: float, torque_step_nm: float = 0.0) -> float | None:
        """Return the gain, if it is certainly beyond this factor or its inverse. A code rounds by step² / 12."""
        blocks, joined, driven = self
        if blocks.uu < blocks.blocks * torque_step_nm * torque_step_nm:
            return None
        if joined.is_line and joined.um > factor * joined.uu and blocks.um > factor * blocks.uu:
            return joined.gain
        is_weak = all(each.is_line and factor * each.mm < each.um for each in (blocks, driven))
        return blocks.gain if is_weak else None


class JointStrokes:
    """Owns the sums of one joint: of the stroke under way, of the stride under way, and of the last strides."""

    def __init__(self, joint: WatchedJoint, inertia_kg_m2: float, joins: int) -> None:
        self.joint = joint
        self._fast_rad_s = min(FAST_RAD_S, joint.fastest_rad_s)
        self.inertia_kg_m2 = inertia_kg_m2
        self.friction = None if joint.friction == NO_FRICTION else joint.friction
        self._joins = joins
        self._stroke: list[Block] = []
        self._braked = 0  # blocks at its beginning: the mud has thrown the joint
        self._stride = Stride()
        self._strides: deque[Stride] = deque(maxlen=STRIDES)

    def add(self, before: DriveState, state: DriveState, torque_nm: float, gravity_nm: float) -> None:
        """Add a block between two states in air; one that is slow or turns ends the stroke."""
        first_rad_s, last_rad_s = before.velocity_rad_s, state.velocity_rad_s
        elapsed_s = state.angle_stamp_s - before.angle_stamp_s
        if not (
            (first_rad_s > SLOW_RAD_S and last_rad_s > SLOW_RAD_S)
            or (first_rad_s < -SLOW_RAD_S and last_rad_s < -SLOW_RAD_S)
        ):
            self.end_stroke()
            return
        if max(abs(first_rad_s), abs(last_rad_s)) > self._fast_rad_s:
            self._clear_stroke()
            return
        if elapsed_s <= 0.0:
            return
        moving_nm = self.inertia_kg_m2 * (last_rad_s - first_rad_s) / elapsed_s - gravity_nm
        if self.friction is not None:
            moving_nm += self.friction.torque_nm(state.angle_rad, (first_rad_s + last_rad_s) / 2.0)
        if self._joins > 1 and torque_nm * last_rad_s < 0.0 and self._braked == len(self._stroke):
            self._braked += 1
        self._stroke.append((torque_nm, moving_nm))

    def _clear_stroke(self) -> None:
        self._stroke.clear()
        self._braked = 0

    def end_stroke(self) -> None:
        blocks, joins = self._stroke, self._joins
        if len(blocks) > joins:
            crossed = blocks[:-joins] if joins > 1 else blocks  # in the last ones a rotor may still be in its play
            rows = zip(*[iter(crossed)] * joins, strict=False)
            joined = [(exact_sum(u for u, _ in row) / joins, exact_sum(m for _, m in row) / joins) for row in rows]
            whole = Moments.of(blocks)
            driven = Moments.of(blocks[self._braked :]) if self._braked else whole
            self._stride = self._stride.plus(Stride(whole, Moments.of(joined), driven))
        self._clear_stroke()

    def end_stride(self) -> Stride:
        """Return the moments of the stride, and begin the next one."""
        stride, self._stride = self._stride, Stride()
        return stride

    def fault_of(self, stride: Stride) -> Fault | None:
        """Return a fault if this stride, or the last three, prove a wrong gain."""
        self._strides.append(stride)
        step_nm = self.joint.torque_step_nm
        gain = stride.gain_beyond(FACTOR_OF_ONE, step_nm)
        if gain is None and len(self._strides) == STRIDES:
            first, second, third = self._strides
            gain = first.plus(second).plus(third).gain_beyond(FACTOR_OF_THREE, step_nm)
        if gain is None:
            return None
        self._strides.clear()
        return FaultKind.TORQUE_GAIN.fault(self.joint.name, gain=gain, most=FACTOR_OF_THREE)


class FlipperStrokes:
    """Owns the block under way of one flipper, and its joint that this phase watches."""

    def __init__(self, first: int, joints: Sequence[WatchedJoint], geometry: FlipperGeometry, mass: ArmMass) -> None:
        """`first`: of the flipper's joints among all."""
        self._first = self._watched = first
        self._geometry, self._mass = geometry, mass
        self._commands = [
            slice(0, BLOCK_TICKS) if joint.answers_only else slice(1, BLOCK_TICKS + 1) for joint in joints
        ]
        inertias_kg_m2 = (mass.sweep_inertia_kg_m2, mass.adduction_inertia_kg_m2)
        self._sweep, adduction = map(JointStrokes, joints, inertias_kg_m2, (JOINED_BLOCKS, 1))
        self._joint_of = {Phase.SWING: self._sweep, Phase.INSERTION: adduction}
        self._joint: JointStrokes | None = None  # that this phase watches
        self._swung_in_air = False

    def begin_block(self, states: DriveStates) -> None:
        sweep, adduction = states[self._first], states[self._first + 1]
        self._before = sweep if self._joint is self._sweep else adduction
        self._air = lowest_point_m(self._geometry, sweep.angle_rad, adduction.angle_rad) < 0.0  # not of NaN

    def end_block(self, states: DriveStates, sent_nm: Sequence[Torques]) -> None:
        """`sent_nm`: in the tick before the block, and in its ticks."""
        joint, before, was_air = self._joint, self._before, self._air
        self.begin_block(states)
        if joint is None:
            return
        if not (self._air and was_air):
            joint.end_stroke()
            return
        watched = self._watched
        torque_nm = 0.0
        for torques_nm in sent_nm[self._commands[watched - self._first]]:
            torque_nm += torques_nm[watched] / BLOCK_TICKS
        gravity_nm = self._mass.gravity_torques_nm(states[self._first].angle_rad, states[self._first + 1].angle_rad)
        joint.add(before, self._before, torque_nm, gravity_nm[watched - self._first])

    def begin_phase(self, found: list[Fault], phase: Phase, gap: bool) -> None:
        """Add the faults of the phase that ends. After a gap in a phase only the stroke ends."""
        joint, self._joint = self._joint, self._joint_of.get(phase)
        self._watched = self._first if self._joint is self._sweep else self._first + 1
        if phase is Phase.REST:  # the body may sink before the next walk
            self._swung_in_air = False
        if joint is None:
            return
        joint.end_stroke()
        if gap:
            return
        stride = joint.end_stride()
        fault = joint.fault_of(stride) if joint is self._sweep or self._swung_in_air else None
        if joint is self._sweep:
            self._swung_in_air = stride.blocks.in_air and phase is not Phase.REST
        if fault:
            found.append(fault)


class TorqueGainMonitor:
    """Owns the phase and the commands of the block under way."""

    def __init__(self, flippers: Sequence[FlipperStrokes]) -> None:
        self._flippers = flippers
        self._phase = Phase.REST
        self._sent_nm: list[Torques] = []  # in the tick before the block, and in its ticks

    def update(
        self, found: list[Fault], punctual: bool, states: DriveStates, torques_nm: Torques, phase: Phase
    ) -> None:
        """Add the faults of this tick. The torques were sent in the tick before, in this phase."""
        if phase is not self._phase or not punctual:
            for flipper in self._flippers:
                flipper.begin_phase(found, phase, phase is self._phase)
                flipper.begin_block(states)
            self._phase, self._sent_nm = phase, [torques_nm]
        elif phase is Phase.SWING or phase is Phase.INSERTION:
            self._sent_nm.append(torques_nm)
            if len(self._sent_nm) > BLOCK_TICKS:
                for flipper in self._flippers:
                    flipper.end_block(states, self._sent_nm)
                self._sent_nm = [torques_nm]
