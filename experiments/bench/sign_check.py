"""Checks that a tiny torque moves the right joint in the right direction.

Each joint in turn is shaken, to prove that its encoder works (joint_shake.py). Then its torque grows in small steps
until it moves, so friction and gravity need not be known; the other joints have none. Drive and encoder must agree:
angle, velocity and current have the sign of the torque. A drive agrees with itself on any joint and in any mounting:
that encoder and joint belong together, and count in the right direction, is shown by hands before
(calibration/hand_steps.py).
"""

from math import nan
from statistics import fmean

import numpy as np

from control.controller import measured_angles
from control.rate import PERIOD_S
from control.records import DriveStates, Rig, Torques
from experiments.bench.joint_shake import ADVICE, shake_joint
from experiments.bench.reading import BenchReading, BenchReadings
from experiments.bench.test_rig import TestRig, TickSample, idle, signals, torque_on

STEP_NM = 0.01  # a fifth of the torque that holds an arm of the default mass level
STEP_S = 0.03  # for the joint to start moving before the next step
MOST_NM = 0.2  # a quarter of the torque limit and four times the weight of an arm: harmless to fingers
MOVED_RAD = 0.03  # beyond noise and the slack of a lying plate; the torque ends there
OTHERS_RAD = 0.02  # motion of another joint by vibration
FEWEST_A = 0.05  # for the sign of the current: noise averages out below that


class Nudge:
    """A hold law: the torque of one joint grows until it has moved; the others have none."""

    def __init__(self, index: int, begun: DriveStates) -> None:
        self.index = index
        self.torque_nm = 0.0
        self.moved = self.done = False
        self._from_rad = begun[index].angle_rad
        self._ticks = 0

    def __call__(self, held: Torques, states: DriveStates) -> Torques:
        self.moved = self.moved or abs(states[self.index].angle_rad - self._from_rad) > MOVED_RAD
        self.done = self.moved or self.torque_nm > MOST_NM - STEP_NM / 2.0
        if self.done:
            return idle(held, states)
        if self._ticks % round(STEP_S / PERIOD_S) == 0:
            self.torque_nm += STEP_NM
        self._ticks += 1
        return torque_on(held, self.index, self.torque_nm)


def check_nudge(test_rig: TestRig, joint: str) -> BenchReadings:
    """Check the motion of one joint. Raises BenchError where a fault ends it."""
    index = test_rig.index_of(joint)
    test_rig.arm(idle)
    shaken = shake_joint(test_rig, joint)
    yield BenchReading(f"{joint}: answer to a shake", shaken.answer_rad, "rad", shaken.least_rad, 1.0, ADVICE)
    if not shaken.answered:
        test_rig.switch_off()
        return
    begun = test_rig.run_for(0.1)[-1].states
    nudge = Nudge(index, begun)
    test_rig.controller.hold_law = nudge
    samples = test_rig.run_until(lambda sample: nudge.done, 10.0, f"A motion of {joint}")
    yield from _agreement(test_rig.configuration.rig, joint, begun, samples, nudge)
    test_rig.run_for(0.3)  # it falls back
    test_rig.switch_off()


def _agreement(rig: Rig, joint: str, begun: DriveStates, samples: list[TickSample], nudge: Nudge) -> BenchReadings:
    index = nudge.index
    moved_rad = np.subtract(measured_angles(samples[-1].states), measured_angles(begun)).tolist()
    stuck = (
        f"free what blocks it; else the motor presses a flipper down: check drive.{joint}.sign, and whether its node id"
        " is another joint's"
    )
    yield BenchReading(
        f"{joint}: torque that moves it", nudge.torque_nm if nudge.moved else nan, "N·m", 0.0, MOST_NM, stuck
    )
    contrary = f"calibrate the drive of {joint} again: its encoder counts against its motor"
    path_rad = moved_rad[index]
    yield BenchReading(
        f"{joint}: motion under torque", path_rad, "rad", MOVED_RAD, 0.5, contrary if path_rad < 0.0 else stuck
    )
    fastest_rad_s = max(signals(samples, "velocity_rad_s")[:, index].tolist(), key=abs)
    yield BenchReading(f"{joint}: velocity with it", fastest_rad_s, "rad/s", 0.0, 20.0, contrary)
    mean_a = fmean(signals(samples[-round(STEP_S / PERIOD_S) :], "current_a")[:, index])
    yield BenchReading(
        f"{joint}: current with it", mean_a, "A", FEWEST_A, 20.0, f"{contrary}, or its current sensor is off"
    )
    for other, other_rad in zip(rig.joints, moved_rad, strict=True):
        if other != joint:
            advice = f"commands to {joint} reach {other}, or something couples them: check node ids and mechanics"
            yield BenchReading(f"{joint}: {other} meanwhile", other_rad, "rad", -OTHERS_RAD, OTHERS_RAD, advice)
