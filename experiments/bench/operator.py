"""The operator at the test rig: allows motion, holds and turns the flippers, and observes which one moves.

No drive knows on which joint it is mounted: its angle, torque and current agree with each other on any joint. So the
operator's eyes and hands are needed once. Those of a simulated operator move and observe the mechanics and not the
drives (simulated_hand.py).
"""

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from math import radians

from control.controller import UP_RAD
from experiments.robot.bench_robot import CLEAR, LEAVE
from experiments.study.prompt import GO_ON, Operator

SEEN_RAD = radians(4.0)  # visible motion
MOTIONS = {"sweep": "swing forward", "adduction": "rise"}
GOES_ON = {GO_ON: "go on", "n": "no, end here"}


class Observation(Enum):
    """The observed motion, with the advice for each."""

    RIGHT = ""
    OPPOSITE = "it moved in the opposite direction: change drive.{joint}.sign, and check its zero then"
    OTHER = "another joint moved: exchange the node ids (or the bus) of {joint} and of that joint"
    NOTHING = "nothing moved: check the coupling of motor and arm"
    UNSEEN = "there was no observer"


OBSERVED = {  # by the key of an answer
    GO_ON: ("yes", Observation.RIGHT),
    "w": ("the other way", Observation.OPPOSITE),
    "o": ("another joint moved", Observation.OTHER),
    "n": ("nothing moved", Observation.NOTHING),
}


class Hand:
    """The hands and eyes of a person, who follows the prompts and needs no call."""

    @property
    def is_turning(self) -> bool:
        return False

    def hold(self, adduction_rad: float = 0.0) -> None:
        """Hold all joints straight out."""

    def turn(self, joint: str, end: float) -> None:
        """Turn a held joint to its front or upper stop (1), to the other one (-1), or straight out (0)."""

    def release(self) -> None:
        """Let go: the flippers lie down."""

    def look(self) -> Sequence[float]:
        """Return where the joints are, in rad; nothing for a person, who has to be asked."""
        return ()


class BenchOperator:
    """Asks by prompts. Without any the robot may move, and checks that need hands or eyes are left out.

    `sure`: motion is allowed in advance. Every method calls `meanwhile` repeatedly while it waits.
    """

    def __init__(self, prompt: Operator | None = None, hand: Hand | None = None, sure: bool = False) -> None:
        self._prompt, self.hand, self._sure = prompt, hand or Hand(), sure

    def allows_motion(self, what: str, meanwhile: Callable[[], None]) -> bool:
        """Ask before anything moves."""
        if self._prompt and self._sure:
            self._prompt.report(what)
        return self._prompt is None or self._sure or self._answer(what, GOES_ON, meanwhile) == GO_ON

    def allows_clearing(self, faults: str, meanwhile: Callable[[], None]) -> bool:
        """Ask whether to clear faults from before the first torque, such as a tripped watchdog.

        The operator is asked even if motion is allowed in advance: the faults were not known then. Without an operator
        the cause is unknown, perhaps water or a blocked flipper.
        """
        answers = {CLEAR: "clear it and go on", LEAVE: "end here"}
        return self._answer(f"{faults} Is the cause gone?", answers, meanwhile) == CLEAR

    def allows_unknown_watchdogs(self, what: str, meanwhile: Callable[[], None]) -> bool:
        """Ask whether to arm drives by force whose watchdogs cannot be read: only the power switch is certain."""
        question = f"{what} Is a hand on the power switch, and may the robot be armed by force?"
        return self._answer(question, GOES_ON, meanwhile) == GO_ON

    def observed_motion(
        self, joint: str, index: int, seen_rad: Sequence[float], meanwhile: Callable[[], None]
    ) -> Observation:
        """`seen_rad` is the motion that the hand's eyes saw of each joint."""
        visible = [other for other, path_rad in enumerate(seen_rad) if abs(path_rad) > SEEN_RAD]
        if visible == [index]:
            return Observation.RIGHT if seen_rad[index] > 0.0 else Observation.OPPOSITE
        if seen_rad:
            return Observation.OTHER if visible else Observation.NOTHING
        side, kind = joint.split("_")
        question = f"Did the {side} flipper {MOTIONS[kind]} and come back, and nothing else move?"
        answer = self._answer(question, {key: text for key, (text, _) in OBSERVED.items()}, meanwhile)
        return Observation.UNSEEN if answer is None else OBSERVED[answer][1]

    def hold_level(self, meanwhile: Callable[[], None]) -> bool:
        """Hold both flippers straight out and level until `release_flippers`. False: there is no operator."""
        self.hand.hold()
        return self._done("Hold both flippers level and straight out, as a spirit level has it.", meanwhile)

    def turn_joint(self, joint: str, meanwhile: Callable[[], None]) -> bool:
        """Turn one joint by hand from stop to stop. False: there is no operator."""
        self.hand.hold(UP_RAD)
        for end in (-1.0, 1.0, 0.0):
            self.hand.turn(joint, end)
        side, kind = joint.split("_")
        directions = "fore and aft" if kind == "sweep" else "up and down"
        what = f"Move the {side} flipper slowly {directions}, from stop to stop and back."
        is_done = self._done(what, meanwhile)
        while self.hand.is_turning:
            meanwhile()
        return is_done

    def release_flippers(self) -> None:
        if self._prompt:
            self._prompt.report("Release the flippers and lay them down.")
        self.hand.release()

    def _done(self, what: str, meanwhile: Callable[[], None]) -> bool:
        return self._answer(what, {GO_ON: "done", "s": "skip"}, meanwhile) == GO_ON

    def _answer(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str | None:
        """Return nothing without an operator."""
        return None if self._prompt is None else self._prompt.ask(question, answers, meanwhile)
