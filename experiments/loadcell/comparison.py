"""Coefficients of muds by the load cell, compared with a flipper's and with the truth of simulated muds."""

import json
from collections.abc import Mapping
from math import hypot, isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple

from experiments.loadcell.analysis import COEFFICIENTS, MudCoefficient
from experiments.reports.mud_names import mud_key, mud_text
from experiments.reports.text_tables import Rows
from experiments.reports.value_text import N_CM3, miss_text, value_text
from experiments.robot.bench_errors import BenchError
from experiments.trials.load_cell_truth import TrueCoefficients

OTHER_PLATE = (
    "A load cell's plate is upright and goes down straight; a flipper's leans and moves along an arc, and in clay a "
    "coefficient belongs to plate, path, depth and speed. In the simulator's clay at 3 cm the flipper's trials have 8 "
    "to 12 % more true k_p than the paper's plate reads, 3 to 8 % less k_s, and k_e within 2 %. At equal depth and "
    "speed that is 5 to 6 % more k_p and 1 % of the others; the rest is 2 mm of depth and an edge that goes down and "
    "up at 0.14 to 0.16 m/s."
)


class Compared(NamedTuple):
    """One coefficient of one mud, by the flipper and by the load cell, in N/m³."""

    mud: str
    coefficient: str
    sensed: float
    sensed_std_error: float
    truth: float
    truth_std_error: float
    at_least: bool = False  # the flipper's value is a lower bound

    @property
    def ratio(self) -> float:
        return self.sensed / self.truth

    @property
    def ratio_std_error(self) -> float:
        return self.ratio * hypot(self.sensed_std_error / self.sensed, self.truth_std_error / self.truth)


def load_flipper(path: Path) -> dict[str, Any]:
    """Read the summary of a flipper experiment, or the one in a folder. Raises BenchError, OSError."""
    path = path / "summary.json" if path.is_dir() else path
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as problem:
        raise BenchError(f"{path} is no summary of an experiment: {problem}") from problem
    if not isinstance(summary, dict) or not isinstance(summary.get("muds"), list):
        raise BenchError(f"{path} has no muds: give the summary.json of `mudskipper experiment flipper`")
    return summary


def compare_muds(flipper: Mapping[str, Any] | None, muds: Mapping[str, Mapping[str, MudCoefficient]]) -> list[Compared]:
    """Pair the muds of equal name in a flipper's summary and in the load cell's results."""
    if flipper is None:
        return []
    sensed = {mud_key(str(row.get("mud"))): row for row in flipper["muds"] if isinstance(row, dict)}
    rows = []
    for mud, coefficients in muds.items():
        for name, truth in coefficients.items():
            estimate = sensed.get(mud_key(mud), {}).get(name)
            value, error = _value_of(estimate)
            if isfinite(value) and isfinite(truth.value):
                at_least = bool(estimate and estimate.get("at_least"))
                rows.append(Compared(mud, name, value, error, truth.value, truth.std_error, at_least))
    return rows


def _value_of(estimate: Any) -> tuple[float, float]:
    """Return value and standard error of an estimate in a summary, or NaN."""
    value = estimate.get("value") if isinstance(estimate, dict) else None
    if not isinstance(value, int | float) or not value > 0.0:
        return nan, nan
    error = estimate.get("std_error")
    return float(value), float(error) if isinstance(error, int | float) else 0.0


def truth_rows(muds: Mapping[str, Mapping[str, MudCoefficient]], truths: Mapping[str, TrueCoefficients]) -> Rows:
    """List the true values of simulated muds, and the relative errors of the measured ones."""
    head = ["mud", *(f"true {name} (N/cm³)" for name in COEFFICIENTS), *(f"{name} error" for name in COEFFICIENTS)]
    rows = [head]
    for mud, coefficients in muds.items():
        truth = truths[mud]._asdict()
        rows.append(
            [
                mud_text(mud),
                *(value_text(truth[name], per=N_CM3) for name in COEFFICIENTS),
                *(miss_text(coefficients[name].value, truth[name]) for name in COEFFICIENTS),
            ]
        )
    return rows
