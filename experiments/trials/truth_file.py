"""True coefficients of muds, taken from the summary of another experiment, such as a load cell's."""

import json
from pathlib import Path

from control.records import COEFFICIENTS
from experiments.reports.mud_names import mud_key
from experiments.robot.bench_errors import BenchError

TruthOfMud = dict[str, dict[str, float]]  # N/m³ by the mud's key and coefficient


def load_truth(path: Path) -> TruthOfMud:
    """Read another experiment's summary.json, or the one in a folder. A lower bound is no truth. Raises BenchError."""
    path = path / "summary.json" if path.is_dir() else path
    try:
        truth = {
            mud_key(mud["mud"]): {
                name: known["value"]
                for name in COEFFICIENTS
                if (known := mud.get(name)) and known.get("value") and not known.get("at_least")
            }
            for mud in json.loads(path.read_text(encoding="utf-8"))["muds"]
        }
        numbers = [value for mud in truth.values() for value in mud.values()]
        if not all(isinstance(value, int | float) and value > 0.0 for value in numbers):
            raise ValueError("coefficients must be numbers above 0")
    except (ValueError, KeyError, TypeError, AttributeError) as problem:
        raise BenchError(
            f"--truth {path} is no summary with coefficients of muds ({problem}): "
            "give the summary.json of 'mudskipper experiment loadcell'"
        ) from problem
    return truth


def truth_in(truth: TruthOfMud, mud: str) -> dict[str, float]:
    """Return the coefficients of one mud, however its name is written; nothing for an unknown mud."""
    return truth.get(mud_key(mud), {})
