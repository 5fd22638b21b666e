"""What of the actuator calibration is decided before it begins: joints, weights, lever, trials; whether they can be.

The paper hangs eight weights from 10 to 800 g on one flipper (section II-B). A trial here is one pass through all of
them, each hung anew, and not eight weights five times over: so what repeats badly (the hook's place on the arm, the
magnets' warmth) shows in the spread between trials. The empty arm is read before the first and after every pass: what
it takes to hold is the tare of both its neighbours. The first pass rises, so that what is wrong with the bench shows
with the lightest weights, and the heaviest are judged by a constant that is known. The others take heavy and light in
turn: 800 g warm a winding by 20 K in the ten seconds of a reading, and it cools while the light ones hang.

Before a weight is asked for, its torque must be within the limits that the robot is configured with. The torque that
leaves for the drive may be larger than the weight's own by as much as the torque constant is known wrongly, and a joint
that stands still near its limit is a fault. What the winding bears is asked again before each weight.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from math import ceil, hypot, nan, sqrt
from typing import Any

from control.joint_pd import GRAVITY_M_S2
from control.monitors.joint_monitor import SATURATED_FRACTION
from control.monitors.winding import Winding
from experiments.robot.bench_robot import BenchError
from firmware_host.configuration.configuration import Configuration

PAPER_WEIGHTS_G = (10.0, 20.0, 50.0, 100.0, 200.0, 400.0, 600.0, 800.0)
PAPER_TRIALS = 5
LARGEST_ERROR = 0.2  # by which a torque constant may be known wrongly: 60/(2π KV) for 8.27/KV is 15 % of it
READING_S = 10.0  # of a heavy weight, both approaches
OPERATOR_S = 4.0  # that it hangs besides, until Enter is pressed and until it is taken off
COOL_K = 2.0  # below limits.temperature_warm_c, above which torque fades and a heavy weight falls


@dataclass(frozen=True)
class Plan:
    """Of one calibration, the same whenever it goes on."""

    joints: tuple[str, ...]
    weights_g: tuple[float, ...] = PAPER_WEIGHTS_G
    trials: int = PAPER_TRIALS
    lever_m: float = 0.12
    gravity_m_s2: float = GRAVITY_M_S2
    lever_tolerance_m: float = 0.001  # from an axle that is not seen to a hook, by a ruler
    weight_tolerance: float = 0.001  # of class M3 (OIML R 111) from 50 g on; kitchen weights may err ten times as much

    @property
    def torque_error(self) -> float:
        """Standard error of all torques alike, as a share of them: anything within a tolerance is as likely."""
        return hypot(self.lever_tolerance_m / self.lever_m, self.weight_tolerance) / sqrt(3.0)

    def torque_nm(self, weight_g: float) -> float:
        """Of the weight on a level arm."""
        return weight_g / 1000.0 * self.gravity_m_s2 * self.lever_m

    def notes(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True)
class Step:
    """One thing to hang, or to take off, and to read."""

    trial: int  # from 1; the tare before the first pass is of trial 0
    weight_g: float  # 0: the empty arm

    @property
    def key(self) -> str:
        return f"trial {self.trial}, {self.weight_g:g} g"

    @property
    def reported_trial(self) -> int:
        """As people count: what comes before the first pass is part of it."""
        return max(self.trial, 1)


def steps_of(plan: Plan) -> list[Step]:
    rising_g, mixed_g = sorted(plan.weights_g), in_turn(plan.weights_g)
    passes = (
        Step(trial, weight_g)
        for trial in range(1, plan.trials + 1)
        for weight_g in (*(rising_g if trial == 1 else mixed_g), 0.0)
    )
    return [Step(0, 0.0), *passes]


def in_turn(weights_g: Sequence[float]) -> list[float]:
    """The heaviest, the lightest, the next heaviest ..."""
    left, ordered = sorted(weights_g), list[float]()
    while left:
        ordered.append(left.pop(-1 if len(ordered) % 2 == 0 else 0))
    return ordered


def require_possible(plan: Plan, configuration: Configuration) -> None:
    """Raises BenchError with all that stands against it."""
    problems = list(_problems(plan, configuration))
    if problems:
        raise BenchError("\n".join(problems))


def needed_nm(plan: Plan, configuration: Configuration, weight_g: float) -> float:
    """What limits.torque_nm must be at least for this weight and the arm."""
    arm = configuration.arm
    arm_nm = arm.arm_mass_kg * plan.gravity_m_s2 * arm.center_of_mass_m
    return (plan.torque_nm(weight_g) + arm_nm) * (1.0 + LARGEST_ERROR) / SATURATED_FRACTION


def _problems(plan: Plan, configuration: Configuration) -> Iterator[str]:
    limit_nm, heaviest_g = configuration.limits.torque_nm, max(plan.weights_g)
    least_nm = needed_nm(plan, configuration, heaviest_g)
    if least_nm > limit_nm:
        borne_g = [weight_g for weight_g in plan.weights_g if needed_nm(plan, configuration, weight_g) <= limit_nm]
        lighter = f"hang at most {max(borne_g):g} g of them" if borne_g else "hang lighter ones"
        least_nm_a = min(drive.torque_constant_nm_a for drive in configuration.drive.values()) / (1.0 + LARGEST_ERROR)
        yield (
            f"limits.torque_nm = {limit_nm:g}: must be at least {least_nm:.2f} for {heaviest_g:g} g at"
            f" {100.0 * plan.lever_m:g} cm. For this experiment set it to {_up(least_nm, 2):.2f}, current_limit_a of"
            f" all drives to {_up(_up(least_nm, 2) / least_nm_a, 1):.1f}, in case the torque constant is smaller, and"
            f" recovery.attempts to 0; or {lighter} (--weights), or at a shorter --lever"
        )
    for joint in plan.joints:
        most_a = largest_current_a(plan, configuration, joint, heaviest_g)
        if not stays_cool(configuration, most_a, configuration.winding.room_c, READING_S):
            yield (
                f"winding.thermal_resistance_k_w = {configuration.winding.thermal_resistance_k_w:g}: {heaviest_g:g} g"
                f" would warm the winding of {joint} beyond {configuration.limits.temperature_warm_c:g} degrees C in"
                f" {READING_S:g} s; hang lighter weights (--weights), or at a shorter --lever"
            )


def _up(value: float, digits: int) -> float:
    """Rounded so that a lower bound stays one."""
    return float(ceil(value * 10.0**digits) / 10.0**digits)


def largest_current_a(plan: Plan, configuration: Configuration, joint: str, weight_g: float) -> float:
    """That the weight may take, as long as nothing was measured."""
    return plan.torque_nm(weight_g) * (1.0 + LARGEST_ERROR) / configuration.drive[joint].torque_constant_nm_a


def stays_cool(configuration: Configuration, current_a: float, winding_c: float, hangs_s: float) -> bool:
    """Whether a winding of this temperature bears the current as long as the weight hangs."""
    winding = Winding(configuration.winding)
    winding.temperature_c = winding_c
    for _ in range(round(hangs_s)):
        winding.update(1.0, current_a, nan)
    return winding.temperature_c <= configuration.limits.temperature_warm_c - COOL_K
