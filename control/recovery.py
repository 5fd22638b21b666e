"""Freeing a flipper that the mud still holds when its extraction is over.

A stride goes on to swing when the lower edges of both plates are out, by the measured joint angles. One that is late
gets a short grace under full torque; then it is recovered, or swing would push the body back with the plate in the
mud (the paper's extraction failure). Each attempt first lets go, so that the mud relaxes, and then lifts from where
the flipper is, the n-th at 1/n of the speed: mud resists slow motion less. The sweep decides whether that helps. For
the plate to slide out along its own plane, without pushing mud aside, a point e below the arm needs

    l α' = e sin α β'

so while β rises the sweep must move away from the middle, which also shortens the lever l cos α of what sticks to the
plate. (In simulated clay of 6 to 9 kPa, entered to 4 or 5 cm, a lift in place and one towards the middle freed nothing
in 4 s; one away from the middle came out within 2.5 s, for 16 to 35 mm of the body's way.) The first attempt goes to
the rear, as the stance did: a plate that stopped short of it pushes the body forward and comes out on the way. The
later ones go away from the middle on the side where the flipper is.

Targets lead their joints by no more than full torque needs, so a plate that comes free does not fly. Swing begins
where the recovery leaves off, and what separates the two fades out without a jump of position or speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, cos, radians, sin
from typing import Annotated, NamedTuple

from control.bounds import Bounds
from control.gait import RAMP_S, GaitParameters, swing_duration_s
from control.geometry import FlipperGeometry
from control.joint_path import still
from control.limits import JointRange
from control.records import FLIPPERS, DriveStates, JointAngles, JointTarget, JointTargets

OUT_M = 0.003  # depth of the plate's lowest point up to which a flipper counts as out of the mud
RISE_S = 0.2  # to reach the height of the swing


@dataclass(frozen=True)
class RecoveryParameters:
    attempts: Annotated[int, Bounds(0, 20)] = 3  # 0: the stride does not wait, as on the paper's robot
    grace_s: Annotated[float, Bounds(0.0, 5.0)] = 0.15  # for joints that follow late, at full torque
    pause_s: Annotated[float, Bounds(0.0, 30.0)] = 0.3  # without pull, before each attempt
    attempt_s: Annotated[float, Bounds(0.1, 30.0)] = 3.0
    speed_rad_s: Annotated[float, Bounds(0.05, 5.0)] = 1.0  # of both joints in the first attempt; the n-th has 1/n
    sweep_deg: Annotated[float, Bounds(0.0, 60.0)] = 20.0  # away from the middle in the second; the n-th has n - 1
    lead_deg: Annotated[float, Bounds(0.5, 45.0)] = 6.0  # of targets: times the stiffness, the full torque


def lowest_m(geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float) -> float:
    """Depth of the plate's lower corner below the nominal surface."""
    slope = cos(sweep_rad) * sin(adduction_rad)
    return geometry.depth_m(sweep_rad, adduction_rad) + abs(slope) * geometry.plate_width_m / 2.0


def is_in_mud(geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float) -> bool:
    return lowest_m(geometry, sweep_rad, adduction_rad) > OUT_M


class Gap(NamedTuple):
    """What separates two targets at one moment, and how long it takes to fade."""

    angle_rad: float
    velocity_rad_s: float
    duration_s: float

    def after(self, time_s: float) -> JointTarget:
        """The cubic e(s) = (1 - s)² (e₀ (1 + 2s) + T e₀' s) with s = t/T: at its end there is no gap and no speed."""
        if time_s >= self.duration_s:
            return JointTarget(0.0, 0.0)
        s, run_rad = time_s / self.duration_s, self.velocity_rad_s * self.duration_s
        angle_rad = (1.0 - s) ** 2 * (self.angle_rad * (1.0 + 2.0 * s) + run_rad * s)
        rate_rad = (1.0 - s) * (run_rad * (1.0 - 3.0 * s) - 6.0 * self.angle_rad * s)
        return JointTarget(angle_rad, rate_rad / self.duration_s)


class Recovery:
    """Owns the attempts of the stride under way, and what is left of them in its swing."""

    def __init__(
        self,
        parameters: RecoveryParameters,
        geometry: FlipperGeometry,
        gait: GaitParameters,
        ranges: tuple[JointRange, JointRange, JointRange, JointRange],
    ) -> None:
        self.parameters = parameters
        self.geometry = geometry
        self._ranges = ranges
        swing_s = swing_duration_s(gait, geometry)
        self._fade_s = (swing_s, min(RISE_S, swing_s), swing_s, min(RISE_S, swing_s))
        self.reset()

    def reset(self) -> None:
        self.attempt = 0  # under way; 0: none
        self.given_up: Sequence[str] = ()  # flippers that the last attempt has not freed
        self.news = ""  # of this step, for the log
        self._waits = False
        self._time_s = 0.0  # since the wait, the attempt or the swing after it began
        self._targets: JointTargets = still((0.0, 0.0, 0.0, 0.0))
        self._goals: JointAngles = (0.0, 0.0, 0.0, 0.0)
        self._gaps: tuple[Gap, ...] = ()

    def stuck(self, states: DriveStates) -> tuple[str, ...]:
        """The flippers in the mud, or none where the gait does not wait for them."""
        if not self.parameters.attempts:
            return ()
        pairs = zip(FLIPPERS, states[::2], states[1::2], strict=True)
        return tuple(name for name, sweep, lift in pairs if is_in_mud(self.geometry, sweep.angle_rad, lift.angle_rad))

    def step(self, dt_s: float, stuck: Sequence[str], states: DriveStates, wanted: JointTargets) -> JointTargets:
        """The gait's targets, or others while it waits for the flippers that are `stuck`."""
        self.news = ""
        if self._waits is not bool(stuck):
            self._waits, self._time_s = bool(stuck), 0.0
            if self.attempt:
                self._leave(wanted)
        self._time_s += dt_s
        if not stuck:
            return self._faded(wanted)
        if self._time_s > self._allowed_s:
            self._begin(stuck, states, wanted)
        return self._lift(dt_s, states) if self.attempt else wanted

    @property
    def _allowed_s(self) -> float:
        return self.parameters.pause_s + self.parameters.attempt_s if self.attempt else self.parameters.grace_s

    def _begin(self, stuck: Sequence[str], states: DriveStates, wanted: JointTargets) -> None:
        """The next attempt, from where the flippers are; after the last one, nothing."""
        if self.attempt == self.parameters.attempts:
            self.given_up = stuck
            return
        self.attempt += 1
        self._time_s = 0.0
        a, b, c, d = (state.angle_rad for state in states)
        self._targets = still((a, b, c, d))
        goal_a, goal_c = self._sweep_goals(stuck, (a, c), wanted)
        self._goals = goal_a, 0.0, goal_c, 0.0
        self.news = f"{_are_stuck(stuck)}, attempt {self.attempt} of {self.parameters.attempts}"

    def _sweep_goals(
        self, stuck: Sequence[str], here_rad: tuple[float, float], wanted: JointTargets
    ) -> tuple[float, float]:
        """Stuck flippers go the same way, so that the body is not turned; one that is out stays where it is."""
        places_rad = dict(zip(FLIPPERS, here_rad, strict=True))
        away_rad = copysign(radians(self.parameters.sweep_deg), sum(places_rad[name] for name in stuck))
        goals_rad = {name: places_rad[name] + (self.attempt - 1) * away_rad for name in stuck}
        if self.attempt == 1:
            goals_rad = dict.fromkeys(stuck, wanted[0].angle_rad)  # the rear, where the gait waits
        left_rad, right_rad = ((places_rad | goals_rad)[name] for name in FLIPPERS)
        return left_rad, right_rad

    def _lift(self, dt_s: float, states: DriveStates) -> JointTargets:
        ramp = min(max(self._time_s - self.parameters.pause_s, 0.0) / RAMP_S, 1.0)
        speed_rad_s = ramp * self.parameters.speed_rad_s / self.attempt
        a, b, c, d = (
            self._led(dt_s, target, goal_rad, speed_rad_s, state.angle_rad, span)
            for target, goal_rad, state, span in zip(self._targets, self._goals, states, self._ranges, strict=True)
        )
        self._targets = a, b, c, d
        return self._targets

    def _led(
        self, dt_s: float, target: JointTarget, goal_rad: float, speed_rad_s: float, here_rad: float, span: JointRange
    ) -> JointTarget:
        """One step on the way to the goal, close to where the joint is and within its limits."""
        lead_rad, step_rad = radians(self.parameters.lead_deg), speed_rad_s * dt_s
        angle_rad = _within(goal_rad, target.angle_rad - step_rad, target.angle_rad + step_rad)
        angle_rad = _within(angle_rad, here_rad - lead_rad, here_rad + lead_rad)
        angle_rad = _within(angle_rad, span.min_rad, span.max_rad)
        velocity_rad_s = _within((angle_rad - target.angle_rad) / dt_s, -speed_rad_s, speed_rad_s)
        return JointTarget(angle_rad, velocity_rad_s)

    def _leave(self, wanted: JointTargets) -> None:
        """All flippers are out."""
        self.news = f"the flippers came out after {self.attempt} attempt{'s' if self.attempt > 1 else ''}"
        self.attempt = 0
        self._gaps = tuple(
            Gap(target.angle_rad - gait.angle_rad, target.velocity_rad_s - gait.velocity_rad_s, duration_s)
            for target, gait, duration_s in zip(self._targets, wanted, self._fade_s, strict=True)
        )

    def _faded(self, wanted: JointTargets) -> JointTargets:
        """The gait's targets with what is left of the gaps."""
        if not self._gaps:
            return wanted
        rests = [gap.after(self._time_s) for gap in self._gaps]
        if self._time_s >= max(self._fade_s):
            self._gaps = ()
        a, b, c, d = (
            JointTarget(_within(gait.angle_rad + rest.angle_rad, *span), gait.velocity_rad_s + rest.velocity_rad_s)
            for gait, rest, span in zip(wanted, rests, self._ranges, strict=True)
        )
        return a, b, c, d


def _within(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


def _are_stuck(flippers: Sequence[str]) -> str:
    return f"the {flippers[0]} flipper is stuck" if len(flippers) == 1 else "both flippers are stuck"
