"""Synthetic trials with given estimates and errors."""

from __future__ import annotations

from collections.abc import Sequence

from control.records import UNKNOWN, Estimate, StrideEstimate
from experiments.lablogs.lab_trial import METHODS, LabTrial, Replays

INVALID = Estimate(UNKNOWN, UNKNOWN, 3, False, "too few samples")


def make_value(value: float, std_error: float = 0.1) -> Estimate:
    return Estimate(value, std_error, 20, True)


def make_bound(value: float, std_error: float = 0.1) -> Estimate:
    return Estimate(value, std_error, 20, True, "the mud did not yield", True)


def make_stride(
    flipper: str = "right",
    index: int = 0,
    *,
    k_p: Estimate = INVALID,
    k_s: Estimate = INVALID,
    k_e: Estimate = INVALID,
) -> StrideEstimate:
    """Return a stride of four seconds; both flippers begin the same stride with the same sample."""
    return StrideEstimate(
        flipper, index, 4.0 * index, 4.0 * index + 4.0, 1.0, 1.0, 1.0, k_p, k_s, k_e,
        0.0, 0.03, True, 2.0, 8.0, -2.0, UNKNOWN,
    )  # fmt: skip


def make_trial(
    strides: Sequence[StrideEstimate],
    name: str = "single_12N_trial1.csv.gz",
    *,
    flippers: tuple[str, ...] = ("right",),
    in_mud: bool = True,
    replays: Replays | None = None,
) -> LabTrial:
    """Return a trial with the same strides by every method; a single flipper is on a fixed base."""
    same = Replays(strides) if replays is None else replays
    return LabTrial(name, flippers, len(flippers) == 1, in_mud, {method: same for method in METHODS})


def make_walk(pairs: Sequence[tuple[Estimate, Estimate]], name: str = "walk_30N_trial1.csv.gz") -> LabTrial:
    """Return a walk with k_s by the left and the right flipper in each stride."""
    strides = [
        make_stride(flipper, index, k_s=k_s)
        for index, pair in enumerate(pairs)
        for flipper, k_s in zip(("left", "right"), pair, strict=True)
    ]
    return make_trial(strides, name, flippers=("left", "right"))
