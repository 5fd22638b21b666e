"""The strides and moments to be shown are chosen correctly from walks that are synthesised row by row."""

from math import nan
from typing import Any

import numpy as np
import pytest

from control.geometry import FlipperGeometry
from control.records import Phase
from experiments.pictures.recorded_walk import RecordedWalk
from experiments.pictures.stride_choice import (
    Outcome,
    choose_strides,
    duration_s,
    geometric_step_m,
    moments_of,
    of_both_flippers,
    outcome_of,
    rows_of,
)

STROKES = (Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION, Phase.SWING)
ROWS = 10  # of each phase, 0.1 s apart
STEP_M = 0.12  # 2 l sin 30°


def stride_row(index: int, step_m: float, released: bool = True, flipper: int = 1) -> dict[str, Any]:
    """Return the row of a stride that begins at row 40 * index and closes on the first row of its swing."""
    first_s = 0.1 * ROWS * len(STROKES) * index
    return {
        "index": index,
        "flipper": flipper,
        "t_start_s": first_s,
        "stamp_s": first_s + 0.1 * ROWS * 3,
        "step_m": step_m,
        "released": released,
    }


def walk_of(strides: list[dict[str, Any]], direction: float = 1.0) -> RecordedWalk:
    """Each flipper sweeps from one side to the other in its stance."""
    phases = [phase for _ in strides for phase in STROKES for _ in range(ROWS)]
    unknown = np.full(len(phases), nan)
    sweeps_rad = direction * np.radians([30.0, *np.linspace(30.0, -30.0, ROWS), -30.0])
    return RecordedWalk(
        title="made up",
        geometry=FlipperGeometry(),
        flipper="right",
        time_s=np.arange(len(phases), dtype=np.float64) / 10.0,
        phase=np.array(phases, dtype=np.int64),
        sweep_angle_rad=np.tile(np.repeat(sweeps_rad, [ROWS, *[1] * ROWS, 2 * ROWS]), len(strides)),
        adduction_angle_rad=unknown,
        depth_m=unknown.copy(),
        depth_command_m=unknown,
        force_x_n=unknown,
        force_z_n=unknown,
        body_x_m=unknown,
        strides=strides,
        noticed_s=[],
    )


@pytest.mark.parametrize(
    ("step_m", "released", "direction", "outcome"),
    [
        (0.0601, True, 1.0, Outcome.GOOD),
        (0.0599, True, 1.0, Outcome.SLIPPING),
        (-0.0601, True, -1.0, Outcome.GOOD),
        (0.0601, True, -1.0, Outcome.SLIPPING),
        (0.0, True, 0.0, Outcome.UNKNOWN),
        (0.12, False, 1.0, Outcome.STUCK),
        (nan, False, 1.0, Outcome.STUCK),
        (nan, True, 1.0, Outcome.UNKNOWN),
    ],
)
def test_a_stride_fails_below_half_of_the_geometric_step_or_where_the_flipper_stays(
    step_m: float, released: bool, direction: float, outcome: Outcome
) -> None:
    """A flipper that sweeps forward walks backward; one that does not sweep probes."""
    walk = walk_of([stride_row(0, step_m, released)], direction)
    assert geometric_step_m(walk, walk.strides[0]) == pytest.approx(STEP_M * direction)
    assert outcome_of(walk, walk.strides[0]) is outcome


@pytest.mark.parametrize(("released", "outcome"), [(True, Outcome.UNKNOWN), (False, Outcome.STUCK)])
def test_on_a_fixed_base_no_stride_slips(released: bool, outcome: Outcome) -> None:
    walk = walk_of([stride_row(0, 0.0, released)])._replace(fixed_base=True)
    assert outcome_of(walk, walk.strides[0]) is outcome


def test_a_stride_of_both_flippers_is_stuck_if_either_was() -> None:
    walk = walk_of([stride_row(0, 0.11), stride_row(0, 0.11, False, flipper=0), stride_row(1, 0.11)])
    outcomes = [outcome_of(walk, stride) for stride in of_both_flippers(walk, walk.own_strides)]
    assert outcomes == [Outcome.STUCK, Outcome.GOOD]


def test_the_clearest_stride_of_each_outcome_is_chosen() -> None:
    steps = [(0.11, True), (0.05, True), (0.02, False), (0.01, True), (-0.03, False), (0.13, True)]
    walk = walk_of([stride_row(index, *step) for index, step in enumerate(steps)])
    assert [stride["index"] for stride in choose_strides(walk)] == [3, 4, 5]  # slipping, stuck, good


def test_a_stride_that_begins_stuck_is_chosen_only_where_there_is_no_other() -> None:
    walk = walk_of([stride_row(0, 0.03, False), stride_row(1, -0.03, False)])
    walk.depth_m[40] = 0.02
    assert [stride["index"] for stride in choose_strides(walk)] == [0]
    walk.depth_m[0] = 0.02
    assert [stride["index"] for stride in choose_strides(walk)] == [1]


def test_a_stride_lasts_until_the_next_insertion_and_its_moments_are_in_the_order_of_the_gait() -> None:
    walk = walk_of([stride_row(0, 0.11), stride_row(1, 0.11)])
    assert [rows_of(walk, stride) for stride in walk.strides] == [range(40), range(40, 80)]
    assert duration_s(walk, walk.strides[1]) == pytest.approx(3.9)
    moments = moments_of(walk, walk.strides[1])
    assert [moment.row for moment in moments] == [40, 49, 54, 59, 69, 74, 79]
    assert all(Phase(walk.phase[row]).name.lower() == caption.split()[0] for caption, row in moments)
