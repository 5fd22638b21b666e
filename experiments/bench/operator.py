"""Who stands beside the robot at the bench: lets it move, holds and turns its flippers, and sees which one moves.

No drive can tell on which joint it sits: angle, torque and current of a drive agree with one another wherever it is.
So eyes and hands are needed once. At a simulated robot they look at the mechanics and not at what the drives say.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from enum import Enum
from math import radians
from typing import Protocol

from control.controller import UP_RAD
from control.rate import PERIOD_S
from control.records import JOINTS
from experiments.bench.rig import SimulatedRig
from experiments.robot.bench_robot import CLEAR, LEAVE
from experiments.robot.prompt import GO_ON, Operator
from simulation.body.plant import END_STOPS_RAD

WAYS = {"sweep": "swing forward", "adduction": "rise"}
TURNING_S = 0.25  # of a simulated hand, from the middle to a stop
SEEN_RAD = radians(4.0)  # what eyes notice


class Sight(Enum):
    """What somebody saw, with what to do then."""

    RIGHT = ""
    WRONG_WAY = "it moved the other way: change drive.{joint}.sign, and check its zero then"
    OTHER = "another joint moved: exchange the node ids (or the bus) of {joint} and of that joint"
    NOTHING = "nothing was seen to move: check the coupling of motor and arm"
    UNSEEN = "nobody looked"


class Attendant(Protocol):
    def consents(self, what: str, meanwhile: Callable[[], None]) -> bool:
        """Before anything moves. `meanwhile` is called again and again, here and below."""

    def clears(self, faults: str, meanwhile: Callable[[], None]) -> bool:
        """Whether faults that stand before the first torque, such as a drive's last watchdog, are to be cleared."""

    def watch(self) -> None:
        """One joint is about to move; then it is at its farthest (`look`), and back (`saw`)."""

    def look(self) -> None: ...

    def saw(self, joint: str, meanwhile: Callable[[], None]) -> Sight: ...

    def holds_level(self, meanwhile: Callable[[], None]) -> bool:
        """Both flippers straight out and level, by hand, until `lets_go`. False: nobody is there."""

    def turns(self, joint: str, meanwhile: Callable[[], None]) -> bool:
        """One joint from stop to stop, by hand."""

    def lets_go(self) -> None: ...


class AskedAttendant:
    """A person who is asked. `sure`: nobody asks whether the robot may move."""

    def __init__(self, operator: Operator, sure: bool) -> None:
        self._operator = operator
        self._sure = sure

    def consents(self, what: str, meanwhile: Callable[[], None]) -> bool:
        if self._sure:
            self._operator.report(what)
            return True
        return self._operator.ask(what, {GO_ON: "go on", "n": "no, end here"}, meanwhile) == GO_ON

    def clears(self, faults: str, meanwhile: Callable[[], None]) -> bool:
        """Also who is sure that the robot may move did not know of these."""
        answers = {CLEAR: "clear it and go on", LEAVE: "end here"}
        return self._operator.ask(f"{faults} Is the cause gone?", answers, meanwhile) == CLEAR

    def watch(self) -> None: ...

    def look(self) -> None: ...

    def saw(self, joint: str, meanwhile: Callable[[], None]) -> Sight:
        side, kind = joint.split("_")
        answers = {GO_ON: "yes", "w": "the other way", "o": "another joint moved", "n": "nothing moved"}
        sights = {GO_ON: Sight.RIGHT, "w": Sight.WRONG_WAY, "o": Sight.OTHER, "n": Sight.NOTHING}
        question = f"Did the {side} flipper {WAYS[kind]} and come back, and nothing else move?"
        return sights[self._operator.ask(question, answers, meanwhile)]

    def holds_level(self, meanwhile: Callable[[], None]) -> bool:
        return self._done("Hold both flippers level and straight out, as a spirit level has it.", meanwhile)

    def turns(self, joint: str, meanwhile: Callable[[], None]) -> bool:
        side, kind = joint.split("_")
        ways = "fore and aft" if kind == "sweep" else "up and down"
        return self._done(f"Move the {side} flipper slowly {ways}, from stop to stop and back.", meanwhile)

    def lets_go(self) -> None:
        self._operator.report("Let go of the flippers, and lay them down.")

    def _done(self, what: str, meanwhile: Callable[[], None]) -> bool:
        return self._operator.ask(what, {GO_ON: "done", "s": "skip"}, meanwhile) == GO_ON


class AbsentAttendant:
    """Nobody: the robot may move, and what needs hands or eyes is left out."""

    def consents(self, what: str, meanwhile: Callable[[], None]) -> bool:
        return True

    def clears(self, faults: str, meanwhile: Callable[[], None]) -> bool:
        """Nobody has looked why it stopped: it may be wet, or held by something."""
        return False

    def watch(self) -> None: ...

    def look(self) -> None: ...

    def saw(self, joint: str, meanwhile: Callable[[], None]) -> Sight:
        return Sight.UNSEEN

    def holds_level(self, meanwhile: Callable[[], None]) -> bool:
        return False

    def turns(self, joint: str, meanwhile: Callable[[], None]) -> bool:
        return False

    def lets_go(self) -> None: ...


class SimulatedAttendant:
    """Eyes and hands at a simulated robot's mechanics."""

    def __init__(self, rig: SimulatedRig) -> None:
        self._plant = rig.robot.plant
        self._from_rad = self._farthest_rad = self._plant.angles_rad
        self._held_rad: list[float] | None = None
        self._turning = 0  # the place of the joint that is turned, along the course
        self._profile: deque[float] = deque()
        rig.others.append(lambda _: self._hold())

    def consents(self, what: str, meanwhile: Callable[[], None]) -> bool:
        return True

    def clears(self, faults: str, meanwhile: Callable[[], None]) -> bool:
        """A simulated robot that begins with a fault is one that a test has made so."""
        return False

    def watch(self) -> None:
        self._from_rad = self._plant.angles_rad

    def look(self) -> None:
        self._farthest_rad = self._plant.angles_rad

    def saw(self, joint: str, meanwhile: Callable[[], None]) -> Sight:
        moved_rad = [there - here for here, there in zip(self._from_rad, self._farthest_rad, strict=True)]
        seen = [place for place, path_rad in enumerate(moved_rad) if abs(path_rad) > SEEN_RAD]
        if not seen:
            return Sight.NOTHING
        if seen != [JOINTS.index(joint)]:
            return Sight.OTHER
        return Sight.RIGHT if moved_rad[seen[0]] > 0.0 else Sight.WRONG_WAY

    def holds_level(self, meanwhile: Callable[[], None]) -> bool:
        self._held_rad = [0.0] * len(JOINTS)
        return True

    def turns(self, joint: str, meanwhile: Callable[[], None]) -> bool:
        self._held_rad = [0.0, UP_RAD, 0.0, UP_RAD]
        self._turning = JOINTS.index(joint)
        stop_rad = END_STOPS_RAD[self._turning % 2]
        steps = round(TURNING_S / PERIOD_S)
        there_and_back = (*range(0, -steps, -1), *range(-steps, steps), *range(steps, -1, -1))
        self._profile.extend(stop_rad * step / steps for step in there_and_back)
        while self._profile:
            meanwhile()
        return True

    def lets_go(self) -> None:
        self._held_rad = None
        for arm in self._plant.arms:
            arm.put_back()

    def _hold(self) -> None:
        if self._held_rad is None:
            return
        if self._profile:
            self._held_rad[self._turning] = self._profile.popleft()
        left, right = self._plant.arms
        left.sweep_rad, left.adduction_rad, right.sweep_rad, right.adduction_rad = self._held_rad
        for arm in self._plant.arms:
            arm.sweep_velocity_rad_s = arm.adduction_velocity_rad_s = 0.0
