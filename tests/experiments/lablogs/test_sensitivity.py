"""Disturbed estimates are compared with the recorded ones of the same stride."""

from __future__ import annotations

from control.records import Estimate, StrideEstimate
from experiments.lablogs.lab_trial import Replays
from experiments.lablogs.sensitivity import Moves, Ratios, sensitivity
from tests.experiments.lablogs.synthetic_trials import INVALID, make_bound, make_stride, make_trial, make_value

RECORDED = (make_value(1.0), make_value(2.0), make_value(4.0), make_bound(3.0))


def strides(*k_s: Estimate) -> list[StrideEstimate]:
    return [make_stride(index=index, k_s=each) for index, each in enumerate(k_s)]


def test_ratios_and_moves_of_known_disturbances_are_recovered() -> None:
    replays = Replays(
        recorded=strides(*RECORDED),
        current_late=strides(make_value(0.9), make_value(2.0), make_value(4.8), make_value(3.0)),
        current_early=strides(make_value(1.1), INVALID, make_bound(4.0), make_bound(3.0)),
        rows_missing=[
            strides(make_value(1.19), make_value(2.21), make_value(4.0), INVALID),
            strides(make_value(1.0), make_value(2.0), INVALID, INVALID),
        ],
    )
    found = sensitivity([make_trial(replays.recorded, replays=replays)], "default")
    assert found.current_late["k_s"] == Ratios(1.0, 0.9, 1.2, n=3, lost=0)
    assert found.current_early["k_s"] == Ratios(1.1, 1.1, 1.1, n=1, lost=2)
    assert found.rows_missing["k_s"] == Moves(0.2, n=5, lost=1)  # 2.21 is beyond two errors
    assert found.current_late["k_p"] == Ratios(None, None, None, n=0, lost=0)


def test_a_stride_that_a_disturbance_loses_shifts_no_other() -> None:
    recorded = strides(*RECORDED[:3])
    replays = Replays(recorded, current_late=recorded[1:], current_early=recorded, rows_missing=[recorded])
    found = sensitivity([make_trial(recorded, replays=replays)], "default")
    assert found.current_late["k_s"] == Ratios(1.0, 1.0, 1.0, n=2, lost=1)
