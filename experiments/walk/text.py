"""The tables, figures and explanations of the walks over several muds."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pandas import DataFrame

from experiments.flipper.text import (
    COMPARISON,
    TRUTHS,
    UNCERTAINTIES,
    coefficient_tables,
    error_paragraphs,
    remark_texts,
)
from experiments.reports.counted_nouns import counted
from experiments.reports.mud_names import mud_text
from experiments.reports.mud_styles import file_name
from experiments.reports.text_tables import number
from experiments.study.notebook import Entry
from experiments.study.result import Figure, Result, Table
from experiments.trackway.bench import reach_of
from experiments.trials.estimation_methods import configured_method
from experiments.trials.truth_file import TruthOfMud
from experiments.walk.measurement import SOFT_DEPTHS_M, WalkTrials
from experiments.walk.plots import draw_soft, draw_walk_over
from experiments.walk.report import Report, located_strides, soft_walks_of, walks_of
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
FINDINGS = "The paper's findings, and ours by its law below the default method's surface"


def result_of(
    report: Report,
    plan: WalkTrials,
    entries: Mapping[str, Entry],
    configuration: Configuration,
    truth: TruthOfMud | None,
    logs: Sequence[Path],
) -> Result:
    """Return the tables, figures and explanations of all walks."""
    findings = DataFrame(report["beside_paper"]).rename(columns={"what": ""})
    findings["ours"] = [number(ours, 2) for ours in findings["ours"]]
    walked = [soft for soft in report["soft"] if soft["depths"]]
    drag = f"{DRAG_NOT_STRENGTH} {SIMULATED_DRAG}" if plan.simulated else DRAG_NOT_STRENGTH
    return Result(
        tables=[
            *coefficient_tables(report["muds"], report["errors"], TRACK),
            Table("findings", FINDINGS, {}, findings, "Findings"),
        ],
        figures=[
            *_walk_figures(plan, entries, configuration, truth),
            *(_soft_figure(soft, plan, entries) for soft in walked),
        ],
        summary=report,
        title="The walking robot over several muds",
        texts={
            TRACK: _explanation(report, configuration),
            **{_soft_section(soft): drag for soft in walked[:1]},  # the first one explains what all have in common
            COMPARISON: METHODS if report["errors"] else "",
        }
        | remark_texts(report["remarks"], report["left_out"]),
        logs=logs,
    )


def _walk_figures(
    plan: WalkTrials, entries: Mapping[str, Entry], configuration: Configuration, truth: TruthOfMud | None
) -> list[Figure]:
    strides = located_strides(plan, entries, configuration, truth)
    caption = (
        "Figure 6 of the paper, trial {}. A: position of the body; at a vertical line the plates first go down past a "
        "border. B, C: forces of the {} flipper. D to F: coefficients by stride; bars are two standard errors, "
        "triangles lower bounds, arrows values beyond the picture, grey dashes the load cell."
    )
    return [
        Figure(
            f"figure6_trial{walk['trial']}",
            caption.format(walk["trial"], plan.flipper),
            partial(draw_walk_over, plan, walk, strides, reach_of(configuration)),
            TRACK,
        )
        for walk in walks_of(plan, entries)
    ]


def _explanation(report: Report, configuration: Configuration) -> str:
    gait = configuration.gait
    paragraphs = [
        f"All strides of all trials by method {configured_method(configuration.estimation)}, as the daemon reported "
        f"them. Its gait: insertion at {gait.insertion_speed_m_s:g} m/s, stance at {gait.stance_speed_m_s:g} m/s, "
        f"pauses of {gait.pause_s:g} s.",
        "Left out of the tables, because the plate came too near to a border or went down past the last mud: "
        f"{counted(report['at_a_border'], 'stride')}.",
    ]
    if report["without_pose"]:
        paragraphs.append(
            f"{counted(report['without_pose'], 'walk')} had no pose: strides are assigned to muds by their order."
        )
    paragraphs += [
        f"{TRIALS} {UNCERTAINTIES}",
        *error_paragraphs(report["settings"]),
        TRUTHS[report["settings"]["truth"]],
    ]
    return "\n\n".join([*paragraphs, report["missing_truth"]])


def _soft_section(soft: Mapping[str, Any]) -> str:
    return f"Soft mud, {mud_text(soft['mud'])}"


def _soft_figure(soft: Mapping[str, Any], plan: WalkTrials, entries: Mapping[str, Entry]) -> Figure:
    walks = {100.0 * depth_m: soft_walks_of(plan, entries, soft["mud"], depth_m) for depth_m in SOFT_DEPTHS_M}
    caption = (
        "Figure 7 of the paper. A: forward force in one stance. B: k_s by method, mean and standard deviation over "
        "strides; hatched: a lower bound. The paper's law is used with the default method's surface, because its own "
        "trigger at 0.5 N finds the surface of soft mud too deep."
    )
    draw = partial(draw_soft, soft, {depth_cm: made for depth_cm, made in walks.items() if made})
    return Figure(f"figure7_{file_name(soft['mud'])}", caption, draw, _soft_section(soft))
