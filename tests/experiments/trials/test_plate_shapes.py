"""Known mud from plates of two shapes: simulated trials against the virtual load cell with the same plate.

The shapes are those of examples/plates. Mud, disturbances and method are those of the estimation experiment, whose
95th percentiles for this mud are 14, 15 and 13 % (docs/explanation/accuracy.md). Torque constants are known, as one
drawn error would shift all coefficients of a trial.
"""

from dataclasses import replace
from pathlib import Path
from statistics import median

import pytest

from control.geometry import FlipperGeometry
from control.records import COEFFICIENTS
from estimation.estimation_parameters import EstimationParameters
from experiments.campaign.plate_file import read_corners
from experiments.trials.load_cell_truth import true_coefficients
from experiments.trials.trial import SINGLE, run_trial
from simulation.mud.clay import clay_of_water
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track
from tests.experiments.synthetic_strides import strides_of

PLATES = Path(__file__).resolve().parents[3] / "examples" / "plates"
TRACK = Track([(100.0, clay_of_water(48.6))])
LARGEST = {"k_p": 0.14, "k_s": 0.15, "k_e": 0.13}
PAUSE_S = 0.5  # between the phases, not 3 s, to save time
SHORT = replace(SINGLE, gait=replace(SINGLE.gait, pause_s=PAUSE_S))
METHOD = EstimationParameters(fixed_base=True, surface_error_m=LAB.surface_error_m)


def errors_of(geometry: FlipperGeometry) -> dict[str, list[float]]:
    """The relative errors of each coefficient in a trial of one stride of each flipper."""
    trial = run_trial(replace(SHORT, geometry=geometry), TRACK, LAB, 1, seed=1)
    truths = {each.flipper: true_coefficients(each, geometry, LAB.relaxation, PAUSE_S, False) for each in trial.truths}
    errors: dict[str, list[float]] = {name: [] for name in COEFFICIENTS}
    for stride in strides_of(trial, METHOD):
        for name in COEFFICIENTS:
            estimate, truth = getattr(stride, name), truths[stride.flipper][name]
            assert estimate.valid and not estimate.at_least
            errors[name].append(estimate.value / truth - 1.0)
    return errors


@pytest.mark.parametrize("shape", ["trapezoid", "paddle"])
def test_known_mud_is_recovered_with_each_shape(shape: str) -> None:
    errors = errors_of(FlipperGeometry(plate_corners_m=read_corners(PLATES / f"{shape}.csv")))
    for name, values in errors.items():
        assert len(values) == 2
        assert max(map(abs, values)) < LARGEST[name]
    assert median(abs(value) for values in errors.values() for value in values) < 0.06
