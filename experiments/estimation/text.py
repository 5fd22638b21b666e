"""The finding of the estimation experiment: its tables for the screen and the page, and its picture."""

from collections.abc import Sequence
from functools import partial

from experiments.estimation.boundaries import BoundaryRow
from experiments.estimation.evaluation import EstimationReport
from experiments.reports.error_table import PlateRow
from experiments.reports.mud_names import mud_text
from experiments.reports.text_tables import number, table
from experiments.trials.session import Finding, screen_finding


def estimation_finding(report: EstimationReport) -> Finding:
    from experiments.estimation.plots import plot_errors  # matplotlib takes its time

    return screen_finding(report.experiment, report, estimation_text(report), partial(plot_errors, report))


def estimation_text(report: EstimationReport) -> str:
    heads = ["median", "p95", "bias", "in 95 %", "strides", "bounds", "hold", "not valid"]
    rows = [["setup", "mud", "", "method", *heads]]
    for row in report.errors:
        errors = [_percent(value) for value in (row.median, row.p95, row.bias, row.coverage)]
        counts = [str(row.strides), str(row.bounds), _percent(row.bounds_hold), str(row.not_valid)]
        rows.append([row.setup, mud_text(row.mud), row.coefficient, row.method, *errors, *counts])
    return "\n\n".join([table(rows), _plates_text(report.plates), _boundaries_text(report.boundaries)])


def _plates_text(plates: Sequence[PlateRow]) -> str:
    rows = [["setup", "mud", "", "upright / leaning plate", "estimate / upright", "fraction due to the lean"]]
    for row in plates:
        ratios = [number(row.upright_over_leaning), number(row.estimate_over_upright), _percent(row.lean_fraction)]
        rows.append([row.setup, mud_text(row.mud), row.coefficient, *ratios])
    return "The paper's upright plate (section II-E)\n" + table(rows)


def _boundaries_text(boundaries: Sequence[BoundaryRow]) -> str:
    if not boundaries:
        return "Mud boundaries: no walk over any"
    rows = [["from", "to", "transitions", "followed within two strides", "most strides"]]
    for row in boundaries:
        counts = [str(row.transitions), _percent(row.within_two), str(row.most_strides)]
        rows.append([mud_text(row.before), mud_text(row.after), *counts])
    return "Mud boundaries\n" + table(rows)


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.1f} %"
