"""The stage that carries the plate, as the experiment needs it: somebody prepares it, starts it and lifts the plate.

A person does at a real bench, and says when; in simulation the emulated stage is told. The experiment cannot tell
which, and neither says when exactly a stroke begins.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from random import Random
from typing import NamedTuple, Protocol

from drivers.load_cell.line_formats import GRAVITY_M_S2
from experiments.loadcell.fits import INSERTION, SHEAR
from experiments.loadcell.motion import StageSettings
from experiments.robot.prompt import GO_ON, REDO, SKIP, Operator
from simulation.test_rig.load_cell_bench import EmulatedBench
from simulation.test_rig.plate_stage import CarriedPlate

HEAVIEST_G = 50000.0
ATTENDED_PATIENCE_S, SIMULATED_PATIENCE_S = 60.0, 5.0
SIMULATED_WEIGHTS_G = (0.0, 500.0)
SETTLING_S = 0.5


class Trial(NamedTuple):
    mud: str
    kind: str  # SHEAR or INSERTION
    number: int  # from 1

    @property
    def key(self) -> str:
        return f"{self.mud}/{self.kind}/{self.number}"


class Stage(Protocol):
    patience_s: float  # how long it may take until the stroke has begun

    def weigh(self, which: int) -> float:
        """Hang the lighter (0) or the heavier (1) weight on the cell; its force in newtons."""

    def prepare(self, trial: Trial, trials: int) -> str:
        """Fresh and level mud, the plate clear above it, the cell along the stroke: GO_ON, SKIP, or REDO the last."""

    def lower(self) -> None:
        """Into the mud, as deep as the shear goes."""

    def start(self, trial: Trial) -> None:
        """The stroke begins any moment now."""

    def lift(self) -> None:
        """The plate is clear of the mud again, and clean."""


class AttendedStage:
    """A Stage that a person looks after. `meanwhile` reads what the load cell sends in the meantime."""

    patience_s = ATTENDED_PATIENCE_S

    def __init__(self, settings: StageSettings, operator: Operator, meanwhile: Callable[[], None]) -> None:
        self._settings, self._operator, self._meanwhile = settings, operator, meanwhile

    def weigh(self, which: int) -> float:
        name = ("lighter one, or nothing", "heavier one, near the largest force that you expect")[which]
        question = f"Calibration: hang a known weight on the cell, the {name}, and let it rest. How many grams is it?"
        grams = self._operator.ask_number(question, 0.0, HEAVIEST_G, self._meanwhile)
        return grams / 1000.0 * GRAVITY_M_S2

    def prepare(self, trial: Trial, trials: int) -> str:
        along = "along the drag" if trial.kind == SHEAR else "upright, along the stroke"
        question = (
            f"Mud {trial.mud}, {trial.kind} {trial.number} of {trials}: re-mix and level the mud, wipe the plate, hang "
            f"it 2 cm clear above the mud, the cell {along}. Ready?"
        )
        answers = {GO_ON: "tare and go on", SKIP: "skip this trial", REDO: "the last one again"}
        return self._operator.ask(question, answers, self._meanwhile)

    def lower(self) -> None:
        depth_cm = 100.0 * self._settings.depth_m
        self._operator.ask(f"Lower the plate {depth_cm:g} cm into the mud. Ready?", {GO_ON: "yes"}, self._meanwhile)

    def start(self, trial: Trial) -> None:
        settings = self._settings
        stroke = f"drag it {100.0 * settings.shear_path_m:g} cm"
        if trial.kind == INSERTION:
            stroke = f"down to {100.0 * settings.depth_m:g} cm, hold {settings.hold_s:g} s, and up until it is clear"
        self._operator.report(
            f"Recording. Start the stage in a second or two: {stroke}, at {settings.speed_m_s:g} m/s."
        )

    def lift(self) -> None:
        question = "Lift the plate clear of the mud, wipe it, and let go. Ready?"
        self._operator.ask(question, {GO_ON: "yes"}, self._meanwhile)


class SimulatedStage:
    """A Stage on the emulated bench: obeys at once, and starts its strokes when it likes."""

    patience_s = SIMULATED_PATIENCE_S

    def __init__(
        self, settings: StageSettings, bench: EmulatedBench, plates: Mapping[str, CarriedPlate], seed: int
    ) -> None:
        self._settings, self._bench, self._plates = settings, bench, plates
        self._random = Random(seed)

    def weigh(self, which: int) -> float:
        self._bench.stage.hung_n = SIMULATED_WEIGHTS_G[which] / 1000.0 * GRAVITY_M_S2
        self._bench.pass_time(SETTLING_S)
        return self._bench.stage.hung_n

    def prepare(self, trial: Trial, trials: int) -> str:
        self._bench.stage.hung_n = 0.0
        self._bench.stage.place_over(self._plates[trial.mud], trial.kind == SHEAR)
        self._bench.pass_time(SETTLING_S)
        return GO_ON

    def lower(self) -> None:
        self._bench.stage.lower(self._bench.now_s(), self._settings.depth_m)
        self._finish()

    def start(self, trial: Trial) -> None:
        stage, settings = self._bench.stage, self._settings
        start_s = self._bench.now_s() + self._random.uniform(1.0, 1.5)
        if trial.kind == SHEAR:
            stage.drag(start_s, settings.shear_path_m, settings.speed_m_s)
        else:
            stage.insert(start_s, settings.depth_m, settings.speed_m_s, settings.hold_s)

    def lift(self) -> None:
        self._bench.stage.lift(self._bench.now_s())
        self._finish()

    def _finish(self) -> None:
        self._bench.pass_time(max(0.0, self._bench.stage.ends_s - self._bench.now_s()) + SETTLING_S)
