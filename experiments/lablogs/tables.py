"""The evaluation of real logs as tables for the screen and as a page with figures."""

from experiments.lablogs.consistency import Counts
from experiments.lablogs.lab_trial import DELAY_S, METHODS, MISSING_ROWS
from experiments.lablogs.report import LablogsReport, MethodReport, Repeatability
from experiments.lablogs.sensitivity import MOVED, Moves, Ratios
from experiments.reports.error_table import COEFFICIENTS
from experiments.reports.text_tables import number
from experiments.reports.value_text import fraction_text, value_text
from experiments.study.result import Table, text_table

DEFINITIONS = (
    "first CV: coefficient of variation over trials of the first stroke's value. later CV: the same of each trial's "
    "geometric mean over its later strokes. chi: scatter over claimed error, between trials (first strokes) and "
    "between strokes (later ones, without the decline that the trials have in common); 1 is expected. Only trials of "
    "one flipper on a fixed base repeat a stroke.\n\n"
    "Left against right: median of the difference over its claimed error in the strides of walks; 0.67 is expected. "
    "In air every value and every bound is wrong. Lost: values that became invalid or a bound."
)
DISTURBED = (
    "Disturbed over recorded values, median and range; values that moved by more than "
    f"{MOVED:g} claimed errors; values lost by each disturbance"
)
FIGURES = {
    "strokes": "k_s by stroke and trial, with claimed errors.",
    "scatter": "Scatter over claimed error of first and of later strokes, next to the normal distribution.",
    "left_right": "The left against the right flipper in walks, with claimed errors.",
    "sensitivity": "Disturbed over recorded values.",
}


def tables_of(report: LablogsReport) -> list[Table]:
    """Return the tables of every method, and those of the logs."""
    methods = [table for method in METHODS if report.logs for table in _method_tables(method, report.of(method))]
    return [*methods, *_log_tables(report)]


def _method_tables(method: str, report: MethodReport) -> list[Table]:
    tables = {"Repeatability": _repeatability_rows(report)}
    if report.separation:
        tables["Separation of first strokes, in pooled standard deviations"] = _separation_rows(report)
    tables |= {"Left against right": _agreement_rows(report), "Values and bounds": _count_rows(report)}
    tables[DISTURBED] = _sensitivity_rows(report)
    found = report.contradictions["k_e"]
    tables["Bounds on k_e that contradict a neighbouring stride"] = [
        ["contradicting", "with a neighbour"],
        [str(found.contradicting), str(found.with_neighbour)],
    ]
    section = f"Method {method}"
    return [text_table(f"{method} {title}", f"{section}: {title}", rows, section) for title, rows in tables.items()]


def _repeatability_rows(report: MethodReport) -> list[list[str]]:
    heads = [
        "first mean (N/cm³)",
        "first CV",
        "later CV",
        "chi",
        "trials",
        "strokes",
        "n",
        "values",
        "bounds",
        "invalid",
    ]
    rows = [["group", "", *heads]]
    for group, coefficients in report.groups.items():
        rows += [[group, name, *_repeatability_cells(each)] for name, each in coefficients.items()]
    return rows


def _repeatability_cells(each: Repeatability) -> list[str]:
    variations = [fraction_text(each.first_cv), fraction_text(each.later_cv)]
    chis = [number(value, 2) for value in (each.chi, each.chi_between_trials, each.chi_between_strokes)]
    return [value_text(each.first_mean, per=1e6), *variations, *chis, str(each.n), *_count_cells(each)]


def _count_cells(counts: Counts) -> list[str]:
    return [str(counts.values), str(counts.bounds), str(counts.invalid)]


def _separation_rows(report: MethodReport) -> list[list[str]]:
    rows = [["groups", "", "separation", "trials"]]
    for each in report.separation:
        counts = " and ".join(map(str, each.n))
        rows.append([" - ".join(each.groups), each.coefficient, number(each.pooled_sd, 2), counts])
    return rows


def _agreement_rows(report: MethodReport) -> list[list[str]]:
    rows = [["", "median of |difference| / error", "strides"]]
    return rows + [[name, number(each.median, 2), str(each.n)] for name, each in report.left_right.items()]


def _count_rows(report: MethodReport) -> list[list[str]]:
    rows = [["", "logs", "strides", "", "values", "bounds", "invalid"]]
    for place, counts in (("in mud", report.mud), ("in air", report.air)):
        for name, each in counts.coefficients.items():
            rows.append([place, str(len(counts.logs)), str(counts.strides), name, *_count_cells(each)])
    return rows


def _sensitivity_rows(report: MethodReport) -> list[list[str]]:
    delay = f"{1000.0 * DELAY_S:g} ms"
    heads = [f"current {delay} late", f"{delay} early", f"{100.0 * MISSING_ROWS:g} % of rows missing", "lost"]
    rows = [["group", "", *heads]]
    for group, each in {"all in mud": report.sensitivity, **report.sensitivity.groups}.items():
        for name in COEFFICIENTS:
            late, early, missing = each.current_late[name], each.current_early[name], each.rows_missing[name]
            lost = ", ".join(str(effect.lost) for effect in (late, early, missing))
            if late.n + late.lost:
                rows.append([group, name, _ratio_cell(late), _ratio_cell(early), _move_cell(missing), lost])
    return rows


def _ratio_cell(ratios: Ratios) -> str:
    if ratios.median is None:
        return "-"
    return f"{ratios.median:.2f} ({ratios.smallest:.2f} to {ratios.largest:.2f})"


def _move_cell(moves: Moves) -> str:
    return f"{fraction_text(moves.moved)} of {moves.n}" if moves.n else "-"


def _log_tables(report: LablogsReport) -> list[Table]:
    rows = [["log", "group", "flippers", "base", "", "strides", "findings"]]
    for log in report.logs:
        base, mud = "fixed" if log.fixed_base else "free", "mud" if log.in_mud else "air"
        flippers, count = " and ".join(log.flippers), str(len(log.findings) or "-")
        rows.append([log.name, log.group or "-", flippers, base, mud, str(log.strides), count])
    findings = [[log.name, finding] for log in report.logs for finding in log.findings]
    refused = [[each.name, each.reason] for each in report.refused]
    tables = {"Logs": rows, "Findings": [["log", "finding"], *findings], "Not evaluated": [["log", "reason"], *refused]}
    return [text_table(title.lower(), title, cells, "Logs") for title, cells in tables.items() if len(cells) > 1]
