"""The report of the walks over several muds: coefficients by mud and method, errors, and the paper's findings.

The paper prints no coefficients of these walks. Its text says that k_s was underestimated where the body moves; that in
the soft mud it was half of the load cell's at 5 cm, close to it at 3 cm, and better at 5 cm with the body's drag added;
and that this drag was about 2.5 N.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from statistics import fmean, median
from typing import Any

import numpy as np
from pandas import DataFrame

from control.records import Phase
from estimation.mud import PAPER_DRAG_N
from experiments.reports.coefficient_table import (
    average_truth,
    compared_frame,
    compared_rows,
    error_table,
    gather_coefficient,
    mud_summaries,
)
from experiments.reports.counted_nouns import counted
from experiments.reports.error_table import Row
from experiments.reports.mud_names import mud_text
from experiments.reports.mud_styles import file_name
from experiments.reports.text_tables import number
from experiments.study.notebook import Entry
from experiments.study.result import Figure, Result, Table
from experiments.trackway.bench import reach_of
from experiments.trials.coefficient_page import (
    COMPARISON,
    TRUTHS,
    coefficient_tables,
    error_paragraphs,
    remark_texts,
    truth_settings,
)
from experiments.trials.estimation_methods import configured_method
from experiments.trials.mud_trials import MeasuredTrials
from experiments.trials.stride_profile import profile_from, stroke_of
from experiments.trials.truth_file import TruthOfMud, truth_in
from experiments.walk.known_surface import KNOWN, KNOWN_COMPENSATED
from experiments.walk.measurement import SOFT_DEPTHS_M, WalkTrials, soft_name
from experiments.walk.plots import draw_soft, draw_walk_over
from firmware_host.configuration.configuration import Configuration

TRACK = "Coefficients along the track"
SIMULATED_DRAG = (
    "The drag on the simulated body grows with speed, to more than twice the paper's 2.5 N. So the mud that yields at "
    "3 cm and does not yield at 5 cm is firmer here than the paper's. Part of the difference between these depths is "
    "the mud's, whose coefficients fall with depth: at 5 cm the load cell reads 0.6 of the k_s and 0.75 of the k_p "
    "that it reads at 3 cm. So each stride is compared with a load cell at its own depth."
)
TRIALS = (
    "The trials here are the strides of all walks. A mud in which more strides give a lower bound than a value has a "
    "bound as well, the median of all strides: the few strides that slip in such a mud met less resistance or pushed "
    "harder than is known, and give too low a value (by 12 % in simulated mud)."
)
DRAG_NOT_STRENGTH = (
    "Where the mud withstands more than the drag on the body, the flipper measures that drag and not the strength of "
    "the mud."
)
METHODS = (
    "The brackets also hold how many strides gave a bound (≥) or nothing. default: the daemon's own method. paper: the "
    "published method, which finds the surface where f_z passes 0.5 N; compensated: with half of the body's drag added "
    "while the body advances. paper's law: the published law of shear below the surface that the default method finds, "
    "and the same with that drag."
)
FIGURE_6 = (
    "Figure 6 of the paper, trial {}. A: position of the body; at a vertical line the plates first go down past a "
    "border. B, C: forces of the {} flipper. D to F: coefficients by stride; bars are two standard errors, arrows "
    "lower bounds, grey dashes the load cell. Values beyond the picture are drawn at its edge."
)
FIGURE_7 = (
    "Figure 7 of the paper. A: forward force in one stance. B: k_s by method, mean and standard deviation over "
    "strides; hatched: a lower bound, with the median. The paper's law is used with the default method's surface, "
    "because its own trigger at 0.5 N finds the surface of soft mud too deep."
)
FINDINGS = "The paper's findings, and ours by its law below the default method's surface"
Report = dict[str, Any]  # the summary, as it is in JSON
Walks = dict[str, list[Entry]]  # by group


def result_of(plan: WalkTrials, measured: MeasuredTrials, truth: TruthOfMud | None) -> Result:
    """Report the walks that count. `truth` of another experiment replaces the bed's."""
    configuration, walks = measured.configuration, walks_of(plan, measured.entries)
    strides = compared_strides(plan, walks, reach_of(configuration), truth)
    report = _report_of(plan, walks, strides, configured_method(configuration.estimation))
    report["remarks"] = [f"{key}: {remark}" for key, entry in measured.entries.items() for remark in entry["remarks"]]
    report["left_out"] = measured.left_out
    report |= truth_settings(plan.identity, configuration, truth, dict.fromkeys([*dict(plan.muds), *plan.soft]))
    findings = DataFrame(report["beside_paper"]).rename(columns={"what": ""})
    findings["ours"] = [number(ours, 2) for ours in findings["ours"]]
    drag = f"{DRAG_NOT_STRENGTH} {SIMULATED_DRAG}" if plan.simulated else DRAG_NOT_STRENGTH
    sections = [_soft_section(soft) for soft in report["soft"] if soft["depths"]]
    texts = {
        TRACK: _explanation(report, configuration),
        **dict.fromkeys(sections, "") | dict.fromkeys(sections[:1], drag),  # the first one explains all of them
        COMPARISON: METHODS if report["errors"] else "",
    }
    return Result(
        tables=[*coefficient_tables(report, TRACK), Table("findings", FINDINGS, {}, findings, "Findings")],
        figures=list(_figures(plan, walks, strides, report["soft"], reach_of(configuration))),
        summary=report,
        title="The walking robot over several muds",
        texts=texts | remark_texts(report["remarks"], measured.left_out),
        logs=measured.logs,
    )


def walks_of(plan: WalkTrials, entries: Mapping[str, Entry]) -> Walks:
    """Return the planned walks that count by their group."""
    walks: Walks = {trial.group: [] for trial in plan.planned}
    for trial in plan.planned:
        walks[trial.group] += [entries[trial.key]] if trial.key in entries else []
    return walks


def compared_strides(plan: WalkTrials, walks: Walks, reach_m: float, truth: TruthOfMud | None) -> DataFrame:
    """Return the strides of the walks over all muds, each in its mud, and those in soft muds, named with the depth.

    The first stride of a walk in soft mud starts from a standing body and is left out; it has no `plates_m`.
    """
    rows, layout, soft = list[Row](), plan.layout, {name: mud for name, mud, _ in plan.soft_walks}
    for group, walk in ((group, walk) for group, own in walks.items() for walk in own):
        for method, strides in walk["strides"].items():
            for index, stride in enumerate(strides):
                keys: Row = {"mud": group, "method": method, "trial": walk["trial"]}
                mud = soft.get(group)
                if mud is None:
                    plates_m = layout.ends_m[-1] * (index + 0.5) / len(strides)
                    if stride["place_m"] is not None and walk["start_m"] is not None:
                        plates_m = stride["place_m"] - walk["start_m"] + reach_m
                    mud = layout.mud_at(plates_m, stride.get("slip_m", 0.0))
                    keys |= {"mud": mud, "plates_m": plates_m}
                elif index == 0:
                    continue
                known = truth_in(truth, mud) if truth else walk["truths"].get(str(stride["index"]), {})
                rows += compared_rows(stride, known, **keys)
    return compared_frame(rows)


def _report_of(plan: WalkTrials, walks: Walks, strides: DataFrame, method: str) -> Report:
    certain = strides[strides["mud"] != ""]
    uncertain = strides[(strides["mud"] == "") & (strides["method"] == method)]
    return {
        "experiment": "walk",
        "muds": mud_summaries(certain, dict(plan.muds), method, median),
        "soft": [{"mud": mud, "depths": _soft_depths(plan, walks, mud, certain)} for mud in plan.soft],
        "errors": error_table(certain, "walking"),
        "beside_paper": _findings(plan, walks, certain),
        "without_pose": sum(walk["start_m"] is None for walk in walks[plan.over]),
        "at_a_border": len(_k_s_of(uncertain)),  # strides that belong to no mud
    }


def _soft_depths(plan: WalkTrials, walks: Walks, mud: str, strides: DataFrame) -> list[dict[str, Any]]:
    """Gather k_s by depth and method, with the load cell's."""
    return [
        {
            "depth_cm": 100.0 * depth_m,
            "k_s": {method: gather_coefficient(k_s) for method, k_s in _k_s_of(rows).groupby("method", sort=False)},
            "truth": average_truth(rows, median).get("k_s"),
            "thrust_n": _thrust_n(walks[name]),  # of both flippers
        }
        for name, own, depth_m in plan.soft_walks
        if own == mud and len(rows := strides[strides["mud"] == name])
    ]


def _k_s_of(strides: DataFrame) -> DataFrame:
    return strides[strides["coefficient"] == "k_s"]


def _thrust_n(walks: Sequence[Entry]) -> float | None:
    """Average the thrust of both flippers over the second half of the drawn stances.

    While the body moves, the thrust equals the drag on the body.
    """
    means_n = []
    for walk in walks:
        force_n = stroke_of(profile_from(walk), Phase.STANCE)["force_x_n"].to_numpy()
        if np.isfinite(force_n).any():
            means_n.append(2.0 * float(np.nanmean(force_n[len(force_n) // 2 :])))
    return fmean(means_n) if means_n else None


def _findings(plan: WalkTrials, walks: Walks, strides: DataFrame) -> list[dict[str, Any]]:
    """Pair each finding in the paper's text with ours, by its law with a known surface."""
    over = "k_s over the load cell's"
    rows: list[tuple[str, str, float | None]] = [
        (f"{over}, {mud_text(mud)}", "well below 1", _ratio(strides, mud)) for mud, _ in plan.muds
    ]
    for mud in plan.soft:
        at_3, at_5 = (soft_name(mud, depth_m) for depth_m in SOFT_DEPTHS_M)
        text_3, text_5 = mud_text(at_3), mud_text(at_5)
        # the paper's load cell measured at 3 cm
        cell = average_truth(strides[strides["mud"] == at_3], median).get("k_s")
        thrust_n = _thrust_n(walks[at_5])
        rows += [
            (f"{over} at 3 cm, {text_3}", "close to 1", _ratio(strides, at_3, cell=cell)),
            (f"{over} at 3 cm, {text_5}", "0.5", _ratio(strides, at_5, cell=cell)),
            (f"{over} at 3 cm, {text_5}, with drag", "better", _ratio(strides, at_5, KNOWN_COMPENSATED, cell)),
            (f"{over} at 5 cm, {text_5}", "-", _ratio(strides, at_5)),
            (f"thrust of both flippers in stance, {text_5} (N)", f"{PAPER_DRAG_N:g}", thrust_n),
        ]
    return [{"what": what, "paper": paper, "ours": ours} for what, paper, ours in rows]


def _ratio(strides: DataFrame, mud: str, method: str = KNOWN, cell: float | None = None) -> float | None:
    """Return the median of k_s over the load cell's reading of the same stride, or over `cell`."""
    own = _k_s_of(strides[(strides["mud"] == mud) & (strides["method"] == method) & strides["valid"].astype(bool)])
    ratios = (own["value"] / (cell or own["truth"])).dropna()
    return float(ratios.median()) if len(ratios) else None


# the page


def _figures(
    plan: WalkTrials, walks: Walks, strides: DataFrame, soft: Sequence[Mapping[str, Any]], reach_m: float
) -> Iterator[Figure]:
    located = strides[strides["plates_m"].notna()]
    for walk in walks[plan.over]:
        draw = partial(draw_walk_over, plan, walk, located, reach_m)
        yield Figure(f"figure6_trial{walk['trial']}", FIGURE_6.format(walk["trial"], plan.flipper), draw, TRACK)
    for each in soft:
        own = {100.0 * depth_m: walks[name] for name, mud, depth_m in plan.soft_walks if mud == each["mud"]}
        if each["depths"]:
            draw = partial(draw_soft, each, {depth_cm: made for depth_cm, made in own.items() if made})
            yield Figure(f"figure7_{file_name(each['mud'])}", FIGURE_7, draw, _soft_section(each))


def _soft_section(soft: Mapping[str, Any]) -> str:
    return f"Soft mud, {mud_text(soft['mud'])}"


def _explanation(report: Report, configuration: Configuration) -> str:
    gait, settings = configuration.gait, report["settings"]
    paragraphs = [
        f"All strides of all trials by method {settings['method']}, as the daemon reported them. Its gait: insertion "
        f"at {gait.insertion_speed_m_s:g} m/s, stance at {gait.stance_speed_m_s:g} m/s, pauses of {gait.pause_s:g} s.",
        "Left out of the tables, because the plate came too near to a border or went down past the last mud: "
        f"{counted(report['at_a_border'], 'stride')}.",
    ]
    if report["without_pose"]:
        paragraphs.append(
            f"{counted(report['without_pose'], 'walk')} had no pose: strides are assigned to muds by their order."
        )
    paragraphs += [TRIALS, *error_paragraphs(settings), TRUTHS[settings["truth"]]]
    return "\n\n".join([*paragraphs, report["missing_truth"]])
