"""Handling of the flipper and the weights at the bench: by the operator, or in simulation (simulation.py)."""

from collections.abc import Callable
from math import degrees
from typing import Protocol

from experiments.actuator.friction import SWING_RAD
from experiments.actuator.plan import OPERATOR_S, Plan, Step
from experiments.study.prompt import GO_ON, REDO, SKIP, Operator

EMPTY = (
    "take everything off the flipper, and let it rest. Keep clear: after its reading it swings by"
    f" {degrees(SWING_RAD):.0f} degrees to each side for 15 s."
)


class WeightHandler(Protocol):
    @property
    def handling_s(self) -> float:
        """The time that a weight hangs beyond its reading."""

    def hold_level(self, joint: str, meanwhile: Callable[[], None]) -> None:
        """Take all weights off and hold all flippers near level while torque is off."""

    def release(self, meanwhile: Callable[[], None]) -> None: ...

    def hang(self, step: Step, meanwhile: Callable[[], None]) -> str:
        """Return GO_ON when it hangs, SKIP to leave it out, REDO for the one before."""

    def take_off(self) -> None:
        """Take the weight off at once: it is too much for the motor."""


class ManualWeights:
    """A WeightHandler that prompts the operator."""

    handling_s = OPERATOR_S

    def __init__(self, operator: Operator, plan: Plan) -> None:
        self._operator = operator
        self._plan = plan

    def hold_level(self, joint: str, meanwhile: Callable[[], None]) -> None:
        axle = "sweep" if joint.endswith("sweep") else "adduction"
        self._operator.ask(
            f"Mount the robot with the {axle} axle of the {joint.split('_')[0]} flipper horizontal and the flipper out"
            " over the edge, the other joints propped within their range. Take all weights off and hold the flipper"
            " level: all four motors will hold their angles.",
            {GO_ON: "it is held"},
            meanwhile,
        )

    def release(self, meanwhile: Callable[[], None]) -> None:
        self._operator.ask("The motor holds. Let go of the flipper.", {GO_ON: "done"}, meanwhile)

    def hang(self, step: Step, meanwhile: Callable[[], None]) -> str:
        trial = f"Trial {step.reported_trial} of {self._plan.trials}"
        what = f"hang {step.weight_g:g} g at {100.0 * self._plan.lever_m:g} cm from the axle, nothing else"
        question = f"{trial}: {what}, and let it rest." if step.weight_g else f"{trial}: {EMPTY}"
        answers = {GO_ON: "it rests", SKIP: "skip it", REDO: "redo the one before"}
        return self._operator.ask(question, answers, meanwhile)

    def take_off(self) -> None:
        self._operator.report("Take the weight off the flipper now.")
