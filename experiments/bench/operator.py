"""The operator at the test rig: allows motion, holds and turns the flippers, and observes which one moves.

No drive knows on which joint it is mounted: its angle, torque and current agree with each other on any joint. So the
operator's eyes and hands are needed once. The simulated operator observes the mechanics and not the drives.
"""

from collections.abc import Callable
from enum import Enum
from math import radians

from control.controller import UP_RAD
from experiments.bench.rig import SimulatedRig
from experiments.bench.simulated_hand import SimulatedHand
from experiments.robot.bench_robot import CLEAR, LEAVE
from experiments.study.prompt import GO_ON, Operator
from simulation.body.plant import END_STOPS_RAD

MOTIONS = {"sweep": "swing forward", "adduction": "rise"}
SEEN_RAD = radians(4.0)  # visible motion


class Observation(Enum):
    """The observed motion, with the advice for each."""

    RIGHT = ""
    OPPOSITE = "it moved in the opposite direction: change drive.{joint}.sign, and check its zero then"
    OTHER = "another joint moved: exchange the node ids (or the bus) of {joint} and of that joint"
    NOTHING = "nothing moved: check the coupling of motor and arm"
    UNSEEN = "there was no observer"


class BenchOperator:
    """No operator: the robot may move, and checks that need hands or eyes are left out.

    Every method calls `meanwhile` repeatedly while it waits.
    """

    def allows_motion(self, what: str, meanwhile: Callable[[], None]) -> bool:
        """Ask before anything moves."""
        return True

    def allows_clearing(self, faults: str, meanwhile: Callable[[], None]) -> bool:
        """Ask whether to clear faults from before the first torque, such as a tripped watchdog.

        Without an operator the cause is unknown, perhaps water or a blocked flipper.
        """
        return False

    def allows_unknown_watchdogs(self, what: str, meanwhile: Callable[[], None]) -> bool:
        """Ask whether to arm drives by force whose watchdogs cannot be read."""
        return False

    def start_observing(self) -> None:
        """Start before one joint moves; `observe_farthest` follows at its farthest position."""

    def observe_farthest(self) -> None: ...

    def observed_motion(self, joint: str, meanwhile: Callable[[], None]) -> Observation:
        return Observation.UNSEEN

    def hold_level(self, meanwhile: Callable[[], None]) -> bool:
        """Hold both flippers straight out and level until `release_flippers`. False: there is no operator."""
        return False

    def turn_joint(self, joint: str, meanwhile: Callable[[], None]) -> bool:
        """Turn one joint by hand from stop to stop. False: there is no operator."""
        return False

    def release_flippers(self) -> None: ...


class PromptedBenchOperator(BenchOperator):
    """An operator who is prompted. `sure`: motion is allowed in advance."""

    def __init__(self, operator: Operator, sure: bool) -> None:
        self._operator = operator
        self._sure = sure

    def allows_motion(self, what: str, meanwhile: Callable[[], None]) -> bool:
        if self._sure:
            self._operator.report(what)
            return True
        return self._operator.ask(what, {GO_ON: "go on", "n": "no, end here"}, meanwhile) == GO_ON

    def allows_clearing(self, faults: str, meanwhile: Callable[[], None]) -> bool:
        """Ask even if motion is allowed in advance: the faults were not known then."""
        answers = {CLEAR: "clear it and go on", LEAVE: "end here"}
        return self._operator.ask(f"{faults} Is the cause gone?", answers, meanwhile) == CLEAR

    def allows_unknown_watchdogs(self, what: str, meanwhile: Callable[[], None]) -> bool:
        """Ask even if motion is allowed in advance: only the power switch is certain."""
        question = f"{what} Is a hand on the power switch, and may the robot be armed by force?"
        return self._operator.ask(question, {GO_ON: "go on", "n": "no, end here"}, meanwhile) == GO_ON

    def observed_motion(self, joint: str, meanwhile: Callable[[], None]) -> Observation:
        side, kind = joint.split("_")
        answers = {
            GO_ON: ("yes", Observation.RIGHT),
            "w": ("the other way", Observation.OPPOSITE),
            "o": ("another joint moved", Observation.OTHER),
            "n": ("nothing moved", Observation.NOTHING),
        }
        question = f"Did the {side} flipper {MOTIONS[kind]} and come back, and nothing else move?"
        choices = {key: text for key, (text, _) in answers.items()}
        return answers[self._operator.ask(question, choices, meanwhile)][1]

    def hold_level(self, meanwhile: Callable[[], None]) -> bool:
        return self._done("Hold both flippers level and straight out, as a spirit level has it.", meanwhile)

    def turn_joint(self, joint: str, meanwhile: Callable[[], None]) -> bool:
        side, kind = joint.split("_")
        directions = "fore and aft" if kind == "sweep" else "up and down"
        return self._done(f"Move the {side} flipper slowly {directions}, from stop to stop and back.", meanwhile)

    def release_flippers(self) -> None:
        self._operator.report("Release the flippers and lay them down.")

    def _done(self, what: str, meanwhile: Callable[[], None]) -> bool:
        return self._operator.ask(what, {GO_ON: "done", "s": "skip"}, meanwhile) == GO_ON


class SimulatedBenchOperator(BenchOperator):
    """An operator who observes and moves the mechanics of a simulated robot."""

    def __init__(self, rig: SimulatedRig) -> None:
        self._plant = rig.robot.plant
        self._joints = rig.configuration.rig.joints
        self._from_rad = self._farthest_rad = self._plant.angles_rad
        self._hand = SimulatedHand(rig)

    def allows_unknown_watchdogs(self, what: str, meanwhile: Callable[[], None]) -> bool:
        return True

    def start_observing(self) -> None:
        self._from_rad = self._plant.angles_rad

    def observe_farthest(self) -> None:
        self._farthest_rad = self._plant.angles_rad

    def observed_motion(self, joint: str, meanwhile: Callable[[], None]) -> Observation:
        moved_rad = [there - here for here, there in zip(self._from_rad, self._farthest_rad, strict=True)]
        seen = [index for index, path_rad in enumerate(moved_rad) if abs(path_rad) > SEEN_RAD]
        if not seen:
            return Observation.NOTHING
        if seen != [self._joints.index(joint)]:
            return Observation.OTHER
        return Observation.RIGHT if moved_rad[seen[0]] > 0.0 else Observation.OPPOSITE

    def hold_level(self, meanwhile: Callable[[], None]) -> bool:
        self._hand.hold([0.0] * len(self._joints))
        return True

    def turn_joint(self, joint: str, meanwhile: Callable[[], None]) -> bool:
        self._hand.hold([0.0, UP_RAD] * len(self._plant.arms))
        index = self._joints.index(joint)
        for angle_rad in (-END_STOPS_RAD[index % 2], END_STOPS_RAD[index % 2], 0.0):
            self._hand.turn(index, angle_rad)
        while self._hand.is_turning:
            meanwhile()
        return True

    def release_flippers(self) -> None:
        self._hand.release()
