"""The report of the walks over several muds: coefficients by mud and method, errors, and the paper's findings.

The paper prints no coefficients of these walks. Its text says that k_s was underestimated where the body moves; that in
the soft mud it was half of the load cell's at 5 cm, close to it at 3 cm, and better at 5 cm with the body's drag added;
and that this drag was about 2.5 N. The fields of these records are the keys of the summary in JSON.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from statistics import fmean, median
from typing import Any

import numpy as np

from control.records import Phase
from estimation.mud import PAPER_DRAG_N
from experiments.reports.coefficient_table import (
    ComparedStride,
    GatheredCoefficient,
    MudSummary,
    error_table,
    gather_coefficient,
    gather_coefficients,
)
from experiments.reports.error_table import COEFFICIENTS, Row
from experiments.reports.mud_names import mud_text
from experiments.study.notebook import Entry
from experiments.trackway.bench import reach_of
from experiments.trials.estimation_methods import configured_method
from experiments.trials.stride_profile import profile_from_row
from experiments.trials.truth_file import TruthOfMud, missing_text, truth_in
from experiments.walk.known_surface import KNOWN, KNOWN_COMPENSATED
from experiments.walk.measurement import SOFT_DEPTHS_M, WalkTrials, soft_key, soft_name
from firmware_host.configuration.configuration import Configuration

StrideReport = Mapping[str, Any]  # as the daemon reports it


@dataclass(frozen=True)
class SoftDepth:
    """The walks at one depth in a soft mud."""

    depth_cm: float
    k_s: Mapping[str, GatheredCoefficient]  # by method
    truth: float | None  # the load cell's k_s
    thrust_n: float | None  # of both flippers


@dataclass(frozen=True)
class SoftMud:
    mud: str
    depths: Sequence[SoftDepth]


@dataclass(frozen=True)
class PaperFinding:
    what: str
    paper: str
    ours: float | None


@dataclass(frozen=True, kw_only=True)
class WalkReport:
    experiment: str = "walk"
    muds: Sequence[MudSummary]
    soft: Sequence[SoftMud]
    errors: Sequence[Row]
    findings: Sequence[PaperFinding] = field(metadata={"key": "beside_paper"})
    without_pose: int  # walks
    at_a_border: int  # strides that belong to no mud
    remarks: Sequence[str]
    missing_truth: str
    settings: Mapping[str, Any]
    left_out: Mapping[str, Entry]


def walks_of(plan: WalkTrials, entries: Mapping[str, Entry]) -> list[Entry]:
    return [entries[trial.key] for trial in plan.planned if trial.key in entries and trial.key.startswith("walk/")]


def soft_walks_of(plan: WalkTrials, entries: Mapping[str, Entry], mud: str, depth_m: float) -> list[Entry]:
    keys = [soft_key(mud, depth_m, number) for number in range(1, plan.trials + 1)]
    return [entries[key] for key in keys if key in entries]


def located_strides(
    plan: WalkTrials, entries: Mapping[str, Entry], configuration: Configuration, truth: TruthOfMud | None
) -> list[ComparedStride]:
    """Locate the strides of the walks over all muds. `truth` of another experiment replaces the bed's own."""
    return [
        located
        for walk in walks_of(plan, entries)
        for method, strides in walk["strides"].items()
        for located in _locate(plan, walk, method, strides, reach_of(configuration), truth)
    ]


def _locate(
    plan: WalkTrials,
    walk: Entry,
    method: str,
    strides: Sequence[StrideReport],
    reach_m: float,
    truth: TruthOfMud | None,
) -> Iterator[ComparedStride]:
    for number, stride in enumerate(strides):
        position_m, start_m = stride["place_m"], walk["start_m"]
        if position_m is None or start_m is None:
            plates_m = plan.length_m * (number + 0.5) / len(strides)
        else:
            plates_m = position_m - start_m + reach_m
        mud = plan.mud_at(plates_m, stride.get("slip_m", 0.0))
        compared = _truth_of(mud, walk, stride, truth)
        yield ComparedStride(mud, method, stride, compared, trial=walk["trial"], plates_m=plates_m)


def soft_strides(plan: WalkTrials, entries: Mapping[str, Entry], truth: TruthOfMud | None) -> list[ComparedStride]:
    """Return the strides in soft muds, without the first of each walk, which starts from a standing body."""
    return [
        ComparedStride(soft_name(mud, depth_m), method, stride, _truth_of(mud, walk, stride, truth))
        for mud in plan.soft
        for depth_m in SOFT_DEPTHS_M
        for walk in soft_walks_of(plan, entries, mud, depth_m)
        for method, strides in walk["strides"].items()
        for stride in strides[1:]
    ]


def _truth_of(mud: str, walk: Entry, stride: StrideReport, truth: TruthOfMud | None) -> Mapping[str, float | None]:
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
) -> WalkReport:
    method = configured_method(configuration.estimation)
    located = located_strides(plan, entries, configuration, truth)
    certain = [each for each in located if each.mud]
    soft = soft_strides(plan, entries, truth)
    return WalkReport(
        muds=[_mud_report(mud.name, method, certain) for mud in plan.muds],
        soft=[SoftMud(mud, _soft_depths(plan, entries, mud, soft)) for mud in plan.soft],
        errors=error_table([*certain, *soft], "walking"),
        findings=_findings(plan, entries, certain, soft),
        without_pose=sum(walk["start_m"] is None for walk in walks_of(plan, entries)),
        at_a_border=sum(not each.mud for each in located if each.method == method),
        remarks=[f"{key}: {remark}" for key, entry in entries.items() for remark in entry["remarks"]],
        missing_truth=missing_text(truth, dict.fromkeys([*(mud.name for mud in plan.muds), *plan.soft])),
        settings=plan.identity | {"method": method, "truth": "file" if truth else "bed"},
        left_out=left_out or {},
    )


def _mud_report(mud: str, method: str, rows: Sequence[ComparedStride]) -> MudSummary:
    own = [row for row in rows if (row.mud, row.method) == (mud, method)]
    return MudSummary(mud=mud, **gather_coefficients([row.stride for row in own]), truth=median_truth(own) or None)


def median_truth(rows: Sequence[ComparedStride]) -> dict[str, float]:
    """Return the median of the load cell's readings by coefficient."""
    values = {name: [value for row in rows if (value := row.truth.get(name)) is not None] for name in COEFFICIENTS}
    return {name: median(each) for name, each in values.items() if each}


def _soft_depths(
    plan: WalkTrials, entries: Mapping[str, Entry], mud: str, strides: Sequence[ComparedStride]
) -> list[SoftDepth]:
    """Gather k_s by depth and method, with the load cell's."""
    return [
        SoftDepth(
            depth_cm=100.0 * depth_m,
            k_s={
                method: gather_coefficient(row.stride["k_s"] for row in own if row.method == method)
                for method in dict.fromkeys(row.method for row in own)
            },
            truth=median_truth(own).get("k_s"),
            thrust_n=_thrust_n(soft_walks_of(plan, entries, mud, depth_m)),
        )
        for depth_m in SOFT_DEPTHS_M
        if (own := [row for row in strides if row.mud == soft_name(mud, depth_m)])
    ]


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
    plan: WalkTrials, entries: Mapping[str, Entry], certain: Sequence[ComparedStride], soft: Sequence[ComparedStride]
) -> list[PaperFinding]:
    """Pair each finding in the paper's text with ours, by its law with a known surface."""
    rows = [
        PaperFinding(f"k_s over the load cell's, {mud_text(mud.name)}", "well below 1", _ratio(certain, mud.name))
        for mud in plan.muds
    ]
    return rows + [row for mud in plan.soft for row in _soft_findings(plan, entries, mud, soft)]


def _soft_findings(
    plan: WalkTrials, entries: Mapping[str, Entry], mud: str, soft: Sequence[ComparedStride]
) -> list[PaperFinding]:
    """The paper's load cell measured at 3 cm."""
    at_3, at_5 = (soft_name(mud, depth_m) for depth_m in SOFT_DEPTHS_M)
    text_3, text_5 = mud_text(at_3), mud_text(at_5)
    cell = median_truth([row for row in soft if row.mud == at_3]).get("k_s")
    with_drag = _ratio(soft, at_5, KNOWN_COMPENSATED, cell)
    thrust_n = _thrust_n(soft_walks_of(plan, entries, mud, SOFT_DEPTHS_M[1]))
    return [
        PaperFinding(f"k_s over the load cell's at 3 cm, {text_3}", "close to 1", _ratio(soft, at_3, cell=cell)),
        PaperFinding(f"k_s over the load cell's at 3 cm, {text_5}", "0.5", _ratio(soft, at_5, cell=cell)),
        PaperFinding(f"k_s over the load cell's at 3 cm, {text_5}, with drag", "better", with_drag),
        PaperFinding(f"k_s over the load cell's at 5 cm, {text_5}", "-", _ratio(soft, at_5)),
        PaperFinding(f"thrust of both flippers in stance, {text_5} (N)", f"{PAPER_DRAG_N:g}", thrust_n),
    ]


def _ratio(rows: Sequence[ComparedStride], mud: str, method: str = KNOWN, cell: float | None = None) -> float | None:
    """Return the median of k_s over the load cell's reading of the same stride, or over `cell`."""
    own = [row for row in rows if (row.mud, row.method) == (mud, method) and row.stride["k_s"]["valid"]]
    ratios = [row.stride["k_s"]["value"] / truth for row in own if (truth := cell or row.truth.get("k_s"))]
    return median(ratios) if ratios else None
