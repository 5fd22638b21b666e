"""The errors of the estimated coefficients as a picture, by setup, coefficient, mud and method."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.estimation.evaluation import EstimationReport
from experiments.reports.error_table import COEFFICIENTS, ErrorRow
from experiments.reports.mud_names import mud_text

COLOURS = {"default": "tab:blue", "paper": "tab:red", "paper compensated": "tab:orange"}
HIGHEST_PERCENT = 150.0  # higher values are drawn at the edge


def plot_errors(report: EstimationReport, path: Path) -> None:
    """Draw median and 95th percentile of the error by setup, coefficient, mud and method."""
    errors = report.errors
    setups = list(dict.fromkeys(row.setup for row in errors))
    figure = Figure(figsize=(4.0 * len(COEFFICIENTS), 2.8 * len(setups)), layout="constrained")
    panels = figure.subplots(len(setups), len(COEFFICIENTS), squeeze=False)
    for row, setup in enumerate(setups):
        for column, name in enumerate(COEFFICIENTS):
            own = [each for each in errors if (each.setup, each.coefficient) == (setup, name)]
            _plot_panel(panels[row][column], own)
            panels[row][column].set_title(f"{setup}: ${name}$", fontsize="medium")
    methods = {
        name: line for panel in panels.flat for line, name in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(methods.values(), methods.keys(), loc="outside upper center", ncols=len(COLOURS), fontsize="small")
    for panel in panels[:, 0]:
        panel.set_ylabel("error (%)")
    figure.savefig(path, dpi=110)


def _plot_panel(panel: Axes, rows: Sequence[ErrorRow]) -> None:
    muds = list(dict.fromkeys(row.mud for row in rows))
    for method, colour in COLOURS.items():
        if method == "paper compensated" and rows and rows[0].coefficient != "k_s":
            continue  # it compensates k_s alone
        known = [row for row in rows if row.method == method and row.median is not None]
        xs = [muds.index(row.mud) for row in known]
        medians = [min(100.0 * (row.median or 0.0), HIGHEST_PERCENT) for row in known]
        highest = [min(100.0 * (row.p95 or 0.0), HIGHEST_PERCENT) for row in known]
        panel.vlines(xs, medians, highest, color=colour, linewidth=2)
        panel.plot(xs, medians, "o", color=colour, label=method)
    for x, mud in enumerate(muds):
        if any(row.mud == mud and row.method == "default" and row.bounds and not row.strides for row in rows):
            panel.text(x, 2.0, "bounds", ha="center", color=COLOURS["default"], fontsize="small")
    _scale(panel, muds)


def _scale(panel: Axes, muds: Sequence[str]) -> None:
    panel.axhline(10.0, color="grey", linewidth=0.8, linestyle=":")
    panel.set_xticks(range(len(muds)), list(map(mud_text, muds)))
    panel.set_xlim(-0.5, max(len(muds), 1) - 0.5)
    panel.set_ylim(0.0, HIGHEST_PERCENT)
    panel.set_yscale("symlog", linthresh=20.0)
    panel.set_yticks([0, 5, 10, 20, 50, 100], ["0", "5", "10", "20", "50", "100"])
    panel.set_xlabel("mud")
