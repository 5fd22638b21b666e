"""The experiment as the command line runs it: measure, evaluate, and present the finding."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.loadcell.comparison import truth_rows
from experiments.loadcell.measurement import BenchSettings, measure_muds
from experiments.loadcell.recording import RAW
from experiments.loadcell.report import TITLE, make_sections, make_tables
from experiments.loadcell.trials import TrialPlan
from experiments.reports.report_page import Section
from experiments.reports.text_tables import text_of_tables
from experiments.trials.session import Finding, Session

TRUTH = "The same plate in even motion, without stage, cell and noise"


def run_loadcell(session: Session, plan: TrialPlan, bench: BenchSettings, flipper: Mapping[str, Any] | None) -> Finding:
    """`flipper` is the summary of a flipper experiment to compare with. Raises BenchError with what to do."""
    results, report = measure_muds(session, plan, bench, flipper)
    sections, tables = make_sections(results, plan), make_tables(results)
    if report.truth:
        rows = truth_rows(results.muds, report.truth)
        sections.append(Section("The simulated muds themselves", f"{TRUTH}.", rows=rows))
        tables.append((TRUTH, rows))
    text = "\n\n".join([text_of_tables(tables), *results.remarks])
    return Finding(report, TITLE, sections, text, [session.folder / RAW])
