"""The finding of the fault matrix: its table for the screen and the page, and its picture."""

from functools import partial

from experiments.reports.text_tables import number, table
from experiments.trials.session import Ending, Finding, screen_finding
from verification.faults.matrix import FaultsReport

HEAD = (
    "fault", "reaction", "ok", "slowest (ticks)", "bound", "peak torque (N·m)", "energy (J)", "bound", "travel (rad)",
)  # fmt: skip


def faults_finding(report: FaultsReport) -> Finding:
    from verification.faults.plots import plot_faults  # matplotlib takes its time

    ending = Ending.DONE if report.ok == len(report.cells) else Ending.UNHEALTHY
    return screen_finding(report.experiment, report, faults_text(report), partial(plot_faults, report), ending)


def faults_text(report: FaultsReport) -> str:
    rows = [
        [
            row.mode_name,
            row.reaction.replace("_", " "),
            f"{row.ok}/{row.cells}",
            number(row.slowest_ticks, 0),
            number(row.bound_ticks, 0),
            number(row.peak_torque_nm, 2),
            number(row.energy_j, 2),
            number(row.energy_bound_j, 2),
            number(row.travel_rad, 2),
        ]
        for row in report.faults
    ]
    failed = [
        f"{cell.mode_name} in {cell.phase}, seed {cell.seed}: {'; '.join(cell.why)}"
        for cell in report.cells
        if not cell.ok
    ]
    different = [f"{name} with {report.settings.drive}: {text}" for name, text in report.differences.items()]
    return "\n".join([table([HEAD, *rows]), "", *different, *failed, f"{report.ok} of {len(report.cells)} cells ok"])
