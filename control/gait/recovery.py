"""Recovery of a flipper that is still stuck in the mud after its extraction.

A stride continues with its swing when the lower edges of both plates are out, by the measured joint angles. A late
flipper gets a short grace period at full torque; then it is recovered, because the swing would push the body back with
the plate in the mud (the paper's extraction failure). Each attempt first releases the torque, so that the mud relaxes,
and then lifts from the present pose while the sweep rocks: at full torque, most of each period in one direction and the
rest of it back.

A steady pull at full torque comes to rest where mud, joints and body balance. A torque that reverses suddenly throws
the plate against the mud's spring by half beyond that balance, and away from the middle of the sweep the load on the
plate's face has a lifting component too (by the sine of the sweep angle). Each such peak lifts the plate a little; to
sink by as much, the mud would have to yield in the other direction. The first attempt rocks on in the direction of the
stance, to the rear in a walk forward, and takes the body along. The later ones rock away from the middle on the
flipper's side, where the lever l cos α of the mud that sticks to the plate is shorter too.

In simulated clay of up to 9 kPa, at commanded depths of 3 to 5 cm, the flippers of a first stride came out within 12 s
(in walks of four strides at 4 to 5 cm all came out in 7 and 9 kPa; in 8 kPa those of the third stayed); the body moved
8 to 11 cm forward meanwhile, and never more than 4 mm back. A steady pull freed no flipper from 6 kPa and 5 cm on;
rocking at half the rate, or equally long in both directions, did not free 9 kPa, and with bodies of half or three times
the mass some flippers stayed stuck from 7.5 kPa on. Real mud may differ: it has not been tried there.

The target of a rocked joint leads it at rest, so that a plate that comes free is braked. The target of the lift leads
by no more, so that the flipper does not fly up. The swing begins where the recovery ends, and the gap between their
targets fades out without a jump of position or velocity.
"""

from collections.abc import Sequence
from math import copysign, cos, fsum, inf, radians, sin

from control.gait.gait import RAMP_S
from control.gait.joint_path import Gap, still, with_gaps
from control.gait.stride_table import swing_duration_s
from control.geometry import FlipperGeometry
from control.limits import JointRange, clip
from control.parameters.gait_parameters import GaitParameters
from control.parameters.recovery_parameters import RecoveryParameters
from control.records import (
    TWO_FLIPPERS,
    DriveStates,
    Joints,
    JointTarget,
    JointTargets,
    Rig,
    same_for_all,
    same_for_each,
)

OUT_M = 0.003  # depth of the plate's lowest point up to which a flipper counts as out of the mud
RISE_S = 0.2  # to reach the height of the swing
AWAY_FRACTION = 0.8  # of each rocking; the rest is back


def lowest_point_m(geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float) -> float:
    """Return the depth of the plate's lower corner below the nominal surface."""
    per_outward, per_upward = -cos(sweep_rad) * sin(adduction_rad), cos(adduction_rad)
    return geometry.depth_m(sweep_rad, adduction_rad) + geometry.plate.below_origin_m(per_outward, per_upward)


def is_in_mud(geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float) -> bool:
    return lowest_point_m(geometry, sweep_rad, adduction_rad) > OUT_M


class Recovery:
    """Owns the attempts in the stride under way, and the gap that they leave in its swing."""

    def __init__(
        self,
        parameters: RecoveryParameters,
        geometry: FlipperGeometry,
        gait: GaitParameters,
        ranges: Joints[JointRange],
        rig: Rig = TWO_FLIPPERS,
    ) -> None:
        self.parameters = parameters
        self.rig = rig
        self.geometry = geometry
        self._ranges = ranges
        self._sweep_range, self._adduction_range = ranges.flippers[0]  # the same for all flippers
        self._quickest_s = swing_duration_s(gait, geometry)
        self.reset()

    def reset(self, swing_s: float = inf) -> None:
        """Forget the attempts; `swing_s` is the duration of the next swing. Those after it may be as quick as any."""
        swing_s = min(swing_s, self._quickest_s)
        self._fade_s = same_for_each(swing_s, min(RISE_S, swing_s), self.rig)
        self.attempt = 0  # under way; 0: none
        self.given_up: Sequence[str] = ()  # flippers that the last attempt has not freed
        self.events = ""  # of this step, for the log
        self._waits = False
        self._time_s = 0.0  # since the wait, the attempt or the following swing began
        self._targets: JointTargets = still(same_for_all(0.0, self.rig))
        self._direction = -1.0  # of the rocking sweep: 1 forward, -1 to the rear
        self._gaps: tuple[Gap, ...] = ()

    def stuck(self, states: DriveStates) -> tuple[str, ...]:
        """Return the flippers in the mud; none if the recovery is configured off."""
        if not self.parameters.attempts:
            return ()
        return tuple(
            flipper
            for flipper, (sweep, adduction) in zip(self.rig.flippers, states.flippers, strict=True)
            if is_in_mud(self.geometry, sweep.angle_rad, adduction.angle_rad)
        )

    def step(
        self,
        dt_s: float,
        stuck: Sequence[str],
        states: DriveStates,
        wanted: JointTargets,
        at_work: Sequence[str] = (),
    ) -> JointTargets:
        """Return the gait's targets, or those of an attempt while flippers are `stuck`; those `at_work` stay there."""
        self.events = ""
        if self._waits is not bool(stuck):
            self._waits, self._time_s = bool(stuck), 0.0
            if self.attempt:
                self._end(wanted)
        self._time_s += dt_s
        if not stuck:
            return self._faded(wanted)
        if self._time_s > self._allowed_s:
            self._begin_attempt(stuck, states, wanted)
        if not self.attempt:
            return wanted
        targets = self._pull(dt_s, stuck, states)
        for joints in map(self.rig.joints_of, at_work):
            targets = Joints(*targets[: joints.start], *wanted[joints], *targets[joints.stop :])
        self._targets = targets
        return targets

    @property
    def _allowed_s(self) -> float:
        return self.parameters.pause_s + self.parameters.attempt_s if self.attempt else self.parameters.grace_s

    def _begin_attempt(self, stuck: Sequence[str], states: DriveStates, wanted: JointTargets) -> None:
        """Begin the next attempt from the present pose; after the last one, give up."""
        if self.attempt == self.parameters.attempts:
            self.given_up = stuck
            return
        self.attempt += 1
        self._time_s = 0.0
        angles_rad = states.map(lambda state: state.angle_rad)
        self._targets = still(angles_rad)
        stroke_rad = wanted.map(lambda target: target.angle_rad)  # ends where the first attempt goes on
        away_rad = stroke_rad if self.attempt == 1 else angles_rad
        self._direction = copysign(1.0, fsum(away_rad[self.rig.joints_of(name)][0] for name in stuck))
        self.events = f"{_are_stuck(stuck)}, attempt {self.attempt} of {self.parameters.attempts}"

    def _pull(self, dt_s: float, stuck: Sequence[str], states: DriveStates) -> JointTargets:
        """Lift all flippers and rock the stuck ones in the same direction, so that the body does not turn."""
        pulled_s = self._time_s - self.parameters.pause_s
        if pulled_s < 0.0:
            return self._targets
        direction = self._direction if pulled_s / self.parameters.rock_s % 1.0 < AWAY_FRACTION else -self._direction
        speed_rad_s = min(pulled_s / RAMP_S, 1.0) * self.parameters.lift_rad_s
        step_rad, targets = dt_s * speed_rad_s, self._targets
        pulled: list[JointTarget] = []
        for name, target, state in zip(self.rig.flippers, targets.flippers, states.flippers, strict=True):
            pulled.append(self._ahead(direction, state.sweep.angle_rad) if name in stuck else target.sweep)
            pulled.append(self._raised(step_rad, dt_s, target.adduction, state.adduction.angle_rad))
        return Joints(*pulled)

    def _ahead(self, direction: float, here_rad: float) -> JointTarget:
        """Return a target far enough ahead for full torque, within the joint's limits."""
        return JointTarget(clip(here_rad + direction * radians(self.parameters.lead_deg), *self._sweep_range), 0.0)

    def _raised(self, step_rad: float, dt_s: float, target: JointTarget, here_rad: float) -> JointTarget:
        """Return the next target towards a level arm, close to the joint's angle and within its limits."""
        lead_rad = radians(self.parameters.lead_deg)
        angle_rad = clip(0.0, target.angle_rad - step_rad, target.angle_rad + step_rad)
        angle_rad = clip(clip(angle_rad, here_rad - lead_rad, here_rad + lead_rad), *self._adduction_range)
        return JointTarget(angle_rad, clip((angle_rad - target.angle_rad) / dt_s, -step_rad / dt_s, step_rad / dt_s))

    def _end(self, wanted: JointTargets) -> None:
        """End the recovery: all flippers are out."""
        self.events = f"the flippers came out after {self.attempt} attempt{'s' if self.attempt > 1 else ''}"
        self.attempt = 0
        self._gaps = tuple(
            Gap(target.angle_rad - gait.angle_rad, target.velocity_rad_s - gait.velocity_rad_s, duration_s)
            for target, gait, duration_s in zip(self._targets, wanted, self._fade_s, strict=True)
        )

    def _faded(self, wanted: JointTargets) -> JointTargets:
        """Return the gait's targets plus the rest of the gaps."""
        if not self._gaps:
            return wanted
        faded = with_gaps(wanted, self._gaps, self._time_s)
        if self._time_s >= max(self._fade_s):
            self._gaps = ()
        spans = zip(faded, self._ranges, strict=True)
        return Joints(*(target._replace(angle_rad=clip(target.angle_rad, *span)) for target, span in spans))


def _are_stuck(flippers: Sequence[str]) -> str:
    return f"the {flippers[0]} flipper is stuck" if len(flippers) == 1 else "both flippers are stuck"
