"""Shakes a joint to find out whether its encoder works, with a torque that cannot move the joint far.

A stuck encoder reports the same as a resting one: the drive's filter reports a resting angle with the same last bit and
a speed of exactly zero. Only motion shows the difference, and a torque that grows until the angle changes would drive
such a joint to its stop. So the joint is shaken first, with a torque of +A for T/2, -A for T, +A for T/2. A free joint
of inertia I moves forth and back, is at rest before and after, and deflects by at most A T² / (4 I): 0.016 rad with
T = 16 ms and 0.1 N·m for a sweep joint (0.0004 kg m²) or 0.15 N·m for an adduction joint (0.0006 kg m²).

A joint that rests against an obstacle cannot move one way, and leaves it with a speed of up to A T / (2 I). It moves on
until gravity stops it, 0.02 rad for an adduction joint, or dry friction, which is all that a sweep joint has: 0.16 rad
at 0.005 N·m. Each shake also presses the flipper further into a soft support, into the simulated cushion by 0.06 rad in
all. So there are few shakes, each 1.5 times as strong as the one before, with a rest between them. A late tick would
leave a speed as well, and ends the shake.
"""

from math import nan

import numpy as np

from control.rate import PERIOD_S
from control.records import DriveStates, Torques
from experiments.bench.test_rig import TestRig, idle, signals, torque_on
from experiments.robot.bench_errors import BenchError

FIRST_NM, GROWTH = 0.02, 1.5
SHAKES = {"sweep": 5, "adduction": 6}  # up to 0.10 N·m, many times the friction, and 0.15 N·m: a third for the weight
UNSEEN_RAD = 0.16  # largest motion, also with a stuck encoder: 2 cm at the end of an arm
HALF_TICKS = 3  # T / 2
SHAKE_TICKS, REST_TICKS = 4 * HALF_TICKS, 40
SHAKEN_RAD = 0.003  # 8 steps of 16384 a turn
JITTERS = 3.0  # times the range of the angle at rest, so that noise is no answer
TRIES = 3  # with a late computer
LONGEST_S = 10.0
ADVICE = (
    "turn it by hand while its torque is off: where the angle does not follow, check its encoder, magnet and cable;"
    " else free what blocks it"
)


class Shake:
    """A hold law: shakes one joint with growing torque until its angle answers; the others have no torque."""

    def __init__(self, index: int, shakes: int, least_rad: float) -> None:
        self._index = index
        self._left = shakes
        self.least_rad = least_rad  # of an answer
        self._ticks = 0
        self._from_rad = nan
        self._torque_nm = 0.0
        self.answer_rad = 0.0  # the farthest that the angle went in one shake
        self.done = False

    @property
    def answered(self) -> bool:
        return self.answer_rad > self.least_rad

    def __call__(self, held: Torques, states: DriveStates) -> Torques:
        """Return the torques of this tick. Each shake is completed, because the joint is at rest at its end."""
        angle_rad, tick = states[self._index].angle_rad, self._ticks % (SHAKE_TICKS + REST_TICKS)
        if tick == 0:
            self._from_rad = angle_rad
            self.done = self.answered or self._left == 0
            self._left -= 1
            self._torque_nm = self._torque_nm * GROWTH or FIRST_NM
        self._ticks += 1
        self.answer_rad = max(self.answer_rad, abs(angle_rad - self._from_rad))
        if self.done or tick >= SHAKE_TICKS:
            return idle(held, states)
        torque_nm = -self._torque_nm if HALF_TICKS <= tick < 3 * HALF_TICKS else self._torque_nm
        return torque_on(held, self._index, torque_nm)


def shake_joint(test_rig: TestRig, joint: str) -> Shake:
    """Shake a joint of an armed robot. Raises BenchError where a fault or a late computer ends it."""
    index, kind = test_rig.index_of(joint), joint.split("_")[1]
    test_rig.controller.hold_law = idle
    for _ in range(TRIES):
        at_rest_rad = signals(test_rig.run_for(REST_TICKS * PERIOD_S), "angle_rad")[:, index]
        law = Shake(index, SHAKES[kind], max(SHAKEN_RAD, JITTERS * float(np.ptp(at_rest_rad))))
        if _is_punctual(test_rig, joint, law):
            return law
    raise BenchError("Ticks are missed while a joint is shaken: end other programs; run 'mudskipper doctor'.")


def _is_punctual(test_rig: TestRig, joint: str, law: Shake) -> bool:
    """Return whether the shake was completed without a missed tick, which ends it at once."""
    test_rig.controller.hold_law = law
    samples = test_rig.run_until(lambda at: law.done or at.tick.missed > 0, LONGEST_S, f"The end of shaking {joint}")
    test_rig.controller.hold_law = idle
    return not samples[-1].tick.missed
