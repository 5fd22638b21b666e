"""What the pages of muds' coefficients have in common: their tables, their remarks, and what their errors mean."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from experiments.reports.coefficient_table import error_text_table, mud_table
from experiments.reports.error_table import Row
from experiments.reports.mud_names import mud_key, mud_text
from experiments.study.notebook import Entry
from experiments.study.result import Table
from experiments.trials.estimation_methods import DEFAULT, configured_method
from experiments.trials.load_cell_truth import OTHER_PLATE
from experiments.trials.truth_file import TruthOfMud
from firmware_host.configuration.configuration import Configuration

TRUTHS = {
    "bed": "The load cell is a virtual one: it repeats each stroke with the flipper's own plate, to the same depth. "
    "Insertion and extraction follow the flipper's own arc, without the load on the plate's face, which is no part of "
    "k_p and k_e. (A leaning plate pushed straight down would read 4 % more k_p at 3 cm and 31 % at 5 cm.)",
    "file": f"The load cell is that of the file given with --truth. {OTHER_PLATE}",
}
KNOWN_BIAS = (
    "On a simulated fixed base without disturbances, k_e by the default method is 1 to 5 % above the load cell; for a "
    "simulated robot that walks it is off by -8 to +14 %, more in softer mud. On the fixed base about 1 % each comes "
    "from the load on the face, whose pressure is assumed to grow from zero at the surface; from the tare, which "
    "counts the insertion while the plate's lower corner is in the mud; and from the surface, found 0.2 mm too deep. "
    "k_p is 0 to 4 % too high at 3 to 5 cm, because of the same surface. The bias in real mud is not known."
)
WRONG_CONSTANTS = (
    "The torque constant of each simulated motor differs from the configured one by a random 3.2 % (one standard "
    "deviation), like the paper's motors. It shifts every measurement of a joint alike: the second ± includes it, the "
    "first one cannot show it."
)
UNCERTAINTIES = (
    "The first ± is one standard error from the scatter of the trials, with Student's factor: 6.5 for two trials, 2.2 "
    "for three. The second ± is what all trials have in common, as the daemon estimates it: torque constants (3.2 %), "
    "load on the face, tare, surface. Twice the sum of both contains the reading of a load cell on the flipper's own "
    "path in 19 of 20 cases or more. To compare muds of one robot, use the first alone. A single trial has one ± for "
    "everything. Repeatability is the standard deviation of the trials over their mean."
)
HEADING = "Coefficients ± one standard error of the trials ± one that all trials share; explained in the report"
ERRORS = "Median error of single strides against the load cell, in brackets the bias"
COMPARISON = "Comparison with the load cell"  # a part of the page


def truth_settings(
    settings: Mapping[str, Any], configuration: Configuration, truth: TruthOfMud | None, muds: Iterable[str]
) -> dict[str, Any]:
    """Return the part of a summary with the settings, and a sentence with the muds that a truth file lacks."""
    method = configured_method(configuration.estimation)
    missing = [mud_text(mud) for mud in muds if truth is not None and mud_key(mud) not in truth]
    return {
        "settings": {**settings, "method": method, "truth": "file" if truth else "bed"},
        "missing_truth": f"The file given with --truth says nothing of {', '.join(missing)}." if missing else "",
    }


def coefficient_tables(summary: Mapping[str, Any], section: str) -> list[Table]:
    """Return the tables of muds and errors; `section` is the part of the page with the muds."""
    tables = [Table("muds", HEADING, {}, mud_table(summary["muds"]), section)]
    errors: list[Row] = summary["errors"]
    return [*tables, Table("errors", ERRORS, {}, error_text_table(errors), COMPARISON)] if errors else tables


def error_paragraphs(settings: Mapping[str, Any]) -> list[str]:
    """Explain the errors, also those that the scatter of the trials does not show."""
    known = [KNOWN_BIAS] * (settings["method"] == DEFAULT)
    return [UNCERTAINTIES, *known, *[WRONG_CONSTANTS] * settings["simulated"]]


def remark_texts(remarks: Sequence[str], left_out: Mapping[str, Entry]) -> dict[str, str]:
    """Return the section with the remarks of all trials; nothing where there are none."""
    without = [": ".join([f"{key} was left out", *entry["why"]]) for key, entry in left_out.items()]
    sentences = [f"{remark.rstrip('.')}." for remark in [*remarks, *without]]
    return {"Remarks": "\n\n".join(sentences)} if sentences else {}
