"""Coefficients of muds by the load cell, compared with those that a flipper felt."""

import json
from collections.abc import Mapping
from math import hypot, isfinite
from pathlib import Path
from typing import Any

from experiments.loadcell.analysis import MudCoefficient
from experiments.reports.mud_names import mud_key
from experiments.study.option import OptionError


def load_flipper(path: Path) -> dict[str, Any]:
    """Read the summary of a flipper experiment, or the one in a folder. Raises OptionError, OSError."""
    path = path / "summary.json" if path.is_dir() else path
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as problem:
        raise OptionError(f"{path} is no summary of an experiment: {problem}") from problem
    if not isinstance(summary, dict) or not isinstance(summary.get("muds"), list):
        raise OptionError(f"{path} has no muds: give the summary.json of `mudskipper experiment flipper`")
    return summary


def compare_muds(flipper: Mapping[str, Any], muds: Mapping[str, Mapping[str, MudCoefficient]]) -> list[dict[str, Any]]:
    """Return a row for each coefficient that both measured, in N/m³. `flipper` is a summary, or empty."""
    sensed = {mud_key(str(row.get("mud"))): row for row in flipper.get("muds", ()) if isinstance(row, dict)}
    rows = []
    for mud, name, truth in ((mud, name, each) for mud, of_mud in muds.items() for name, each in of_mud.items()):
        estimate: Any = sensed.get(mud_key(mud), {}).get(name)
        value = estimate.get("value") if isinstance(estimate, dict) else None
        if isinstance(value, int | float) and value > 0.0 and isfinite(truth.value):
            error, ratio = estimate.get("std_error") or 0.0, value / truth.value
            rows.append(
                {
                    "mud": mud,
                    "coefficient": name,
                    "sensed": value,
                    "sensed_std_error": error,
                    "truth": truth.value,
                    "truth_std_error": truth.std_error,
                    "at_least": bool(estimate.get("at_least")),  # the flipper's value is a lower bound
                    "ratio": ratio,
                    "ratio_std_error": ratio * hypot(error / value, truth.std_error / truth.value),
                }
            )
    return rows
