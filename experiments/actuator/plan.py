"""The plan of an actuator calibration: joints, weights, lever and trials, and whether the robot can hold them.

The paper hangs eight weights from 10 to 800 g on one flipper (section II-B). A trial here is one pass through all of
them, each of which is hung again, so that poorly repeated influences (the hook's position, the magnets' temperature)
show in the spread between trials. The empty arm is read before the first and after every pass, as the tare of both
neighbours. The first pass rises, so that a mistake at the bench shows with the lightest weights, and the heaviest are
checked with a known constant. The other passes alternate between heavy and light: 800 g warm a winding by 20 K in the
ten seconds of a reading, and it cools while the light ones hang.

The torque of each weight must be within the configured limits. The commanded torque may exceed the weight's own by the
error of the torque constant, and a joint at rest near its limit is a fault. The winding is checked again before each
weight.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, hypot, nan, sqrt

from control.monitors.joint_monitor import SATURATED_FRACTION
from control.monitors.winding import Winding
from control.parameters.arm_mass import GRAVITY_M_S2
from experiments.robot.bench_errors import BenchError
from firmware_host.configuration.configuration import Configuration

PAPER_WEIGHTS_G = (10.0, 20.0, 50.0, 100.0, 200.0, 400.0, 600.0, 800.0)
PAPER_TRIALS = 5
LARGEST_ERROR = 0.2  # relative, of a configured torque constant: 60/(2π KV) for 8.27/KV is 15 % of it
READING_S = 10.0  # of a heavy weight, both approaches
OPERATOR_S = 4.0  # that it hangs in addition, until Enter is pressed and until it is taken off
COOL_K = 2.0  # below limits.temperature_warm_c, above which torque fades and a heavy weight falls


@dataclass(frozen=True)
class WeighingPlan:
    """The options of one calibration, the same whenever it continues."""

    joints: tuple[str, ...]
    weights_g: tuple[float, ...] = PAPER_WEIGHTS_G
    trials: int = PAPER_TRIALS
    lever_m: float = 0.12
    gravity_m_s2: float = GRAVITY_M_S2
    lever_tolerance_m: float = 0.001  # by a ruler, from a hidden axle to the hook
    weight_tolerance: float = 0.001  # of class M3 (OIML R 111) from 50 g on; kitchen weights may err ten times as much
    trusts_constant: bool = True  # False: the first weights are not compared with the configured torque constant

    @property
    def torque_error(self) -> float:
        """The relative standard error of all torques alike, for a uniform distribution within the tolerances."""
        return hypot(self.lever_tolerance_m / self.lever_m, self.weight_tolerance) / sqrt(3.0)

    def torque_nm(self, weight_g: float) -> float:
        """Return the torque of a weight on a level arm."""
        return weight_g / 1000.0 * self.gravity_m_s2 * self.lever_m


@dataclass(frozen=True)
class WeighingStep:
    """One weight to hang and read, or the empty arm."""

    trial: int  # from 1; the tare before the first pass is of trial 0
    weight_g: float  # 0: the empty arm

    @property
    def key(self) -> str:
        return f"trial {self.trial}, {self.weight_g:g} g"

    @property
    def name(self) -> str:
        return f"{self.weight_g:g} g" if self.weight_g else "the empty arm"

    @property
    def reported_trial(self) -> int:
        """The trial as people count: the first tare is part of the first pass."""
        return max(self.trial, 1)


def steps_of(plan: WeighingPlan) -> list[WeighingStep]:
    rising_g, mixed_g = sorted(plan.weights_g), in_turn(plan.weights_g)
    passes = (
        WeighingStep(trial, weight_g)
        for trial in range(1, plan.trials + 1)
        for weight_g in (*(rising_g if trial == 1 else mixed_g), 0.0)
    )
    return [WeighingStep(0, 0.0), *passes]


def in_turn(weights_g: Sequence[float]) -> list[float]:
    """Order the heaviest, the lightest, the next heaviest ..."""
    left, ordered = sorted(weights_g), list[float]()
    while left:
        ordered.append(left.pop(-1 if len(ordered) % 2 == 0 else 0))
    return ordered


def require_possible(plan: WeighingPlan, configuration: Configuration) -> None:
    """Raises BenchError with all problems."""
    problems = list(_problems(plan, configuration))
    if problems:
        raise BenchError("\n".join(problems))


def needed_nm(plan: WeighingPlan, configuration: Configuration, weight_g: float) -> float:
    """Return the least limits.torque_nm for this weight and the arm."""
    arm = configuration.arm
    arm_nm = arm.arm_mass_kg * plan.gravity_m_s2 * arm.center_of_mass_m
    return (plan.torque_nm(weight_g) + arm_nm) * (1.0 + LARGEST_ERROR) / SATURATED_FRACTION


def _problems(plan: WeighingPlan, configuration: Configuration) -> Iterator[str]:
    own = configuration.rig.joints
    missing = [joint for joint in plan.joints if joint not in own]
    if missing:
        yield f"this robot has no {' and no '.join(missing)}: give --joint, one of {', '.join(own)}"
        return
    limit_nm, heaviest_g = configuration.limits.torque_nm, max(plan.weights_g)
    least_nm = needed_nm(plan, configuration, heaviest_g)
    if least_nm > limit_nm:
        possible_g = [weight_g for weight_g in plan.weights_g if needed_nm(plan, configuration, weight_g) <= limit_nm]
        lighter = f"hang at most {max(possible_g):g} g of them" if possible_g else "hang lighter ones"
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
    """Round up."""
    return float(ceil(value * 10.0**digits) / 10.0**digits)


def largest_current_a(plan: WeighingPlan, configuration: Configuration, joint: str, weight_g: float) -> float:
    """Return the largest current of the weight, as long as nothing was measured."""
    return plan.torque_nm(weight_g) * (1.0 + LARGEST_ERROR) / configuration.drive[joint].torque_constant_nm_a


def stays_cool(configuration: Configuration, current_a: float, winding_c: float, hangs_s: float) -> bool:
    """Return whether a winding of this temperature can hold the current as long as the weight hangs."""
    winding = Winding(configuration.winding)
    winding.temperature_c = winding_c
    for _ in range(round(hangs_s)):
        winding.update(1.0, current_a, nan)
    return winding.temperature_c <= configuration.limits.temperature_warm_c - COOL_K
