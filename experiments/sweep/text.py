"""The finding of the depth sweep: its table for the screen and the page, and its picture."""

from functools import partial

from experiments.reports.text_tables import number, table
from experiments.sweep.sweep import SettledMethod, SweepReport
from experiments.trials.session import Finding, screen_finding


def sweep_finding(report: SweepReport) -> Finding:
    from experiments.sweep.plots import plot_sweep  # matplotlib takes its time

    return screen_finding(report.experiment, report, sweep_text(report), partial(plot_sweep, report))


def sweep_text(report: SweepReport) -> str:
    methods = report.settings.methods
    heads = [f"{method}: depth, speed (cm/s), % of best, failed" for method in methods]
    rows = [["strength", "best depth", "speed (cm/s)", *heads]]
    for mud in report.strengths:
        cells = [_cell(mud.methods[method]) for method in methods]
        rows.append([f"{mud.strength_pa:g} Pa", f"{mud.best.depth_cm:g} cm", f"{mud.best.mean:.2f}", *cells])
    title = "Speed at the best constant depth, and where each method settles (after its second stride)"
    return f"{title}\n{table(rows)}"


def _cell(settled: SettledMethod) -> str:
    failed = sum(settled.failures.values())
    fault = ", fault" if settled.faults else ""
    fraction = "-" if settled.fraction_of_best is None else f"{100.0 * settled.fraction_of_best:3.0f} %"
    return f"{number(settled.depth_cm, 2)} cm  {settled.mean:5.2f}  {fraction}  {failed}/{settled.strides}{fault}"
