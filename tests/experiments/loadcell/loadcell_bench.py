"""An emulated bench with everything that an experiment with a load cell needs, and a scripted operator."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from drivers.load_cell.calibration import LoadCellCalibration
from drivers.load_cell.line_formats import LineFormat
from drivers.load_cell.load_cell_port import LoadCellPort
from drivers.load_cell.stage_encoder import StageEncoder, StageEncoderSettings
from experiments.loadcell.preparation import CellSettings, prepare_cell
from experiments.loadcell.recording import CellBench
from experiments.loadcell.stage import CellTrial, SimulatedStage, TrialPlan
from experiments.loadcell.strokes import INSERTION, StageSettings
from experiments.loadcell.trials import measure, measure_all
from experiments.studies.loadcell import notebook_plan
from experiments.study.notebook import Notebook
from experiments.study.prompt import AutomaticOperator
from experiments.study.session import Session
from simulation.test_rig.emulated_instruments import AmplifierParameters, StageEncoderParameters
from simulation.test_rig.load_cell_bench import EmulatedBench
from simulation.test_rig.plate_stage import StageParameters
from simulation.test_rig.stage_motion import ManualMotionParameters
from tests.experiments.loadcell.lawful_mud import LawfulMud
from tests.scripted_operator import ScriptedOperator

SETTINGS = StageSettings()
COUNTS = LoadCellCalibration("counts", 42000.0, 81000.0)


class EventfulBench(EmulatedBench):
    """An emulated bench that triggers events at set times."""

    def __init__(self, *devices: Any) -> None:
        self.events: list[tuple[float, Callable[[], None]]] = []
        super().__init__(*devices)
        self._step = self.amplifier.step
        self.amplifier.step = self._happen_and_step  # type: ignore[method-assign]

    def _happen_and_step(self, now_s: float) -> None:
        for event in [event for event in self.events if event[0] <= now_s]:
            self.events.remove(event)
            event[1]()
        self._step(now_s)


class Laboratory:
    """Owns an emulated bench, the port to it and a notebook in a folder."""

    def __init__(
        self,
        folder: Path,
        operator: ScriptedOperator,
        trials: int = 1,
        amplifier: AmplifierParameters | None = None,
        encoder: StageEncoderParameters | None = None,
    ) -> None:
        """Emulate a motorised stage, or with an `encoder` one that is pushed by hand."""
        self.folder, self.operator, mud = folder, operator, LawfulMud()
        stage = None if encoder is None else StageParameters(manual=ManualMotionParameters(), seed=1)
        self.bench = EventfulBench(mud, folder / "cell", amplifier, stage, 1, encoder)
        self.port = LoadCellPort(str(folder / "cell"), 115200, LineFormat("number"), COUNTS)
        self.encoder = None
        if encoder is not None:
            settings = StageEncoderSettings(str(folder / "cell_position"), encoder.metres_per_count)
            self.encoder = StageEncoder(settings)
        self.notebook = Notebook(folder, notebook_plan(SETTINGS))
        self.cell = CellBench(
            session=Session(folder, operator, lambda done, total: None),
            plan=TrialPlan(("lawful",), trials, SETTINGS),
            notebook=self.notebook,
            port=self.port,
            clock=self.bench,
            encoder=self.encoder,
        )
        silent = AutomaticOperator(lambda message: None)
        self.cell.stage = stage_of_it = SimulatedStage(SETTINGS, silent, self.cell.drain, self.bench, (), 1)
        stage_of_it.plates = {"lawful": mud}

    def at(self, after_s: float, happen: Callable[[], None]) -> None:
        self.bench.events.append((self.bench.now_s() + after_s, happen))

    def measure(self, cell: CellSettings | None = None) -> None:
        prepare_cell(self.cell, cell or CellSettings())
        measure_all(self.cell)

    def try_once(self, kind: str = INSERTION) -> list[str]:
        """Measure one trial and return the reported messages."""
        trial, entry, attempts = CellTrial("lawful", kind, 1), None, Counter[str]()
        self.cell.listen(1.0)
        while entry is None:
            self.cell.stage.prepare(trial, 1)
            entry = measure(self.cell, trial, attempts)
        self.notebook.write(trial.key, entry)
        return self.operator.reported

    def close(self) -> None:
        self.port.close()
        if self.encoder is not None:
            self.encoder.close()
        self.bench.close()
