"""The operator at the test rig: allows motion, and holds and turns the flippers.

No drive knows on which joint it is mounted: its angle, torque and current agree with each other on any joint. So the
operator's hands are needed once, before any torque. Those of a simulated operator move the mechanics and not the drives
(simulated_hand.py).
"""

from collections.abc import Callable, Mapping

from experiments.robot.bench_robot import CLEAR, LEAVE
from experiments.study.prompt import GO_ON, Operator

GOES_ON = {GO_ON: "go on", "n": "no, end here"}


class Hand:
    """The hands of a person, who follows the prompts and needs no call."""

    @property
    def is_turning(self) -> bool:
        return False

    def hold(self) -> None:
        """Hold all joints straight out."""

    def turn(self, joint: str, end: float) -> None:
        """Turn a held joint to its front or upper stop (1), or to the other one (-1)."""

    def release(self) -> None:
        """Let go: the flippers lie down."""


class BenchOperator:
    """Asks by prompts. Without any the robot may move, and checks that need hands are left out.

    `sure`: motion is allowed in advance. Every method calls `meanwhile` repeatedly while it waits.
    """

    def __init__(self, prompt: Operator | None = None, hand: Hand | None = None, sure: bool = False) -> None:
        self.prompt, self.hand, self._sure = prompt, hand or Hand(), sure

    def allows_motion(self, what: str, meanwhile: Callable[[], None]) -> bool:
        """Ask before anything moves."""
        if self.prompt and self._sure:
            self.prompt.report(what)
        return self.prompt is None or self._sure or self._answer(what, GOES_ON, meanwhile) == GO_ON

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

    def _answer(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str | None:
        """Return nothing without an operator."""
        return None if self.prompt is None else self.prompt.ask(question, answers, meanwhile)
