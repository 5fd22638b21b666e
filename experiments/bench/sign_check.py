"""Does a tiny torque move the right joint, and the right way?

Each joint in turn is shaken, so that its encoder is known to live (joint_shake.py). Then it gets a torque that grows in
small steps until it moves, all others none: so friction and gravity need not be known. Drive and encoder must agree:
angle, velocity and current all have the torque's sign. A drive agrees with itself on whatever joint it sits and
whichever way it is mounted, so afterwards the joint is moved a little farther, under control, for somebody to see which
flipper moves and how.
"""

from __future__ import annotations

from math import nan, radians

from control.controller import measured_angles
from control.rate import PERIOD_S
from control.records import JOINTS, NO_TORQUE, DriveStates, JointAngles, Joints, Torques
from experiments.bench.joint_shake import answer, idle, shake
from experiments.bench.operator import WAYS, Sight
from experiments.bench.reading import Reading, Readings, left_out
from experiments.bench.test_rig import Sample, Stand, joint_place

STEP_NM = 0.01  # a fifth of what holds an arm of the default mass level
STEP_S = 0.03  # for the joint to begin to move before more torque comes
MOST_NM = 0.2  # a quarter of what the motors may do, four times what an arm weighs: no finger is hurt
MOVED_RAD = 0.03  # beyond noise and the slack of a plate on what it lies on; the torque ends there
OTHERS_RAD = 0.02  # that another joint may be shaken
SHOWN_RAD = radians(12.0)  # 2.5 cm at the end of an arm: plain to see
SHOWING_RAD_S = 0.5
FEWEST_A = 0.05  # of the current's sign: noise averages out below that


class Nudge:
    """A law: one joint's torque grows until it has moved, all others have none."""

    def __init__(self, place: int, begun: DriveStates) -> None:
        self.place = place
        self.torque_nm = 0.0
        self.moved = self.done = False
        self._from_rad = begun[place].angle_rad
        self._ticks = 0

    def __call__(self, held: Torques, states: DriveStates) -> Torques:
        self.moved = self.moved or abs(states[self.place].angle_rad - self._from_rad) > MOVED_RAD
        self.done = self.moved or self.torque_nm > MOST_NM - STEP_NM / 2.0
        if self.done:
            return NO_TORQUE
        if self._ticks % round(STEP_S / PERIOD_S) == 0:
            self.torque_nm += STEP_NM
        self._ticks += 1
        a, b, c, d = (self.torque_nm if place == self.place else 0.0 for place in range(4))
        return Joints(a, b, c, d)


def nudged(stand: Stand, joint: str) -> Readings:
    """Raises BenchError where a fault ends it."""
    place = joint_place(joint)
    stand.arm(idle)
    shaken = shake(stand, joint)
    yield answer(joint, shaken)
    if not shaken.answered:
        stand.let_go()
        return
    begun = stand.run_for(0.1)[-1].states
    nudge = Nudge(place, begun)
    stand.controller.hold_law = nudge
    samples = stand.run_until(lambda sample: nudge.done, 10.0, f"A motion of {joint}")
    yield from _agreement(joint, begun, samples, nudge)
    stand.run_for(0.3)  # it falls back
    stand.let_go()


def _agreement(joint: str, begun: DriveStates, samples: list[Sample], nudge: Nudge) -> Readings:
    place = nudge.place
    moved_rad = [
        end - start for start, end in zip(measured_angles(begun), measured_angles(samples[-1].states), strict=True)
    ]
    stuck = (
        f"free what blocks it; else the motor presses a flipper down: check drive.{joint}.sign, and whether its node id"
        " is another joint's"
    )
    yield Reading(f"{joint}: torque that moves it", nudge.torque_nm if nudge.moved else nan, "N·m", 0.0, MOST_NM, stuck)
    contrary = f"calibrate the drive of {joint} anew: its encoder counts against its motor"
    path_rad = moved_rad[place]
    yield Reading(f"{joint}: way under torque", path_rad, "rad", MOVED_RAD, 0.5, contrary if path_rad < 0.0 else stuck)
    fastest_rad_s = max((sample.states[place].velocity_rad_s for sample in samples), key=abs)
    yield Reading(f"{joint}: velocity with it", fastest_rad_s, "rad/s", 0.0, 20.0, contrary)
    late = samples[-round(STEP_S / PERIOD_S) :]
    mean_a = sum(sample.states[place].current_a for sample in late) / len(late)
    yield Reading(f"{joint}: current with it", mean_a, "A", FEWEST_A, 20.0, f"{contrary}, or its current sensor is off")
    for other, other_rad in zip(JOINTS, moved_rad, strict=True):
        if other != joint:
            advice = f"commands to {joint} reach {other}, or something couples them: check node ids and mechanics"
            yield Reading(f"{joint}: {other} meanwhile", other_rad, "rad", -OTHERS_RAD, OTHERS_RAD, advice)


def gently(held: Torques, states: DriveStates) -> Torques:
    """A law: what holds the pose, as far as a tiny torque can."""
    a, b, c, d = (min(max(torque_nm, -MOST_NM), MOST_NM) for torque_nm in held)
    return Joints(a, b, c, d)


def shown(stand: Stand, joint: str) -> Readings:
    """Whether eyes agree with the encoders."""
    place, attendant = joint_place(joint), stand.attendant
    stand.arm(gently)
    here = measured_angles(stand.run_for(stand.configuration.motion.fade_in_s)[-1].states)
    attendant.watch()
    stand.move([_with(here, place, SHOWN_RAD)], SHOWING_RAD_S, gently)
    stand.run_for(0.3)
    attendant.look()
    stand.move([here], SHOWING_RAD_S, gently)
    stand.let_go()
    sight = attendant.saw(joint, stand.look_on)
    side, kind = joint.split("_")
    what = f"{joint}: the {side} flipper was seen to {WAYS[kind]}"
    if sight is Sight.UNSEEN:
        yield left_out(what)
        return
    yield Reading(what, sight is Sight.RIGHT, "", 1, 1, sight.value.format(joint=joint))


def _with(angles: JointAngles, place: int, more_rad: float) -> JointAngles:
    return Joints(*(angle + more_rad * (place == other) for other, angle in enumerate(angles)))
