"""What every experiment gets from the command line, and what it gives back.

An experiment runs in a `Session`: a folder for its results, the operator at the robot, and a display of progress. It
ends with a `Finding`: the report for programs, sections for the page, and a text for the screen.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from experiments.reports.report_page import Figure, Section
from experiments.study.session import Ending as Ending
from experiments.study.session import Session as Session
from experiments.study.session import Show as Show


class Finding(NamedTuple):
    """The result of an experiment."""

    report: Any  # a record or a mapping that `to_json` accepts, with the name of the experiment
    title: str
    sections: Sequence[Section]
    text: str  # for the screen
    logs: Sequence[Path] = ()
    ending: Ending = Ending.DONE


def screen_finding(
    name: str, report: Any, text: str, plot: Callable[[Path], None] | None = None, ending: Ending = Ending.DONE
) -> Finding:
    """Make the finding of an experiment whose page shows the text of the screen and one picture."""
    figures = [] if plot is None else [Figure(name, "", plot)]
    section = Section("Result", screen=text, figures=figures)
    return Finding(report, f"Experiment: {name}", [section], text, ending=ending)
