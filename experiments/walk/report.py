"""The report of the walks over several muds: coefficients by mud and method, errors, and the paper's findings.

The paper prints no coefficients of these walks. Its text says that k_s was underestimated where the body moves; that in
the soft mud it was half of the load cell's at 5 cm, close to it at 3 cm, and better at 5 cm with the body's drag added;
and that this drag was about 2.5 N.
"""

from collections.abc import Mapping, Sequence
from math import isfinite
from statistics import fmean, median
from typing import Any

import numpy as np
import pandas
from pandas import DataFrame

from control.records import Phase
from estimation.mud import PAPER_DRAG_N
from experiments.reports.coefficient_table import (
    average_truth,
    compared_frame,
    compared_rows,
    error_table,
    gather_rows,
    mud_summaries,
)
from experiments.reports.mud_names import mud_text
from experiments.study.notebook import Entry
from experiments.trackway.bench import reach_of
from experiments.trials.estimation_methods import configured_method
from experiments.trials.stride_profile import profile_from_row
from experiments.trials.truth_file import TruthOfMud, truth_in, truth_settings
from experiments.walk.known_surface import KNOWN, KNOWN_COMPENSATED
from experiments.walk.measurement import SOFT_DEPTHS_M, WalkTrials, soft_key, soft_name
from firmware_host.configuration.configuration import Configuration

Report = dict[str, Any]  # the summary, as it is in JSON


def walks_of(plan: WalkTrials, entries: Mapping[str, Entry]) -> list[Entry]:
    return [entries[trial.key] for trial in plan.planned if trial.key in entries and trial.key.startswith("walk/")]


def soft_walks_of(plan: WalkTrials, entries: Mapping[str, Entry], mud: str, depth_m: float) -> list[Entry]:
    keys = [soft_key(mud, depth_m, number) for number in range(1, plan.trials + 1)]
    return [entries[key] for key in keys if key in entries]


def located_strides(
    plan: WalkTrials, entries: Mapping[str, Entry], configuration: Configuration, truth: TruthOfMud | None
) -> DataFrame:
    """Return the strides of the walks over all muds, each in its mud.

    `truth` of another experiment replaces the bed's.
    """
    rows = []
    for walk in walks_of(plan, entries):
        for method, strides in walk["strides"].items():
            for number, stride in enumerate(strides):
                position_m, start_m = stride["place_m"], walk["start_m"]
                if position_m is None or start_m is None:
                    plates_m = plan.length_m * (number + 0.5) / len(strides)
                else:
                    plates_m = position_m - start_m + reach_of(configuration)
                mud = plan.mud_at(plates_m, stride.get("slip_m", 0.0))
                known = _truth_of(mud, walk, stride, truth)
                keys = {"mud": mud, "method": method, "trial": walk["trial"], "plates_m": plates_m}
                rows += compared_rows(stride, known, **keys)
    return compared_frame(rows)


def soft_strides(plan: WalkTrials, entries: Mapping[str, Entry], truth: TruthOfMud | None) -> DataFrame:
    """Return the strides in soft muds, without the first of each walk, which starts from a standing body."""
    return compared_frame(
        row
        for mud in plan.soft
        for depth_m in SOFT_DEPTHS_M
        for walk in soft_walks_of(plan, entries, mud, depth_m)
        for method, strides in walk["strides"].items()
        for stride in strides[1:]
        for row in compared_rows(
            stride, _truth_of(mud, walk, stride, truth), mud=soft_name(mud, depth_m), method=method
        )
    )


def _truth_of(mud: str, walk: Entry, stride: Mapping[str, Any], truth: TruthOfMud | None) -> Mapping[str, float | None]:
    if truth:
        return truth_in(truth, mud)
    own: Mapping[str, float | None] = walk["truths"].get(str(stride["index"]), {})
    return own


def report_of(
    plan: WalkTrials,
    entries: Mapping[str, Entry],
    configuration: Configuration,
    truth: TruthOfMud | None,
    left_out: Mapping[str, Entry] | None = None,
) -> Report:
    method = configured_method(configuration.estimation)
    located, soft = located_strides(plan, entries, configuration, truth), soft_strides(plan, entries, truth)
    certain = located[located["mud"] != ""]
    uncertain = located[(located["mud"] == "") & (located["method"] == method)]
    muds = [mud.name for mud in plan.muds]
    return {
        "experiment": "walk",
        "muds": mud_summaries(certain, muds, method, median),
        "soft": [{"mud": mud, "depths": _soft_depths(plan, entries, mud, soft)} for mud in plan.soft],
        "errors": error_table(pandas.concat([certain, soft]), "walking"),
        "beside_paper": _findings(plan, entries, certain, soft),
        "without_pose": sum(walk["start_m"] is None for walk in walks_of(plan, entries)),
        "at_a_border": len(_k_s_of(uncertain)),  # strides that belong to no mud
        "remarks": [f"{key}: {remark}" for key, entry in entries.items() for remark in entry["remarks"]],
        "left_out": left_out or {},
    } | truth_settings(plan.identity, method, truth, dict.fromkeys([*muds, *plan.soft]))


def _soft_depths(plan: WalkTrials, entries: Mapping[str, Entry], mud: str, strides: DataFrame) -> list[dict[str, Any]]:
    """Gather k_s by depth and method, with the load cell's."""
    depths = {depth_m: strides[strides["mud"] == soft_name(mud, depth_m)] for depth_m in SOFT_DEPTHS_M}
    return [
        {
            "depth_cm": 100.0 * depth_m,
            "k_s": {method: gather_rows(k_s) for method, k_s in _k_s_of(own).groupby("method", sort=False)},
            "truth": average_truth(own, median).get("k_s"),
            "thrust_n": _thrust_n(soft_walks_of(plan, entries, mud, depth_m)),  # of both flippers
        }
        for depth_m, own in depths.items()
        if len(own)
    ]


def _k_s_of(strides: DataFrame) -> DataFrame:
    return strides[strides["coefficient"] == "k_s"]


def _thrust_n(walks: Sequence[Entry]) -> float | None:
    """Average the thrust of both flippers over the second half of the drawn stances.

    While the body moves, the thrust equals the drag on the body.
    """
    means_n = []
    for walk in walks:
        profile = profile_from_row(walk["course"])
        force_n = profile.force_x_n[profile.during(Phase.STANCE)]
        means_n.append(2.0 * float(np.nanmean(force_n[len(force_n) // 2 :])) if np.isfinite(force_n).any() else np.nan)
    known = [mean_n for mean_n in means_n if isfinite(mean_n)]
    return fmean(known) if known else None


def _findings(
    plan: WalkTrials, entries: Mapping[str, Entry], certain: DataFrame, soft: DataFrame
) -> list[dict[str, Any]]:
    """Pair each finding in the paper's text with ours, by its law with a known surface."""
    over = "k_s over the load cell's"
    rows: list[tuple[str, str, float | None]] = [
        (f"{over}, {mud_text(mud.name)}", "well below 1", _ratio(certain, mud.name)) for mud in plan.muds
    ]
    for mud in plan.soft:
        at_3, at_5 = (soft_name(mud, depth_m) for depth_m in SOFT_DEPTHS_M)
        text_3, text_5 = mud_text(at_3), mud_text(at_5)
        cell = average_truth(soft[soft["mud"] == at_3], median).get("k_s")  # the paper's load cell measured at 3 cm
        thrust_n = _thrust_n(soft_walks_of(plan, entries, mud, SOFT_DEPTHS_M[1]))
        rows += [
            (f"{over} at 3 cm, {text_3}", "close to 1", _ratio(soft, at_3, cell=cell)),
            (f"{over} at 3 cm, {text_5}", "0.5", _ratio(soft, at_5, cell=cell)),
            (f"{over} at 3 cm, {text_5}, with drag", "better", _ratio(soft, at_5, KNOWN_COMPENSATED, cell)),
            (f"{over} at 5 cm, {text_5}", "-", _ratio(soft, at_5)),
            (f"thrust of both flippers in stance, {text_5} (N)", f"{PAPER_DRAG_N:g}", thrust_n),
        ]
    return [{"what": what, "paper": paper, "ours": ours} for what, paper, ours in rows]


def _ratio(strides: DataFrame, mud: str, method: str = KNOWN, cell: float | None = None) -> float | None:
    """Return the median of k_s over the load cell's reading of the same stride, or over `cell`."""
    own = _k_s_of(strides[(strides["mud"] == mud) & (strides["method"] == method) & strides["valid"].astype(bool)])
    ratios = (own["value"] / (cell or own["truth"])).dropna()
    return float(ratios.median()) if len(ratios) else None
