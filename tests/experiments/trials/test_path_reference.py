"""The reference sensor of a path counts the stays of each flipper in the mud, and knows the mud that it met."""

import pytest

from control.records import Phase
from experiments.trials.path_reference import PathReference
from simulation.body.plant import Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.body.reference_sensor import StrideTruth
from simulation.mud.clay import MUDS, Clay
from simulation.mud.track import Track

FIRST, NEXT = Clay("first", 1000.0), Clay("next", 2000.0)


def watch(reference: PathReference, plant: Plant, *depths_m: float) -> list[StrideTruth]:
    """Move the left flipper to these depths below the nominal surface; return the strides that end."""
    arm, closed = plant.arms[0], list[StrideTruth]()
    for depth_m in depths_m:
        arm.adduction_rad = arm.parameters.geometry.adduction_rad(0.0, depth_m)
        closed += reference.step(0.01, plant, Phase.STROKE)
    return closed


def test_a_stay_that_a_stroke_reaches_is_a_stride_of_its_flipper() -> None:
    reference, plant = PathReference(), Plant(PlantParameters(), Track([(1.0, MUDS["48.5"])]))
    arm = plant.arms[0]
    watch(reference, plant, -0.01)
    assert watch(reference, plant, 0.004, -0.01) == []  # it only touched the mud
    arm.ground, arm.history.surface_m = FIRST, 0.002
    assert watch(reference, plant, 0.01, 0.03) == []
    arm.ground = NEXT
    (stride,) = watch(reference, plant, 0.01, -0.01)
    assert (stride.flipper, stride.index, stride.ground, stride.surface_m) == ("left", 0, FIRST, 0.002)
    assert stride.insertion.deepest_m == pytest.approx(0.028)
    assert [each.index for each in watch(reference, plant, 0.02, -0.01)] == [1]
