"""The page about one run, and the page that compares several: sections in the order in which one asks."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from experiments.pictures.mud_layout import MudLayout
from experiments.pictures.recorded_walk import RecordedWalk
from experiments.pictures.stride_choice import choose_strides, with_strides
from experiments.reports.counted_nouns import counted
from experiments.reports.error_table import COEFFICIENTS
from experiments.reports.report_page import Figure, Section
from experiments.reports.shown_values import value_shown
from experiments.reports.style import save_picture
from experiments.run_report.comparison import SHOWN, ComparedRun, differences
from experiments.run_report.event_groups import group_events
from experiments.run_report.fit_quality import R_SQUARED, quality_rows
from experiments.run_report.headline import Headline, headline_sentences
from experiments.run_report.run import MudsFrom, Run, log_begin_s
from experiments.run_report.tables import (
    CM,
    cause_rows,
    difference_rows,
    estimate_rows,
    event_rows,
    flipper_rows,
    mud_rows,
    run_rows,
    stride_rows,
)
from logs.files.log_summary import log_summary

SINCE = "Times count from the beginning of the log."
UNCERTAINTY = (
    "Values have their standard errors. Coefficients are means over the strides of a mud; ≥ marks a lower bound. They "
    "fall with depth, so compare them at like depths. Speeds leave out the last stride of a walk."
)
ORIGINS = {
    MudsFrom.NAMES: "The muds are those that you named.",
    MudsFrom.FILE: "The mud is the label in the name of the file.",
    MudsFrom.ROBOT: "The log names no muds: each is one that the robot noticed, described by its k_p.",
}
WALK = (
    "Forces, coefficients and depth of each flipper, position and steps of the body. Bars are two standard errors, "
    "triangles lower bounds, hollow marks invalid values."
)
FITS = (
    "Every fit and its residuals: the torque that resists the flipper against the moment of the submerged plate. The "
    "slope of a line is the coefficient of one stride. At most ten strides of each mud are drawn."
)
DEPTHS = "Coefficients from other depths differ also in the same mud."
COMPARED = "Speed and coefficients of each run by mud. Bars are two standard errors; an arrow marks a lower bound."


def run_sections(run: Run, headline: Headline) -> list[Section]:
    """Describe one run."""
    sections = [_result_section(run, headline), _faults_section(run)]
    sections += [_walk_section(walk, number, run.layout) for number, walk in enumerate(run.walks, 1)]
    if headline.muds:
        sections.append(_fits_section(run))
    if headline.muds and len(run.flippers) > 1:
        text = "The difference has the errors of both, since each flipper has motors of its own."
        sections.append(Section("Left and right", text, rows=flipper_rows(headline)))
    if run.strides:
        sections.append(_strides_section(run))
    return [*sections, *_log_sections(run)]


def _result_section(run: Run, headline: Headline) -> Section:
    sentences = headline_sentences(run, headline)
    if run.log and not run.log.complete:
        sentences.append("The log was not finished: everything up to where it ends was read.")
    paragraphs = [" ".join(sentences)]
    if headline.muds:
        paragraphs.append(" ".join([UNCERTAINTY, ORIGINS[run.muds_from], *_border_text(run)]))
    return Section("Result", "\n\n".join(paragraphs), rows=mud_rows(headline) if headline.muds else ())


def _border_text(run: Run) -> list[str]:
    uncertain = sum(not stride.mud for stride in run.strides)
    return [f"Near a border or past the last mud, so in no mud: {counted(uncertain, 'stride')}."] if uncertain else []


def _faults_section(run: Run) -> Section:
    if run.log is None:
        rows = [["kind", "finding"], *([str(each.kind), str(each)] for each in run.replay.findings)]
        return Section("Findings", "What the reader noticed in the file.", rows=rows) if rows[1:] else _none("Findings")
    if not run.causes:
        return _none("Faults")
    return Section("Faults", f"{SINCE} Faults of one cause are one row.", rows=cause_rows(run.causes, log_begin_s(run)))


def _none(heading: str) -> Section:
    return Section(heading, "None.")


def _walk_section(walk: RecordedWalk, number: int, layout: MudLayout | None) -> Section:
    from experiments.pictures.walk_plot import plot_walk  # matplotlib is slow to import

    begun = f"It begins {walk.begun_s:.2f} s after the log. Its pictures count from there, as 'mudskipper plot' does."
    missing = f"Not in this log: {', '.join(walk.missing)}." if walk.missing else ""
    cut = f"The walk may have {walk.cut}." if walk.cut else ""
    figures = [Figure(f"walk-{number}", WALK, partial(plot_walk, walk, layout=layout))]
    if walk.own_strides:
        caption = f"The clearest stride of each outcome, {walk.flipper} flipper."
        figures.append(Figure(f"strides-{number}", caption, partial(_draw_strip, walk)))
    return Section(f"Walk {number}", "\n\n".join(filter(None, (begun, missing, cut))), figures=figures)


def _draw_strip(walk: RecordedWalk, path: Path) -> Any:
    from experiments.pictures.stride_strip import draw_strip

    strides = choose_strides(walk)
    save_picture(partial(draw_strip, with_strides(walk, strides), strides), path)


def _fits_section(run: Run) -> Section:
    from experiments.run_report.fit_plot import drawn_muds, plot_fits

    rows = quality_rows(run)
    if not any(cell.isdecimal() for row in rows[1:] for cell in row[2:]):
        return Section(
            "Fits", "No estimate of this log has a fit: all are lower bounds, invalid, or of another method."
        )
    drawn, muds = drawn_muds(run), {stride.mud for stride in run.strides if stride.mud}
    others = f" Of {len(muds)} muds the {len(drawn)} with the most strides are drawn."
    caption = FITS + others * (len(drawn) < len(muds))
    return Section("Fits", R_SQUARED, rows=rows, figures=[Figure("fits", caption, partial(plot_fits, run))])


def _strides_section(run: Run) -> Section:
    text = f"{SINCE} Brackets mark an invalid value, ≥ a lower bound."
    tables = [(f"{name} by stride", estimate_rows(run, name)) for name in COEFFICIENTS]
    return Section("Strides", text, rows=stride_rows(run), tables=tables)


def _log_sections(run: Run) -> list[Section]:
    if run.log is None:
        return []
    groups, summary = group_events(run.log.events), log_summary(run.log)
    text = f"{SINCE} Events that differ only in numbers are one row, with the range of the numbers."
    rows = [["field", "value"], *([name, value_shown(value)] for name, value in summary.items())]
    events = Section("Events", text, rows=event_rows(groups, log_begin_s(run))) if groups else _none("Events")
    return [events, Section("Log", rows=rows)]


# several runs


def comparison_sections(runs: Sequence[ComparedRun]) -> list[Section]:
    """Compare several runs: one table, one figure, and the differences to the first run."""
    from experiments.run_report.comparison_plot import plot_comparison

    figure = Figure("comparison", COMPARED, partial(plot_comparison, runs))
    has_muds = any(each.headline.muds for each in runs)
    text = f"{' '.join(comparison_sentences(runs))}\n\n{UNCERTAINTY}"
    result = Section("Result", text, rows=run_rows(runs), figures=[figure] if has_muds else [])
    return [result, _differences_section(runs)]


def comparison_sentences(runs: Sequence[ComparedRun]) -> list[str]:
    """Say how fast each run was, and how many differences are larger than their uncertainty."""
    strides = sum(each.headline.strides for each in runs)
    speeds = [(each.run.name, each.headline.motion.speed_m_s) for each in runs]
    known = [f"{name} {speed_m_s / CM:.1f} cm/s" for name, speed_m_s in speeds if speed_m_s is not None]
    empty = [each.run.name for each in runs if not each.headline.strides]
    return [
        f"{counted(len(runs), 'run')}, {counted(strides, 'stride')}.",
        *[f"Mean speeds: {', '.join(known)}."] * bool(known),
        *[f"No complete stride in {', '.join(empty)}."] * bool(empty),
        *_differences_sentence(runs),
    ]


def _differences_sentence(runs: Sequence[ComparedRun]) -> list[str]:
    found = differences(runs)
    shown = sum(bool(each.is_shown) for each in found)
    first = runs[0].run.name
    return [f"{shown} of {counted(len(found), 'difference')} to {first} exceed {SHOWN:g} standard errors."] * bool(
        found
    )


def _differences_section(runs: Sequence[ComparedRun]) -> Section:
    found, first = differences(runs), runs[0].run
    if not found:
        return Section("Differences", f"No other run has a value in a mud of the same name as one of {first.name}.")
    robots = {each.run.robot for each in runs}
    text = f"Every run compared with {first.name}. A difference is shown beyond {SHOWN:g} standard errors. {DEPTHS}"
    shared = " The error that all strides of one robot share is left out: it moves its runs alike."
    return Section("Differences", text + shared * (len(robots) == 1), rows=difference_rows(found))
