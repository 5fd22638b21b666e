"""What the walks over several muds say: coefficients by mud and method, their errors, and the paper's findings beside.

The paper prints no coefficients of these walks. It tells in words that k_s was underestimated where the body moves,
that it was half of the load cell's at 5 cm in the soft mud, close to it at 3 cm, and better at 5 cm with the body's
drag added; and that this drag was about 2.5 N.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from statistics import fmean, median
from typing import Any, NamedTuple

import numpy as np

from control.records import Phase
from estimation.mud import PAPER_DRAG_N
from experiments.reports.coefficient_table import (
    ComparedStride,
    MudSummary,
    error_table,
    gather_coefficient,
    gather_coefficients,
)
from experiments.reports.error_table import COEFFICIENTS
from experiments.reports.mud_names import mud_text
from experiments.trackway.bench import reach_of
from experiments.trials.estimation_methods import configured_method
from experiments.trials.notebook import Entry
from experiments.trials.stride_profile import profile_from_row
from experiments.trials.truth_file import TruthOfMud, missing_text, truth_in
from experiments.walk.known_surface import KNOWN, KNOWN_COMPENSATED
from experiments.walk.measurement import SOFT_DEPTHS_M, Plan, soft_key, soft_name
from firmware_host.configuration.configuration import Configuration

Reported = Mapping[str, Any]


class PlacedStride(NamedTuple):
    """One stride of one walk, by one method."""

    trial: int
    method: str
    mud: str  # empty where it is not certain
    plates_m: float  # from the start of the first mud
    stride: Reported
    truth: Mapping[str, float | None]


def walks_of(plan: Plan, entries: Mapping[str, Entry]) -> list[Entry]:
    return [entries[trial.key] for trial in plan.planned if trial.key in entries and trial.key.startswith("walk/")]


def soft_walks_of(plan: Plan, entries: Mapping[str, Entry], mud: str, depth_m: float) -> list[Entry]:
    keys = [soft_key(mud, depth_m, number) for number in range(1, plan.trials + 1)]
    return [entries[key] for key in keys if key in entries]


def placed_strides(
    plan: Plan, entries: Mapping[str, Entry], configuration: Configuration, truth: TruthOfMud | None
) -> list[PlacedStride]:
    """Of the walks over all muds. `truth`: another experiment's, in place of the bed's own."""
    return [
        placed
        for walk in walks_of(plan, entries)
        for method, strides in walk["strides"].items()
        for placed in _placed(plan, walk, method, strides, reach_of(configuration), truth)
    ]


def _placed(
    plan: Plan, walk: Entry, method: str, strides: Sequence[Reported], reach_m: float, truth: TruthOfMud | None
) -> Iterator[PlacedStride]:
    for number, stride in enumerate(strides):
        position_m, start_m = stride["place_m"], walk["start_m"]
        if position_m is None or start_m is None:
            plates_m = plan.length_m * (number + 0.5) / len(strides)
        else:
            plates_m = position_m - start_m + reach_m
        mud = plan.mud_at(plates_m, stride.get("slip_m", 0.0))
        reported = truth_in(truth, mud) if truth else walk["truths"].get(str(stride["index"]), {})
        yield PlacedStride(walk["trial"], method, mud, plates_m, stride, reported)


def soft_strides(plan: Plan, entries: Mapping[str, Entry], truth: TruthOfMud | None) -> list[ComparedStride]:
    """Of all walks in soft muds. The first stride of each starts from a standing body and is left out."""
    return [
        ComparedStride(soft_name(mud, depth_m), method, stride, _soft_truth(mud, walk, stride, truth))
        for mud in plan.soft
        for depth_m in SOFT_DEPTHS_M
        for walk in soft_walks_of(plan, entries, mud, depth_m)
        for method, strides in walk["strides"].items()
        for stride in strides[1:]
    ]


def _soft_truth(mud: str, walk: Entry, stride: Reported, truth: TruthOfMud | None) -> Mapping[str, float | None]:
    if truth:
        return truth_in(truth, mud)
    reported: Mapping[str, float | None] = walk["truths"].get(str(stride["index"]), {})
    return reported


def report_of(
    plan: Plan, entries: Mapping[str, Entry], configuration: Configuration, truth: TruthOfMud | None
) -> dict[str, Any]:
    method = configured_method(configuration.estimation)
    placed = placed_strides(plan, entries, configuration, truth)
    certain = [ComparedStride(each.mud, each.method, each.stride, each.truth) for each in placed if each.mud]
    soft = soft_strides(plan, entries, truth)
    return {
        "experiment": "walk",
        "muds": [_mud_report(mud.name, method, certain) for mud in plan.muds],
        "soft": [{"mud": mud, "depths": _soft_report(plan, entries, mud, soft)} for mud in plan.soft],
        "errors": error_table([*certain, *soft], "walking"),
        "beside_paper": _beside_paper(plan, entries, certain, soft),
        "without_pose": sum(walk["start_m"] is None for walk in walks_of(plan, entries)),
        "at_a_border": sum(not each.mud for each in placed if each.method == method),
        "remarks": [f"{key}: {remark}" for key, entry in entries.items() for remark in entry["remarks"]],
        "missing_truth": missing_text(truth, dict.fromkeys([*(mud.name for mud in plan.muds), *plan.soft])),
        "settings": plan.kept | {"method": method, "truth": "file" if truth else "bed"},
    }


def _mud_report(mud: str, method: str, rows: Sequence[ComparedStride]) -> MudSummary:
    own = [row for row in rows if (row.mud, row.method) == (mud, method)]
    return MudSummary(
        mud=mud,
        **gather_coefficients([row.stride for row in own]),
        truth=truth_over(own) or None,
    )


def truth_over(rows: Sequence[ComparedStride]) -> dict[str, float]:
    """The middle one of the load cell's readings."""
    reported = {name: [row.truth.get(name) for row in rows] for name in COEFFICIENTS}
    values = {name: [value for value in each if value is not None] for name, each in reported.items()}
    return {name: median(each) for name, each in values.items() if each}


def _soft_report(
    plan: Plan, entries: Mapping[str, Entry], mud: str, strides: Sequence[ComparedStride]
) -> list[dict[str, Any]]:
    """k_s by depth and method, beside the load cell's."""
    return [
        {
            "depth_cm": 100.0 * depth_m,
            "k_s": {
                method: gather_coefficient(row.stride["k_s"] for row in own if row.method == method)
                for method in dict.fromkeys(row.method for row in own)
            },
            "truth": truth_over(own).get("k_s"),
            "thrust_n": _thrust_n(soft_walks_of(plan, entries, mud, depth_m)),
        }
        for depth_m in SOFT_DEPTHS_M
        if (own := [row for row in strides if row.mud == soft_name(mud, depth_m)])
    ]


def _thrust_n(walks: Sequence[Entry]) -> float | None:
    """Of both flippers, over the second half of the stances shown: while the body moves it is the body's drag."""
    means_n = []
    for walk in walks:
        profile = profile_from_row(walk["course"])
        force_n = profile.force_x_n[profile.during(Phase.STANCE)]
        means_n.append(2.0 * float(np.nanmean(force_n[len(force_n) // 2 :])) if np.isfinite(force_n).any() else np.nan)
    known = [mean_n for mean_n in means_n if isfinite(mean_n)]
    return fmean(known) if known else None


def _beside_paper(
    plan: Plan, entries: Mapping[str, Entry], certain: Sequence[ComparedStride], soft: Sequence[ComparedStride]
) -> list[dict[str, Any]]:
    """What the paper tells in words or numbers, and ours by its law with the surface known."""
    rows = [
        _finding(f"k_s over the load cell's, {mud_text(mud.name)}", "well below 1", _ratio(certain, mud.name))
        for mud in plan.muds
    ]
    return rows + [row for mud in plan.soft for row in _soft_beside_paper(plan, entries, mud, soft)]


def _soft_beside_paper(
    plan: Plan, entries: Mapping[str, Entry], mud: str, soft: Sequence[ComparedStride]
) -> list[dict[str, Any]]:
    """The paper's load cell measured at 3 cm."""
    at_3, at_5 = (soft_name(mud, depth_m) for depth_m in SOFT_DEPTHS_M)
    reported_3, reported_5 = mud_text(at_3), mud_text(at_5)
    cell = truth_over([row for row in soft if row.mud == at_3]).get("k_s")
    added = _ratio(soft, at_5, KNOWN_COMPENSATED, cell)
    thrust_n = _thrust_n(soft_walks_of(plan, entries, mud, SOFT_DEPTHS_M[1]))
    return [
        _finding(f"k_s over the load cell's at 3 cm, {reported_3}", "close to 1", _ratio(soft, at_3, cell=cell)),
        _finding(f"k_s over the load cell's at 3 cm, {reported_5}", "0.5", _ratio(soft, at_5, cell=cell)),
        _finding(f"k_s over the load cell's at 3 cm, {reported_5}, with drag", "better", added),
        _finding(f"k_s over the load cell's at 5 cm, {reported_5}", "-", _ratio(soft, at_5)),
        _finding(f"thrust of both flippers in stance, {reported_5} (N)", f"{PAPER_DRAG_N:g}", thrust_n),
    ]


def _finding(what: str, paper: str, ours: float | None) -> dict[str, Any]:
    return {"what": what, "paper": paper, "ours": ours}


def _ratio(rows: Sequence[ComparedStride], mud: str, method: str = KNOWN, cell: float | None = None) -> float | None:
    """Median of k_s over what the load cell reads there, or over `cell`."""
    own = [row for row in rows if (row.mud, row.method) == (mud, method) and row.stride["k_s"]["valid"]]
    ratios = [row.stride["k_s"]["value"] / truth for row in own if (truth := cell or row.truth.get("k_s"))]
    return median(ratios) if ratios else None
