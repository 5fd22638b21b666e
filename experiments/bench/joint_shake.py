"""Does an encoder tell that its joint moves? Asked by a torque that cannot take the joint far, whatever it tells.

An encoder that hangs tells the same as one at rest, and a drive's filter tells a resting joint's angle to the same
last bit with a speed of exactly zero: only motion shows the difference. A torque that grows until something moves
would drive such a joint to its stop. So it is shaken first, by a torque of +A for T/2, -A for T, +A for T/2. A free
joint of inertia I goes there and back, is at rest before and after, and is at farthest A T² / (4 I) away: with T = 16
ms, 0.1 N·m for a sweep joint (0.0004 kg m²) and 0.15 N·m for an adduction joint (0.0006 kg m²), 0.016 rad.

A joint that rests against something loses what it pushes there, and leaves with a speed of up to A T / (2 I). It goes
as far as that lasts against gravity, 0.02 rad for an adduction joint, or against dry friction, which is all that a
sweep joint has: 0.16 rad at 0.005 N·m. And each shake presses it a little farther into what gives way, a flipper into
the simulated cushion by 0.06 rad in all. So there are few shakes, each half as strong again as the one before, with a
rest between them. A tick that comes late would leave a speed as well, and ends the shake.
"""

from __future__ import annotations

from math import nan

from control.rate import PERIOD_S
from control.records import NO_TORQUE, DriveStates, Joints, Torques
from experiments.bench.reading import Reading
from experiments.bench.test_rig import Stand, joint_place
from experiments.robot.bench_robot import BenchError

FIRST_NM, GROWTH = 0.02, 1.5
SHAKES = {"sweep": 5, "adduction": 6}  # up to 0.10 N·m, many times the friction, and 0.15 N·m: a third for the weight
UNSEEN_RAD = 0.16  # that a joint goes at most, also where its encoder tells nothing: 2 cm at the end of an arm
HALF_TICKS = 3  # T / 2
SHAKE_TICKS, REST_TICKS = 4 * HALF_TICKS, 40
SHAKEN_RAD = 0.003  # 8 steps of 16384 a turn
JITTERS = 3.0  # times what the angle shows at rest: noise is no answer
TRIES = 3  # where the computer is late
LONGEST_S = 10.0
ADVICE = (
    "turn it by hand while its torque is off: where the angle does not follow, check its encoder, magnet and cable;"
    " else free what blocks it"
)


class Shake:
    """A law: one joint's torque goes to and fro and grows until its angle answers, all others have none."""

    def __init__(self, place: int, shakes: int, least_rad: float) -> None:
        self._place = place
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
        """Each shake is gone through to its end, where the joint is at rest."""
        angle_rad, tick = states[self._place].angle_rad, self._ticks % (SHAKE_TICKS + REST_TICKS)
        if tick == 0:
            self._from_rad = angle_rad
            self.done = self.answered or self._left == 0
            self._left -= 1
            self._torque_nm = self._torque_nm * GROWTH or FIRST_NM
        self._ticks += 1
        self.answer_rad = max(self.answer_rad, abs(angle_rad - self._from_rad))
        if self.done or tick >= SHAKE_TICKS:
            return NO_TORQUE
        torque_nm = -self._torque_nm if HALF_TICKS <= tick < 3 * HALF_TICKS else self._torque_nm
        a, b, c, d = (torque_nm if place == self._place else 0.0 for place in range(4))
        return Joints(a, b, c, d)


def shake(stand: Stand, joint: str) -> Shake:
    """Of an armed joint. Raises BenchError where a fault or a late computer ends it."""
    place, kind = joint_place(joint), joint.split("_")[1]
    stand.controller.hold_law = idle
    for _ in range(TRIES):
        at_rest = [sample.states[place].angle_rad for sample in stand.run_for(REST_TICKS * PERIOD_S)]
        law = Shake(place, SHAKES[kind], max(SHAKEN_RAD, JITTERS * (max(at_rest) - min(at_rest))))
        if _is_punctual(stand, joint, law):
            return law
    raise BenchError("Ticks are missed while a joint is shaken: end other programs; 'mudskipper doctor' tells more.")


def _is_punctual(stand: Stand, joint: str, law: Shake) -> bool:
    """Whether the shake came to its end without a tick that was late; one ends it at once."""
    stand.controller.hold_law = law
    samples = stand.run_until(lambda at: law.done or at.tick.missed > 0, LONGEST_S, f"The end of shaking {joint}")
    stand.controller.hold_law = idle
    return not samples[-1].tick.missed


def idle(held: Torques, states: DriveStates) -> Torques:
    """A law: no torque, in closed loop."""
    return NO_TORQUE


def answer(joint: str, law: Shake) -> Reading:
    return Reading(f"{joint}: answer to a shake", law.answer_rad, "rad", law.least_rad, 1.0, ADVICE)
