"""A flipper's coefficients of muds beside those of a load cell: rows of both by the names of the muds, and ratios."""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import hypot, isfinite
from pathlib import Path
from typing import Any, NamedTuple

from experiments.loadcell.fits import OfMud
from experiments.reports.mud_names import mud_key

OTHER_PLATE = (
    "A load cell's plate is upright and goes down straight; a flipper's leans and goes along an arc, and in clay a "
    "coefficient belongs to plate, way, depth and speed. In the simulator's clay at 3 cm the flipper's trials have 8 "
    "to 12 % more true k_p than the paper's plate reads, 3 to 8 % less k_s, and k_e within 2 %. At equal depth and "
    "speed that is 5 to 6 % more k_p and 1 % of the others; the rest is 2 mm of depth and an edge that goes down and "
    "up at 0.14 to 0.16 m/s."
)


class Compared(NamedTuple):
    mud: str
    coefficient: str
    sensed: float
    sensed_std_error: float
    truth: float
    truth_std_error: float
    at_least: bool = False  # the flipper felt no more than that the mud bears so much

    @property
    def ratio(self) -> float:
        return self.sensed / self.truth

    @property
    def ratio_std_error(self) -> float:
        return self.ratio * hypot(self.sensed_std_error / self.sensed, self.truth_std_error / self.truth)


class CompareError(Exception):
    """The flipper's results cannot be read; the text says why."""


def load_flipper(path: Path) -> dict[str, Any]:
    """The summary of the flipper experiment, or the folder that it is in. Raises CompareError, OSError."""
    path = path / "summary.json" if path.is_dir() else path
    try:
        reported = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as problem:
        raise CompareError(f"{path} is no summary of an experiment: {problem}") from problem
    if not isinstance(reported, dict) or not isinstance(reported.get("muds"), list):
        raise CompareError(f"{path} has no muds: give the summary.json of `mudskipper experiment flipper`")
    return reported


def compared_with(flipper: Mapping[str, Any] | None, muds: Mapping[str, Mapping[str, OfMud]]) -> list[Compared]:
    """Muds of the same name."""
    if flipper is None:
        return []
    sensed = {mud_key(str(row.get("mud"))): row for row in flipper["muds"] if isinstance(row, dict)}
    rows = []
    for mud, coefficients in muds.items():
        for name, truth in coefficients.items():
            reported = sensed.get(mud_key(mud), {}).get(name)
            value, error = _sensed(reported)
            if isfinite(value) and isfinite(truth.value):
                at_least = isinstance(reported, dict) and bool(reported.get("at_least"))
                rows.append(Compared(mud, name, value, error, truth.value, truth.std_error, at_least))
    return rows


def _sensed(reported: Any) -> tuple[float, float]:
    if (
        not isinstance(reported, dict)
        or not isinstance(reported.get("value"), int | float)
        or not reported["value"] > 0.0
    ):
        return float("nan"), float("nan")
    error = reported.get("std_error")
    return float(reported["value"]), float(error) if isinstance(error, int | float) else 0.0
