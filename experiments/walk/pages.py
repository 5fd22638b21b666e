"""What a person is shown of the walks over several muds: sections with tables and pictures, and the screen's text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from experiments.flipper.report import ERRORS, HEADING, TRUTHS, UNCERTAINTIES, remarked, uncertainties
from experiments.reports.coefficient_table import error_text_rows, mud_rows
from experiments.reports.mud_names import mud_text
from experiments.reports.mud_styles import file_name
from experiments.reports.report_page import Figure, Section
from experiments.trackway.bench import reach_of
from experiments.trials.estimation_methods import configured_method
from experiments.trials.mud_trials import left_out_texts
from experiments.trials.notebook import Entry
from experiments.trials.truth_file import TruthOfMud
from experiments.walk.measurement import SOFT_DEPTHS_M, Plan
from experiments.walk.report import placed_strides, soft_walks_of, walks_of
from firmware_host.configuration.configuration import Configuration
from firmware_host.operator.counted_nouns import counted

SIMULATED_DRAG = (
    "The simulated body's drag grows with speed, to two and more times the paper's 2.5 N: so a firmer mud than "
    "the paper's is the one that yields at 3 cm and holds at 5 cm. Part of the difference between these depths is the "
    "mud's own, whose coefficients fall with depth: at 5 cm the load cell reads 0.6 of the k_s and 0.75 of the k_p "
    "that it reads at 3 cm. So each stride stands beside a load cell at its own depth."
)
TRIALS = (
    "The trials here are the strides of all walks. Where more of them tell a lower bound than a value, the mud has a "
    "bound as well, the middle one of all: the few that slip in mud that mostly holds met less of it, or pushed "
    "harder, than is known, and tell too little (12 % in simulated mud)."
)
FELT = "Where the mud bears more than the body's drag, the flipper feels that drag and not the mud's strength."
METHODS = (
    "In brackets also how many strides told a bound (≥) or nothing. default: the daemon's own. paper: the "
    "published method, whose surface is where f_z passes 0.5 N; compensated: with half of the body's drag added while "
    "the body advances. paper's law: the published law of shear below the surface that the default method finds, and "
    "the same with that drag."
)
FINDINGS = "The paper's findings, ours by its law below the default method's surface"
Tables = list[tuple[str, Sequence[Sequence[str]]]]


def sections_of(
    report: Mapping[str, Any],
    plan: Plan,
    entries: Mapping[str, Entry],
    configuration: Configuration,
    truth: TruthOfMud | None,
) -> list[Section]:
    sections = [_walk_section(report, plan, entries, configuration, truth)]
    walked = [soft for soft in report["soft"] if soft["depths"]]
    sections += [_soft_section(soft, plan, entries, is_first=soft is walked[0]) for soft in walked]
    if report["errors"]:
        sections.append(Section(ERRORS, METHODS, rows=error_text_rows(report["errors"])))
    sections.append(Section(FINDINGS, rows=paper_rows(report)))
    return sections + remarked([*report["remarks"], *left_out_texts(report.get("left_out", {}))])


def _walk_section(
    report: Mapping[str, Any],
    plan: Plan,
    entries: Mapping[str, Entry],
    configuration: Configuration,
    truth: TruthOfMud | None,
) -> Section:
    from experiments.walk.plots import plot_walk_over  # matplotlib takes its time

    strides = placed_strides(plan, entries, configuration, truth)
    caption = (
        "Figure 6 of the paper, trial {}. A: place of the body; vertical lines: the plates go down behind a border. B, "
        "C: forces of the {} flipper. D to F: coefficients by stride, bars are two standard errors, triangles lower "
        "bounds, arrows values beyond the picture; grey dashes: the load cell."
    )
    figures = [
        Figure(
            f"figure6_trial{walk['trial']}",
            caption.format(walk["trial"], plan.flipper),
            partial(plot_walk_over, plan, walk, strides, reach_of(configuration)),
        )
        for walk in walks_of(plan, entries)
    ]
    text = _reported(report, configuration)
    return Section("Coefficients along the way", text, rows=mud_rows(report["muds"]), figures=figures)


def _reported(report: Mapping[str, Any], configuration: Configuration) -> str:
    gait = configuration.gait
    paragraphs = [
        f"All strides of all trials by method {configured_method(configuration.estimation)}, as the daemon told. Its "
        f"gait: insertion at {gait.insertion_speed_m_s:g} m/s, stance at {gait.stance_speed_m_s:g} m/s, pauses of "
        f"{gait.pause_s:g} s.",
        f"Left out of tables, since their plate came too near to a border, or went down behind the last mud: "
        f"{counted(report['at_a_border'], 'stride')}.",
    ]
    if report["without_pose"]:
        paragraphs.append(
            f"{counted(report['without_pose'], 'walk')} had no pose: strides are given to muds by their order."
        )
    paragraphs += [f"{TRIALS} {UNCERTAINTIES}", *uncertainties(report["settings"]), TRUTHS[report["settings"]["truth"]]]
    return "\n\n".join([*paragraphs, report["missing_truth"]])


def _soft_section(soft: Mapping[str, Any], plan: Plan, entries: Mapping[str, Entry], is_first: bool) -> Section:
    """What all soft muds have in common is said of the first."""
    from experiments.walk.plots import plot_soft

    mud = soft["mud"]
    walks = {100.0 * depth_m: soft_walks_of(plan, entries, mud, depth_m) for depth_m in SOFT_DEPTHS_M}
    caption = (
        "Figure 7 of the paper. A: forward force in one stance. B: k_s by method, mean and standard deviation over "
        "strides; hatched: a lower bound. The paper's law stands here without its trigger at 0.5 N, which finds the "
        "surface of soft mud too deep: the surface is the default method's."
    )
    draw = partial(plot_soft, soft, {depth: reported for depth, reported in walks.items() if reported})
    text = ""
    if is_first:
        text = f"{FELT} {SIMULATED_DRAG}" if plan.simulated else FELT
    name = f"figure7_{file_name(mud)}"
    return Section(f"Soft mud, {mud_text(mud)}", text, figures=[Figure(name, caption, draw)])


def text_of(report: Mapping[str, Any]) -> Tables:
    """Titles and tables for the screen."""
    tables: Tables = [(HEADING, mud_rows(report["muds"]))]
    if report["errors"]:
        tables.append((ERRORS, error_text_rows(report["errors"])))
    return [*tables, (FINDINGS, paper_rows(report))]


def paper_rows(report: Mapping[str, Any]) -> list[list[str]]:
    rows = [["", "paper", "ours"]]
    for row in report["beside_paper"]:
        rows.append([row["what"], row["paper"], "-" if row["ours"] is None else f"{row['ours']:.2f}"])
    return rows
