"""The finding of the mud fit: its tables for the screen and for the page."""

from __future__ import annotations

from experiments.mud_fit.mud_fit import MudFitReport
from experiments.reports.mud_names import mud_label
from experiments.reports.text_tables import table
from experiments.trackway.paper_table import PAPER_TABLE
from experiments.trials.session import Finding, screen_finding


def fit_finding(report: MudFitReport) -> Finding:
    return screen_finding(report.experiment, report, fit_text(report))


def fit_text(report: MudFitReport) -> str:
    return "\n\n".join([_values_text(report), _cells_text(report), _damping_text(report)])


def _values_text(report: MudFitReport) -> str:
    best, present = report.fitted, report.present
    rows = [["", "fitted", "chi² within 1 of it", "present"]]
    for mud, strength_pa in best.strength_pa.items():
        low, high = best.strength_range_pa[mud]
        strength_range = f"{low:.0f} to {high:.0f} Pa"
        rows.append([mud_label(mud), f"{strength_pa:.0f} Pa", strength_range, f"{present.strength_pa[mud]:.0f} Pa"])
    rows.append(["rail damping", f"{best.rail_damping_n_s_m:g} N·s/m", "", f"{present.rail_damping_n_s_m:g} N·s/m"])
    rows.append(["chi²", f"{best.chi2:.2f}", "", f"{present.chi2:.2f}"])
    return "Fitted to the six fixed-depth cells of Table I\n" + table(rows)


def _cells_text(report: MudFitReport) -> str:
    rows = [["speed (cm/s)", "mud", "paper", "fitted", "present"]]
    for rule, row in report.fitted.cells.items():
        for mud, speed in row.items():
            paper, present = PAPER_TABLE[rule][mud], report.present.cells[rule][mud]
            rows.append([rule, mud_label(mud), f"{paper.mean:.1f} ± {paper.sd:.1f}", f"{speed:.2f}", f"{present:.2f}"])
    return table(rows)


def _damping_text(report: MudFitReport) -> str:
    rows = [["rail damping (N·s/m)", "least chi²"]]
    rows += [[damping, f"{chi2:.2f}"] for damping, chi2 in report.chi2_of_damping.items()]
    return table(rows)
