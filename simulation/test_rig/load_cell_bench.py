"""A bench with a stage, a plate, a load cell and its amplifier, and its own time: the paper's section II-E.

Simulated time passes as fast as the machine computes.
"""

from pathlib import Path

from control.geometry import FlipperGeometry
from simulation.mud.clay import clay_of_water
from simulation.test_rig.emulated_instruments import (
    AmplifierParameters,
    EmulatedAmplifier,
    EmulatedStageEncoder,
    StageEncoderParameters,
)
from simulation.test_rig.load_cell import LoadCell
from simulation.test_rig.plate_stage import CarriedPlate, PlateStage, StageParameters

STEP_S = 0.01
RELAXATION = 0.13  # fraction of the load that a hold loses, as in the authors' logs
PAPER_PLATE = FlipperGeometry(plate_width_m=0.03, plate_height_m=0.035, plate_thickness_m=0.004)


def clay_plate(water_percent: float, plate: FlipperGeometry = PAPER_PLATE) -> LoadCell:
    """Raise ValueError where no mud has this water content."""
    return LoadCell(clay_of_water(water_percent), plate, 0.0, 0.0, RELAXATION)


class EmulatedBench:
    """Owns the time."""

    def __init__(
        self,
        plate: CarriedPlate,
        link: Path,
        amplifier: AmplifierParameters | None = None,
        stage: StageParameters | None = None,
        seed: int = 1,
        encoder: StageEncoderParameters | None = None,
    ) -> None:
        """`encoder`: adds a stage encoder, whose link is that of the amplifier with `_position` appended."""
        self.stage = PlateStage(plate, stage)
        self.amplifier = EmulatedAmplifier(self.stage.mean_force_n, amplifier or AmplifierParameters(), link, seed)
        self.encoder: EmulatedStageEncoder | None = None
        if encoder is not None:
            encoder_link = link.with_name(f"{link.name}_position")
            self.encoder = EmulatedStageEncoder(self.stage.travelled_m, encoder, encoder_link, seed + 1)
        self._now_s = 0.0
        self.stage.mean_force_n(0.0)

    def now_s(self) -> float:
        return self._now_s

    def pass_time(self, duration_s: float) -> None:
        end_s = self._now_s + duration_s
        while self._now_s < end_s - 1e-9:
            self._now_s = min(self._now_s + STEP_S, end_s)
            self.amplifier.step(self._now_s)
            if self.encoder is not None:
                self.encoder.step(self._now_s)

    def close(self) -> None:
        self.amplifier.close()
        if self.encoder is not None:
            self.encoder.close()
