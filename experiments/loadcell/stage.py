"""The linear stage that carries the plate, moved by the operator or emulated.

The experiment asks for each motion and cannot tell which stage it has. Neither stage reports when a stroke begins:
that is found from the force.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random
from typing import NamedTuple

from control.records import UNKNOWN
from drivers.load_cell.line_formats import GRAVITY_M_S2
from experiments.loadcell.strokes import INSERTION, KINDS, SHEAR, StageSettings
from experiments.study.prompt import GO_ON, REDO, SKIP, Operator
from experiments.trials.load_cell_truth import Truth, true_coefficients
from simulation.body.reference_sensor import StrideTruth, StrokeTruth
from simulation.mud.clay import clay_of_water
from simulation.test_rig.load_cell_bench import RELAXATION, EmulatedBench, clay_plate
from simulation.test_rig.plate_stage import CarriedPlate

HEAVIEST_G = 50000.0
SETTLING_S = 0.5


class CellTrial(NamedTuple):
    mud: str
    kind: str  # SHEAR or INSERTION
    number: int  # from 1

    @property
    def key(self) -> str:
        return f"{self.mud}/{self.kind}/{self.number}"


@dataclass(frozen=True)
class TrialPlan:
    muds: tuple[str, ...]
    trials: int
    settings: StageSettings
    depth_error_m: float = 0.5e-3  # of a ruler, and of mud that is levelled by hand

    def list_trials(self) -> list[CellTrial]:
        numbers = range(1, self.trials + 1)
        return [CellTrial(mud, kind, number) for mud in self.muds for kind in KINDS for number in numbers]


class Stage:
    """A stage that the operator moves. `meanwhile` is called repeatedly while an answer is awaited."""

    patience_s = 60.0  # longest time until a stroke has begun
    lightest_g = (0.0, 0.0)  # of the two weights

    def __init__(self, settings: StageSettings, operator: Operator, meanwhile: Callable[[], None]) -> None:
        self._settings, self._operator, self._meanwhile = settings, operator, meanwhile

    def weigh(self, which: int) -> float:
        """Hang the lighter (0) or the heavier (1) weight on the cell; return its force in newtons."""
        name = ("lighter one, or nothing", "heavier one, near the largest force that you expect")[which]
        question = f"Calibration: hang a known weight on the cell, the {name}, and let it rest. How many grams is it?"
        weight_g = self._operator.ask_number(question, self.lightest_g[which], HEAVIEST_G, self._meanwhile)
        return weight_g / 1000.0 * GRAVITY_M_S2

    def prepare(self, trial: CellTrial, trials: int) -> str:
        """Level fresh mud with the plate clear above it; return GO_ON, SKIP, or REDO for the trial before."""
        along = "along the drag" if trial.kind == SHEAR else "upright, along the stroke"
        return self._operator.ask(
            f"Mud {trial.mud}, {trial.kind} {trial.number} of {trials}: re-mix and level the mud, wipe the plate, hang "
            f"it 2 cm above the mud, the cell {along}. Ready?",
            {GO_ON: "tare and start", SKIP: "skip this trial", REDO: "repeat the trial before"},
            self._meanwhile,
        )

    def lower(self) -> None:
        """Bring the plate to the depth of a shear."""
        depth_cm = 100.0 * self._settings.depth_m
        self._operator.ask(f"Lower the plate {depth_cm:g} cm into the mud. Ready?", {GO_ON: "yes"}, self._meanwhile)

    def start(self, trial: CellTrial) -> None:
        """Order the stroke, which begins after an unknown delay."""
        settings = self._settings
        stroke = f"drag it {100.0 * settings.shear_path_m:g} cm"
        if trial.kind == INSERTION:
            stroke = f"down to {100.0 * settings.depth_m:g} cm, hold {settings.hold_s:g} s, and up until it is clear"
        self._operator.report(
            f"Recording. Start the stage in a second or two: {stroke}, at {settings.speed_m_s:g} m/s."
        )

    def lift(self) -> None:
        """Bring the plate clear of the mud and clean it."""
        question = "Lift the plate clear of the mud, wipe it, and take your hands off. Ready?"
        self._operator.ask(question, {GO_ON: "yes"}, self._meanwhile)


class SimulatedStage(Stage):
    """The emulated stage obeys each prompt once it is answered. Strokes begin after a random delay."""

    patience_s = 5.0
    lightest_g = (0.0, 500.0)

    def __init__(
        self,
        settings: StageSettings,
        operator: Operator,
        meanwhile: Callable[[], None],
        bench: EmulatedBench,
        muds: Sequence[str],
        seed: int,
    ) -> None:
        super().__init__(settings, operator, meanwhile)
        self._bench, self._random = bench, Random(seed)
        self.plates: dict[str, CarriedPlate] = {mud: clay_plate(water_of(mud), settings.plate) for mud in muds}

    def weigh(self, which: int) -> float:
        self._bench.stage.hung_weight_n = super().weigh(which)
        self._bench.pass_time(SETTLING_S)
        return self._bench.stage.hung_weight_n

    def prepare(self, trial: CellTrial, trials: int) -> str:
        answer = super().prepare(trial, trials)
        if answer == GO_ON:
            self._bench.stage.hung_weight_n = 0.0
            self._bench.stage.move_over(self.plates[trial.mud], trial.kind == SHEAR)
            self._bench.pass_time(SETTLING_S)
        return answer

    def lower(self) -> None:
        super().lower()
        self._bench.stage.lower(self._bench.now_s(), self._settings.depth_m)
        self._finish()

    def start(self, trial: CellTrial) -> None:
        super().start(trial)
        stage, settings = self._bench.stage, self._settings
        start_s = self._bench.now_s() + self._random.uniform(1.0, 1.5)
        if trial.kind == SHEAR:
            stage.drag(start_s, settings.shear_path_m, settings.speed_m_s)
        else:
            stage.insert(start_s, settings.depth_m, settings.speed_m_s, settings.hold_s)

    def lift(self) -> None:
        super().lift()
        self._bench.stage.lift(self._bench.now_s())
        self._finish()

    def _finish(self) -> None:
        self._bench.pass_time(max(0.0, self._bench.stage.ends_s - self._bench.now_s()) + SETTLING_S)


def water_of(mud: str) -> float:
    """Return the water content that names a simulated mud. Raises ValueError for a name that is none."""
    try:
        water_percent = float(mud)
    except ValueError:
        raise ValueError(f"mud {mud!r}: a simulated one is a water content in percent, such as 48.6") from None
    clay_plate(water_percent)
    return water_percent


def clay_truth(mud: str, settings: StageSettings) -> Truth:
    """Return what the plate feels in even motion, without the stage's ramps and the cell's noise."""
    depth_m = settings.depth_m
    stroke = StrokeTruth(0.0, 0.0, depth_m, settings.speed_m_s, UNKNOWN, depth_m)
    stride = StrideTruth("", 0, clay_of_water(water_of(mud)), 0.0, stroke, stroke, stroke)
    return true_coefficients(stride, settings.plate, RELAXATION, settings.hold_s, upright=True)
