"""The finding of the walks over several muds: sections with tables and pictures, and tables for the screen."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from experiments.flipper.text import (
    ERRORS,
    TRUTHS,
    UNCERTAINTIES,
    coefficient_tables,
    error_paragraphs,
    remarks_sections,
)
from experiments.reports.coefficient_table import error_text_rows, mud_rows
from experiments.reports.counted_nouns import counted
from experiments.reports.mud_names import mud_text
from experiments.reports.mud_styles import file_name
from experiments.reports.report_page import Figure, Section
from experiments.reports.text_tables import TitledRows, text_of_tables
from experiments.study.notebook import Entry
from experiments.trackway.bench import reach_of
from experiments.trials.estimation_methods import configured_method
from experiments.trials.mud_trials import SEED, PlannedTrial, open_bench, run_trials
from experiments.trials.session import Finding, Session
from experiments.trials.truth_file import TruthOfMud, load_truth
from experiments.walk.measurement import SOFT_DEPTHS_M, Plan, run
from experiments.walk.report import SoftMud, WalkReport, located_strides, report_of, soft_walks_of, walks_of
from experiments.walk.simulation import walking_bench
from firmware_host.configuration.configuration import Configuration

TRACKWAY_INSTRUCTIONS = (
    "Torque is off. Re-mix the surface of all muds and level it to its nominal height, and put the robot so that the "
    "sweep axes are over the beginning of the first mud. Take your hands away: the robot walks next"
)
SOFT_INSTRUCTIONS = (
    "Torque is off. Re-mix and level the soft mud, and put the robot where it has at least 80 cm of it ahead. Take "
    "your hands away: the robot walks next"
)
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


def run_walk(plan: Plan, session: Session, truth_path: Path | None) -> Finding:
    """Make the walks and report them. Raises BenchError."""
    truth = load_truth(truth_path) if truth_path else None
    bench = open_bench(session, plan.identity, _instructions, partial(walking_bench, session.folder, plan, SEED))
    configuration, entries, logs = run_trials(bench, session, lambda: run(bench, plan, session.show))
    report = report_of(plan, entries, configuration, truth, bench.notebook.left_out)
    sections = sections_of(report, plan, entries, configuration, truth)
    return Finding(report, "The walking robot over several muds", sections, text_of_tables(tables_of(report)), logs)


def _instructions(trial: PlannedTrial) -> str:
    return TRACKWAY_INSTRUCTIONS if trial.key.startswith("walk/") else SOFT_INSTRUCTIONS


def sections_of(
    report: WalkReport,
    plan: Plan,
    entries: Mapping[str, Entry],
    configuration: Configuration,
    truth: TruthOfMud | None,
) -> list[Section]:
    sections = [_walk_section(report, plan, entries, configuration, truth)]
    walked = [soft for soft in report.soft if soft.depths]
    sections += [_soft_section(soft, plan, entries, is_first=soft is walked[0]) for soft in walked]
    if report.errors:
        sections.append(Section(ERRORS, METHODS, rows=error_text_rows(report.errors)))
    sections.append(Section(FINDINGS, rows=finding_rows(report)))
    return sections + remarks_sections(report.remarks, report.left_out)


def _walk_section(
    report: WalkReport,
    plan: Plan,
    entries: Mapping[str, Entry],
    configuration: Configuration,
    truth: TruthOfMud | None,
) -> Section:
    from experiments.walk.plots import plot_walk_over  # matplotlib takes its time

    strides = located_strides(plan, entries, configuration, truth)
    caption = (
        "Figure 6 of the paper, trial {}. A: position of the body; at a vertical line the plates first go down past a "
        "border. B, C: forces of the {} flipper. D to F: coefficients by stride; bars are two standard errors, "
        "triangles lower bounds, arrows values beyond the picture, grey dashes the load cell."
    )
    figures = [
        Figure(
            f"figure6_trial{walk['trial']}",
            caption.format(walk["trial"], plan.flipper),
            partial(plot_walk_over, plan, walk, strides, reach_of(configuration)),
        )
        for walk in walks_of(plan, entries)
    ]
    text = _explanation(report, configuration)
    return Section("Coefficients along the track", text, rows=mud_rows(report.muds), figures=figures)


def _explanation(report: WalkReport, configuration: Configuration) -> str:
    gait = configuration.gait
    paragraphs = [
        f"All strides of all trials by method {configured_method(configuration.estimation)}, as the daemon reported "
        f"them. Its gait: insertion at {gait.insertion_speed_m_s:g} m/s, stance at {gait.stance_speed_m_s:g} m/s, "
        f"pauses of {gait.pause_s:g} s.",
        "Left out of the tables, because the plate came too near to a border or went down past the last mud: "
        f"{counted(report.at_a_border, 'stride')}.",
    ]
    if report.without_pose:
        paragraphs.append(
            f"{counted(report.without_pose, 'walk')} had no pose: strides are assigned to muds by their order."
        )
    paragraphs += [f"{TRIALS} {UNCERTAINTIES}", *error_paragraphs(report.settings), TRUTHS[report.settings["truth"]]]
    return "\n\n".join([*paragraphs, report.missing_truth])


def _soft_section(soft: SoftMud, plan: Plan, entries: Mapping[str, Entry], is_first: bool) -> Section:
    """Make the section of one soft mud; the first one explains what all have in common."""
    from experiments.walk.plots import plot_soft

    walks = {100.0 * depth_m: soft_walks_of(plan, entries, soft.mud, depth_m) for depth_m in SOFT_DEPTHS_M}
    caption = (
        "Figure 7 of the paper. A: forward force in one stance. B: k_s by method, mean and standard deviation over "
        "strides; hatched: a lower bound. The paper's law is used with the default method's surface, because its own "
        "trigger at 0.5 N finds the surface of soft mud too deep."
    )
    draw = partial(plot_soft, soft, {depth_cm: made for depth_cm, made in walks.items() if made})
    text = f"{DRAG_NOT_STRENGTH} {SIMULATED_DRAG}" if plan.simulated else DRAG_NOT_STRENGTH
    figure = Figure(f"figure7_{file_name(soft.mud)}", caption, draw)
    return Section(f"Soft mud, {mud_text(soft.mud)}", text if is_first else "", figures=[figure])


def tables_of(report: WalkReport) -> list[TitledRows]:
    return [*coefficient_tables(report.muds, report.errors), (FINDINGS, finding_rows(report))]


def finding_rows(report: WalkReport) -> list[list[str]]:
    rows = [[row.what, row.paper, "-" if row.ours is None else f"{row.ours:.2f}"] for row in report.findings]
    return [["", "paper", "ours"], *rows]
