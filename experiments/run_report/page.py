"""The page about one run, and the page that compares several: texts, tables and pictures in the order of questions."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import isfinite
from typing import Any

from matplotlib.figure import Figure as Drawing
from pandas import DataFrame

from control.records import COEFFICIENTS
from estimation.strokes.fit_samples import FitSamples
from experiments.pictures.recorded_walk import RecordedWalk
from experiments.pictures.stride_choice import Outcome, choose_strides, with_strides
from experiments.pictures.stride_strip import draw_strip
from experiments.pictures.walk_plot import draw_walk
from experiments.reports.coefficient_table import GatheredCoefficient
from experiments.reports.counted_nouns import counted
from experiments.reports.text_tables import number
from experiments.reports.validity_text import why_not_valid
from experiments.reports.value_text import N_CM3, coefficient_text, value_text
from experiments.run_report.figures import N_CM, draw_comparison, draw_directions, draw_fits, draw_paths, drawn_muds
from experiments.run_report.results import (
    SHOWN,
    SPEED,
    Entry,
    differences,
    end_sentences,
    flipper_difference,
    headline_of,
    headline_sentences,
    is_shown,
    reaction_of,
    run_labels,
)
from experiments.run_report.run import MudsFrom, Run
from experiments.study.result import Figure, Result, Table
from experiments.study.session import Ending
from firmware_host.operator.reports import map_report, stride_report
from firmware_host.trial import OperatorReport, read_report
from logs.fault_history import BEGUN, OVER
from logs.files.log_summary import log_summary, operator_reports
from logs.lab.summary import finding_reports

CM = 0.01  # in metres
FIT = ["r_squared", "r_squared_about_mean", "rms_residual_nm"]
UNITS = dict.fromkeys(("first at", "last at", "at", "from"), "s") | dict.fromkeys(("depth", "step"), "cm")
UNITS |= dict.fromkeys((*COEFFICIENTS, "left", "right", "right - left"), "N/cm³") | {
    "distance": "m",
    "speed": "cm/s",
    "lowest supply": "V",
}
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w])")
SINCE = "Times count from the beginning of the log."
UNCERTAINTY = (
    "Values have their standard errors. Coefficients are means over the strides of a mud; ≥ marks a lower bound. They "
    "fall with depth, so compare them at like depths. Speeds leave out the last stride of a walk."
)
ORIGINS = {
    MudsFrom.NAMES: "The muds are those that you named.",
    MudsFrom.LOG: "The mud is the one that the log names.",
    MudsFrom.FILE: "The mud is the label in the name of the file.",
    MudsFrom.ROBOT: "The log names no muds: each is one that the robot noticed, described by its k_p and, "
    "where two are alike, by its walk or when it begins in that walk.",
}
WALK = (
    "Forces, coefficients and depth of each flipper, position and steps of the body. Bars are two standard errors, "
    "triangles lower bounds, hollow marks invalid values, of which those above the scale stand at its upper edge."
)
FITS = (
    "Every fit and its residuals: the torque that resists the flipper against the moment of the submerged plate. The "
    "slope of a line is the coefficient of one stride. In a stance that moment hardly changes, so shear is drawn along "
    "the stroke, with the moment times the coefficient. At most ten strides of each mud are drawn."
)
PATHS = (
    "Where the lower edges of the plates went in the mud, from the axles, all strides and flippers over each other. "
    "Left: the force of the mud, in a stance its part along the track. Right: how much more torque the strides before "
    "let expect than was felt, where a coefficient has a value: red is too much, blue too little."
)
DIRECTIONS = (
    "How the mud resists an upright plate by the direction of its motion. Marks are the coefficients with two standard "
    "errors. Between them the laws say: across the plate clay presses in any direction (line), sand along the motion "
    "(dashes); along the plate both follow the sine. Hatched: no plate moved there, so only the laws speak."
)
R_SQUARED = (
    "R² is 1 - Σr²/Στ² of torques τ and residuals r, as usual for a line through the origin. R² about the mean has "
    "Σ(τ - τ̄)² in its place: below 0 a constant torque would explain the stroke better than the law. Residuals are "
    "root mean squares. A lower bound has no fit. The table has the median over strides."
)
DEPTHS = "Coefficients from other depths differ also in the same mud."
UNNAMED = "Muds that the robot noticed have no names: give them with --mud."
COMPARED = (
    "Speed and coefficients of each run by mud. Bars are two standard errors, grey dashes the strides; an arrow marks "
    "a lower bound."
)


def report_of(runs: Sequence[Run]) -> Result:
    """Describe one run, or compare several. The result ends unhealthy where a log does."""
    headlines = [headline_of(run) for run in runs]
    result = run_result(runs[0], headlines[0]) if len(runs) == 1 else comparison_result(runs, headlines)
    whole = all(headline["complete"] for headline in headlines)
    tables = [table for table in result.tables if len(table.rows)]
    return replace(result, tables=tables, ending=Ending.DONE if whole else Ending.UNHEALTHY)


def run_result(run: Run, headline: Entry) -> Result:
    """Describe one run."""
    begin_s, texts = run.replay.begin_s, {"Result": _result_text(run, headline)}
    tables = [_table("Result", [{"mud": each["mud"]} | _mud_cells(each) for each in headline["muds"]])]
    figures: list[Figure] = []
    if run.log is None:
        texts["Findings"] = "What the reader noticed in the file." if run.replay.findings else "None."
        tables.append(_table("Findings", [{"kind": each.kind, "finding": str(each)} for each in run.replay.findings]))
    else:
        texts["Faults"] = f"{SINCE} Faults of one cause are one row." if run.causes else "None."
        tables.append(_table("Faults", _cause_rows(run, begin_s)))
    for index, walk in enumerate(run.walks, 1):
        texts[f"Walk {index}"] = _walk_text(walk)
        figures += _walk_figures(run, walk, index)
    if headline["muds"]:
        if run.estimates["samples"].notna().any():
            texts["Fits"] = R_SQUARED
            tables.append(_table("Fits", quality_rows(run)))
            figures.append(Figure("fits", _fits_caption(run, headline), partial(draw_fits, run), "Fits"))
            figures.append(Figure("paths", PATHS, partial(draw_paths, run), "Fits"))
            figures.append(Figure("directions", DIRECTIONS, partial(draw_directions, run, headline), "Fits"))
        else:
            texts["Fits"] = "No estimate of this log has a fit: all are lower bounds, invalid, or of another method."
        if len(run.replay.flippers) > 1:
            texts["Left and right"] = "The difference has the errors of both, since each flipper has motors of its own."
            tables.append(_table("Left and right", _flipper_rows(headline)))
    if len(run.strides):
        notes = [SINCE, "Brackets mark an invalid value, ≥ a lower bound."]
        texts["Strides"] = " ".join([*notes, *why_not_valid(map(stride_report, run.replay.strides))])
        tables.append(_table("Strides", stride_rows(run)))
        tables += [_table("Strides", estimate_rows(run, name), f"{name} by stride") for name in COEFFICIENTS]
    if run.supply:
        texts["Supply"] = f"What each drive reported of its supply. {SINCE}"
        tables.append(_table("Supply", [_supply_row(each, begin_s) for each in run.supply]))
    if run.log:
        if reports := operator_reports(run.log.events):
            texts["Notes"] = f"What operators wrote into the log. {SINCE}"
            tables.append(_table("Notes", [_report_row(stamp_s - begin_s, report) for stamp_s, report in reports]))
        groups = group_events(run.log.events, begin_s)
        text = f"{SINCE} Events that differ only in numbers are one row, with the range of the numbers."
        texts |= {"Events": text if groups else "None.", "Log": ""}
        summary = [{"field": name, "value": value} for name, value in log_summary(run.log).items()]
        tables += [_table("Events", groups), _table("Log", summary)]
    return Result(tables, figures, _run_summary(run, headline), f"Log {run.paths[0].name}", texts)


def _run_summary(run: Run, headline: Entry) -> Entry:
    return {
        "log": [path.name for path in run.paths],
        "clock": "times of strides and events are by the log's own clock; the log begins at begin_s of it",
        "begin_s": run.replay.begin_s,
        "headline": headline,
        "muds_from": run.muds_from,
        "summary": log_summary(run.log) if run.log else {},
        "strides": [stride_report(stride) for stride in run.replay.strides],
        "fits": [{name: _fit_summary(getattr(fits, name)()) for name in COEFFICIENTS} for fits in run.replay.fits],
        "map": map_report(run.replay.map),
        "supply": list(run.supply),
        "faults": [cause._asdict() for cause in run.causes],
        "events": run.log.events if run.log else [],
        "findings": finding_reports(run.paths[0], run.replay.findings),
    }


def _fit_summary(samples: FitSamples | None) -> Entry | None:
    """Return the quality of a fit; None for a coefficient without one."""
    return samples and {name: getattr(samples, name) for name in FIT} | {"samples": len(samples.torques_nm)}


def _table(section: str, rows: Sequence[Mapping[str, Any]], title: str = "") -> Table:
    return Table(section, title, UNITS, DataFrame(rows, dtype=object), section)


def _result_text(run: Run, headline: Entry) -> str:
    paragraphs = [" ".join(headline_sentences(run, headline))]
    if headline["muds"]:
        uncertain = int((run.strides["mud"] == "").sum())
        border = f"Near a border or past the last mud, so in no mud: {counted(uncertain, 'stride')}."
        paragraphs.append(" ".join([UNCERTAINTY, ORIGINS[run.muds_from], *[border] * bool(uncertain)]))
    return "\n\n".join(paragraphs)


def _walk_text(walk: RecordedWalk) -> str:
    begun = f"It begins {walk.begun_s:.2f} s after the log. Its pictures count from there, as 'mudskipper plot' does."
    missing = [f"Not in this log: {', '.join(walk.missing)}."] * bool(walk.missing)
    return "\n\n".join([begun, *missing, *[f"The walk may have {walk.cut}."] * bool(walk.cut)])


def _walk_figures(run: Run, walk: RecordedWalk, number: int) -> list[Figure]:
    def draw_strides() -> Drawing:
        strides = choose_strides(walk)
        return draw_strip(with_strides(walk, strides), strides)

    section, caption = f"Walk {number}", f"The clearest stride of each outcome, {walk.flipper} flipper."
    figures = [Figure(f"walk-{number}", WALK, partial(draw_walk, walk, run.layout), section)]
    return figures + [Figure(f"strides-{number}", caption, draw_strides, section)] * bool(walk.own_strides)


def _fits_caption(run: Run, headline: Entry) -> str:
    drawn, muds = len(drawn_muds(run)), len(headline["muds"])
    return FITS + f" Of {muds} muds the {drawn} with the most strides are drawn." * (drawn < muds)


# the rows of the tables


def coefficient_cell(gathered: GatheredCoefficient) -> str:
    """Format in N/cm³ with the whole standard error."""
    return coefficient_text(gathered.value, gathered.std_error, at_least=gathered.at_least)


def counts_cell(outcomes: Mapping[str, int]) -> str:
    *known, unknown = [outcomes[each] for each in (Outcome.GOOD, Outcome.SLIPPING, Outcome.STUCK, Outcome.UNKNOWN)]
    if unknown and not any(known):
        return "-"
    return " / ".join(map(str, known)) + f" ({unknown} unknown)" * bool(unknown)


def _mud_cells(result: Entry) -> dict[str, Any]:
    depths_cm = [f"{result[name] / CM:z.1f}" for name in ("shallowest_m", "deepest_m")]
    return {
        "strides": result["strides"],
        "good / slipped / stuck": counts_cell(result["outcomes"]),
        "distance": number(result["distance_m"], 2),
        "speed": value_text(result["speed_m_s"], result["speed_std_error_m_s"], per=CM),
        "depth": " to ".join(dict.fromkeys(depths_cm)),
        **{name: coefficient_cell(result["both"][name]) for name in COEFFICIENTS},
    }


def _flipper_rows(headline: Entry) -> list[dict[str, Any]]:
    rows = []
    for result in headline["muds"]:
        for name in COEFFICIENTS:
            left, right = (result["flippers"][flipper][name] for flipper in ("left", "right"))
            cells = {"left": coefficient_cell(left), "right": coefficient_cell(right)}
            difference = coefficient_text(*flipper_difference(left, right))
            rows.append({"mud": result["mud"], "coefficient": name, **cells, "right - left": difference})
    return rows


def _cause_rows(run: Run, begin_s: float) -> list[dict[str, Any]]:
    return [
        {
            "first at": cause.first_s - begin_s,
            "times": cause.times,
            "cause": cause.message,
            "parts": cause.subjects,
            "reaction": reaction_of(cause).name.lower().replace("_", " "),
            "consequences": cause.consequences,
            "what to do": cause.what_to_do,
        }
        for cause in run.causes
    ]


def _supply_row(supply: Mapping[str, Any], begin_s: float) -> dict[str, Any]:
    at_s = supply["lowest_stamp_s"] - begin_s
    volts = {"lowest (V)": supply["lowest_v"], "at": at_s, "highest (V)": supply["highest_v"]}
    return {"drive": supply["joint"], **volts, "most current (A)": number(supply["most_a"], 2)}


def _report_row(at_s: float, report: OperatorReport) -> dict[str, Any]:
    time = f"{report.time:%Y-%m-%d %H:%M:%S.%f}"[:-3]
    return {"at": at_s, "universal time": time, "kind": report.kind, "text": report.text, "by": report.by}


def group_events(events: Iterable[Mapping[str, Any]], begin_s: float) -> list[dict[str, Any]]:
    """Group events that differ only in their numbers, without faults and notes, which have tables of their own."""
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for event in events:
        if not any(read(event["text"]) for read in (BEGUN.fullmatch, OVER.fullmatch, read_report)):
            groups.setdefault(NUMBER.sub("#", event["text"]), []).append(event)
    return [
        {
            "first at": group[0]["stamp_s"] - begin_s,
            "last at": group[-1]["stamp_s"] - begin_s if len(group) > 1 else "",
            "times": len(group),
            "event": _common_text([event["text"] for event in group]),
        }
        for group in groups.values()
    ]


def _common_text(texts: Sequence[str]) -> str:
    """Return the text with the range of each number that differs."""
    columns = zip(*map(NUMBER.findall, texts), strict=True)
    ends = ((min(numbers, key=float), max(numbers, key=float)) for numbers in columns)
    ranges = iter([low if low == high else f"{low} to {high}" for low, high in ends])
    return NUMBER.sub(lambda _: next(ranges), texts[0])


def quality_rows(run: Run) -> list[dict[str, Any]]:
    """List the fits by mud and coefficient, medians over strides, the flippers side by side."""
    rows = []
    for (mud, name), estimates in run.estimates[run.estimates["mud"] != ""].groupby(["mud", "coefficient"], sort=False):
        row: dict[str, Any] = {"mud": mud, "coefficient": name}
        for flipper in run.replay.flippers:
            found = estimates[estimates["flipper"] == flipper]["samples"].dropna()
            medians = DataFrame([[getattr(each, name) for name in FIT] for each in found], columns=FIT).median()
            r_squared, about_mean, residual_nm = medians.tolist()
            row |= {f"{flipper}: fits": len(found) or "-", f"{flipper}: R²": r_squared}
            row |= {f"{flipper}: R² about mean": about_mean, f"{flipper}: residual (N·cm)": N_CM * residual_nm}
        rows.append(row)
    return rows


def stride_rows(run: Run) -> list[dict[str, Any]]:
    return [
        {
            "walk": stride["walk"],
            "stride": stride["index"],
            "mud": stride["mud"] or "at a border",
            "from": stride["start_s"],
            "depth": stride["depth_m"] / CM,
            "step": stride["step_m"] / CM,
            "lowest supply": stride["supply_v"],
            "outcome": stride["outcome"] + ", two surfaces" * bool(stride["two_surfaces"]),
        }
        for stride in run.strides.to_dict("records")
    ]


def estimate_rows(run: Run, name: str) -> list[dict[str, Any]]:
    """List one coefficient of every stride with R² and residual of its fit, the flippers side by side."""
    rows: dict[tuple[int, int], dict[str, Any]] = {}
    for each in run.estimates[run.estimates["coefficient"] == name].itertuples():
        text = coefficient_text(each.value, each.std_error, at_least=each.at_least)
        row = rows.setdefault((each.walk, each.index), {"walk": each.walk, "stride": each.index})
        row[f"{each.flipper} (N/cm³)"] = text if each.valid or text == "-" else f"({text})"
        speed = f", {each.speed_m_s:.2g} m/s" * isfinite(each.speed_m_s)
        row[f"{each.flipper}: at"] = f"{each.depth_m / CM:.1f} cm{speed}" if isfinite(each.depth_m) else "-"
        row[f"{each.flipper}: R²"] = each.samples and each.samples.r_squared
        row[f"{each.flipper}: residual (N·cm)"] = each.samples and N_CM * each.samples.rms_residual_nm
    return list(rows.values())


# several runs


def comparison_result(runs: Sequence[Run], headlines: Sequence[Entry]) -> Result:
    """Compare several runs: one table, one figure, and the differences to the first run."""
    labels, found = run_labels(runs, headlines), differences(runs, headlines)
    first = labels[runs[0].name]
    compared = f"Every run compared with {first}. A difference is shown beyond {SHOWN:g} standard errors. {DEPTHS}"
    if len({run.robot for run in runs}) == 1:
        compared += " The error that all strides of one robot share is left out: it moves its runs alike."
    texts = {
        "Result": f"{' '.join(_comparison_sentences(runs, headlines, labels, found))}\n\n{UNCERTAINTY}",
        "Differences": compared if found else f"No other run has a value in a mud named as one of {first}. {UNNAMED}",
    }
    rows = []
    for label, headline in zip(labels.values(), headlines, strict=True):
        faults = {"faults": f"{headline['stops']} stopped it" if headline["stops"] else "-"}
        muds = [{"mud": each["mud"]} | _mud_cells(each) for each in headline["muds"]]
        rows += [{"run": label} | each | faults for each in muds or [{"mud": "-", "strides": headline["strides"]}]]
    results = DataFrame(rows, dtype=object)
    empty = [name for name in results if set(results[name].fillna("-")) == {"-"}]
    differences_table = _table("Differences", _difference_rows(found, labels))
    tables = [Table("Result", "", UNITS, results.drop(columns=empty)), differences_table]
    has_muds = any(headline["muds"] for headline in headlines)
    figures = [Figure("comparison", COMPARED, partial(draw_comparison, runs, headlines))] * has_muds
    described = [
        {"run": run.name, "robot": run.robot, "headline": headline}
        for run, headline in zip(runs, headlines, strict=True)
    ]
    summary = {"runs": described, "differences": found}
    return Result(tables, figures, summary, f"Comparison of {len(runs)} runs", texts)


def _comparison_sentences(
    runs: Sequence[Run], headlines: Sequence[Entry], labels: Mapping[str, str], found: Sequence[Entry]
) -> list[str]:
    """Say how fast each run was, and how many differences are larger than their uncertainty."""
    named = list(zip(labels.values(), headlines, strict=True))
    known = [f"{name} {each['speed_m_s'] / CM:z.1f} cm/s" for name, each in named if each["speed_m_s"] is not None]
    empty = [name for name, each in named if not each["strides"]]
    shown = f"{sum(map(bool, map(is_shown, found)))} of {counted(len(found), 'difference')} to {labels[runs[0].name]}"
    return [
        *end_sentences(runs),
        f"{counted(len(runs), 'run')}, {counted(sum(each['strides'] for each in headlines), 'stride')}.",
        *[f"Mean speeds: {', '.join(known)}."] * bool(known),
        *[f"No complete stride in {', '.join(empty)}."] * bool(empty),
        *[f"{shown} exceed {SHOWN:g} standard errors."] * bool(found),
    ]


def _difference_rows(found: Sequence[Entry], labels: Mapping[str, str]) -> list[dict[str, Any]]:
    verdicts = {None: "uncertainty not known", True: "differs", False: "no difference shown"}
    rows = []
    for each in found:
        per, unit = (CM, "cm/s") if each["quantity"] == SPEED else (N_CM3, "N/cm³")
        depth = ", at another depth" * (each["quantity"] != SPEED and not each["like_depths"])
        rows.append(
            {
                "run": labels[each["run"]],
                "mud": each["mud"],
                "quantity": f"{each['quantity']} ({unit})",
                "in the first run": value_text(each["first"], per=per),
                "in this run": value_text(each["other"], per=per),
                "difference": value_text(each["difference"], each["std_error"], per=per),
                "of the first": f"{100.0 * each['difference'] / abs(each['first']):+.0f} %" if each["first"] else "-",
                "verdict": verdicts[is_shown(each)] + depth,
            }
        )
    return rows
