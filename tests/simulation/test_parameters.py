"""Every numeric parameter of the simulated robot states its bounds, and its default lies within them."""

from dataclasses import MISSING, fields
from typing import Annotated, get_args, get_origin, get_type_hints

import pytest

from control.bounds import Bounds
from simulation.body.free_body import BodyShape
from simulation.body.plant_parameters import PlantParameters
from simulation.devices.drive import SimulatedDriveParameters
from simulation.devices.motion_capture_parameters import MotionCaptureParameters
from simulation.harness.world import SegmentText
from simulation.mud.disturbances import Disturbances
from simulation.mud.layer import Layer
from simulation.mud.stones import Stone
from simulation.mud.unevenness import RandomStrength, Ridges

RECORDS = [
    *(BodyShape, MotionCaptureParameters, SimulatedDriveParameters, PlantParameters),
    *(Layer, Stone, Ridges, RandomStrength, Disturbances, SegmentText),
]


@pytest.mark.parametrize("record", RECORDS)
def test_every_number_has_bounds_around_its_default(record: type) -> None:
    hints = get_type_hints(record, include_extras=True)
    bounded = 0
    for field in fields(record):
        hint = hints[field.name]
        assert hint not in (int, float), field.name
        if get_origin(hint) is Annotated:
            _, bounds = get_args(hint)
            assert isinstance(bounds, Bounds)
            assert bounds.minimum < bounds.maximum
            assert field.default in (MISSING, None) or bounds.minimum <= field.default <= bounds.maximum, field.name
            bounded += 1
    assert bounded >= 2
