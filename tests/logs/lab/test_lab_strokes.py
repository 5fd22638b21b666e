"""The default method on the authors' own measurements: equal trials agree, and stronger mud gets larger coefficients.

The lab provides the strength labels. The stiffest log differs from the others: its flipper went 3 cm into the mud,
theirs 1.7 cm (by their angles and the begin of the force), and its sweep motor was saturated. A bound on k_s in N/m³ at
twice the depth cannot exceed the values of the others, so this log is compared by its forces.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from control.records import StrideEstimate
from logs.replay import replay_files
from tests.folders import SHARED_DATA

FOLDER = SHARED_DATA / "flipper_in_mud"
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="the shared measurements are not next to the repository")


@cache
def strokes_of(path: Path) -> tuple[StrideEstimate, ...]:
    return tuple(replay_files([path]).strides)


def first_strokes(label: str) -> list[StrideEstimate]:
    logs = sorted(FOLDER.glob(f"single_{label}_*"))
    assert logs
    return [strokes_of(path)[0] for path in logs]


def variation(values: list[float]) -> float:
    return float(np.std(values) / np.mean(values))


@pytest.mark.parametrize("label", ["10.3N", "12N", "12.5N"])
def test_shear_strength_of_equal_trials_agrees(label: str) -> None:
    strides = first_strokes(label)
    assert all(stride.k_s.valid and not stride.k_s.at_least for stride in strides)
    assert variation([stride.k_s.value for stride in strides]) <= 0.08


def test_penetration_resistance_of_equal_trials_agrees() -> None:
    strides = first_strokes("12.5N")  # the other insertions took 0.1 s and have only four samples in the mud
    assert all(stride.k_p.valid for stride in strides)
    assert variation([stride.k_p.value for stride in strides]) <= 0.12


def test_a_saturated_motor_is_reported_and_gives_a_lower_bound() -> None:
    (stride,) = first_strokes("stiffest")
    assert stride.k_s.valid
    assert stride.k_s.at_least
    assert "limit" in stride.k_s.reason
    assert stride.stance == "limited_by_motor"


def test_the_stiffest_mud_supports_the_largest_forces() -> None:
    (stiffest,) = first_strokes("stiffest")
    for label in ("10.3N", "12N", "12.5N"):
        for stride in first_strokes(label):
            assert stiffest.stance_force_n > 1.3 * stride.stance_force_n
            assert stiffest.insertion_force_n > stride.insertion_force_n


def test_repeats_in_the_same_hole_read_weaker_mud() -> None:
    for path in sorted(FOLDER.glob("single_12.5N_*")):
        strides = strokes_of(path)
        assert strides[-1].stance_force_n < 0.9 * strides[0].stance_force_n
