"""A simulated mud's true coefficients: its plate in even motion, without the stage's ramps, the cell or its noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from control.records import UNKNOWN
from experiments.loadcell.fits import COEFFICIENTS, OfMud
from experiments.loadcell.motion import StageSettings
from experiments.reports.mud_names import mud_text
from experiments.reports.value_text import N_CM3, miss_text, value_text
from experiments.trials.load_cell_truth import TrueCoefficients, true_coefficients
from simulation.body.reference_sensor import StrideTruth, StrokeTruth
from simulation.mud.clay import clay_of_water
from simulation.test_rig.load_cell_bench import RELAXATION

HOLD_S = 3.0  # the paper's


def clay_truth(water_percent: float, settings: StageSettings) -> TrueCoefficients:
    """Of the upright plate at the depth and speed that the stage is set to."""
    depth_m = settings.depth_m
    stroke = StrokeTruth(0.0, 0.0, depth_m, settings.speed_m_s, UNKNOWN, depth_m)
    stride = StrideTruth("", 0, clay_of_water(water_percent), 0.0, stroke, stroke, stroke)
    return true_coefficients(stride, settings.plate, RELAXATION, HOLD_S, upright=True)


def truth_rows(
    muds: Mapping[str, Mapping[str, OfMud]], truths: Mapping[str, TrueCoefficients]
) -> Sequence[Sequence[str]]:
    """A table: the true value, and by how much the measured one misses it."""
    head = ["mud", *(f"true {name} (N/cm³)" for name in COEFFICIENTS), *(f"{name} misses by" for name in COEFFICIENTS)]
    return [
        head,
        *(
            [mud_text(mud), *_true_cells(truths[mud]), *_missed(reported, truths[mud])]
            for mud, reported in muds.items()
        ),
    ]


def _true_cells(truth: TrueCoefficients) -> list[str]:
    return [value_text(getattr(truth, name), per=N_CM3) for name in COEFFICIENTS]


def _missed(reported: Mapping[str, OfMud], truth: TrueCoefficients) -> list[str]:
    return [miss_text(reported[name].value, getattr(truth, name)) if name in reported else "-" for name in COEFFICIENTS]
