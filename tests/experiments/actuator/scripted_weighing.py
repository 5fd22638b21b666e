"""A weighing with scripted robot, joint, weights and operator, for tests."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from control.records import JOINTS
from experiments.actuator.friction import Loop
from experiments.actuator.plan import WeighingPlan, WeighingStep
from experiments.actuator.simulation import bench_configuration
from experiments.actuator.weighing import JointWeighing, WeightHandler
from experiments.robot.bench_errors import BenchError
from experiments.study.notebook import Entry, Notebook
from experiments.study.prompt import GO_ON
from firmware_host.configuration.configuration import Configuration
from tests.experiments.still_robot import StillRobot
from tests.scripted_operator import ScriptedOperator

JOINT = "right_adduction"
PLAN = WeighingPlan((JOINT,), weights_g=(100.0, 200.0, 400.0), trials=2)
TRUE_NM_A = 0.0719


class ScriptedRobot(StillRobot):
    """A BenchRobot with a scripted mode, winding temperature and hanging weight; its winding cools while it waits."""

    configuration: Configuration = bench_configuration()

    def __init__(self) -> None:
        super().__init__("idle")
        self.winding_c, self.hanging_g, self.armed, self.message = 30.0, 0.0, 0, ""

    def call(self, method: str, **params: Any) -> Any:
        if method == "arm":
            self.mode, self.armed = "hold", self.armed + 1
        if method == "clear":
            self.mode = "idle"
        fault = {"message": self.message, "what_to_do": "do this", "blocks_arming": False, "age_s": 3.0}
        drives = [{"joint": joint, "winding_c": self.winding_c} for joint in JOINTS]
        standing: dict[str, Any] = {"mode": self.mode, "fault": fault if self.mode == "fault" else None, "notice": ""}
        standing |= {"now_s": self.now_s}
        return standing | {"drives": drives, "faults": [fault] if self.mode == "fault" else [], "moving": False}

    def wait(self, duration_s: float) -> None:
        super().wait(duration_s)
        self.winding_c = max(30.0, self.winding_c - duration_s)


class ScriptedWeights(WeightHandler):
    """Hangs the requested weight, unless the script of the step says otherwise."""

    handling_s = 2.0

    def __init__(self, robot: ScriptedRobot, operator: ScriptedOperator) -> None:
        super().__init__(operator, PLAN, JOINT)
        self.robot = robot
        self.script: dict[str, list[Callable[[], str]]] = {}
        self.asked: list[str] = []

    def hold_level(self, meanwhile: Callable[[], None]) -> None:
        self.robot.hanging_g = 0.0

    def release(self, meanwhile: Callable[[], None]) -> None:
        meanwhile()

    def hang(self, step: WeighingStep, meanwhile: Callable[[], None]) -> str:
        self.meanwhile = meanwhile
        meanwhile()
        self.asked.append(step.key)
        self.robot.hanging_g = step.weight_g
        answers = self.script.get(step.key, [])
        return answers.pop(0)() if answers else GO_ON

    def take_off(self) -> None:
        self.robot.hanging_g = 0.0


class ScriptedJoint:
    """A HeldJoint that reads the hanging weight without an error."""

    def __init__(self, robot: Any, joint: str) -> None:
        self.robot: ScriptedRobot = robot

    def read(self) -> Entry:
        if self.robot.mode != "hold":
            raise BenchError(f"the robot no longer holds its pose: {self.robot.message}")
        current_a = PLAN.torque_nm(self.robot.hanging_g) / TRUE_NM_A + 0.6
        return {"current_a": current_a, "rest_friction_a": 0.0, "angle_rad": 0.0}


LOOP = Loop(0.18, 0.2, quick=False, held_a=0.6)


class Case:
    """Owns the parts of one calibration; a second `run` continues it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.robot = ScriptedRobot()
        self.operator = ScriptedOperator()
        self.hand = ScriptedWeights(self.robot, self.operator)
        self.shown: list[tuple[int, int]] = []

    def run(self) -> Mapping[str, Any]:
        notebook = Notebook(self.folder, asdict(PLAN))
        return JointWeighing(self.robot, self.hand, notebook, lambda *at: self.shown.append(at)).run()

    def on(self, step: WeighingStep, *answers: Callable[[], str]) -> None:
        self.hand.script[step.key] = list(answers)

    def hanging(self, grams: float) -> Callable[[], str]:
        """Return an answer of the script that hangs this weight instead of the requested one."""

        def hang() -> str:
            self.robot.hanging_g = grams
            return GO_ON

        return hang

    def letting_go(self, message: str) -> Callable[[], str]:
        def fail() -> str:
            self.robot.mode, self.robot.message = "fault", message
            return GO_ON

        return fail
