"""Prints what a command reports as JSON for programs. An object names its shape and version under `schema`.

A version only grows by keys. A key that changes its meaning or goes away makes a new version. Lists stay lists.
docs/reference/json.md describes each shape.
"""

import json
from typing import Any

EXPERIMENTS = (
    "actuator",
    "estimation",
    "faults",
    "flipper",
    "lablogs",
    "loadcell",
    "mud-fit",
    "sweep",
    "trackway",
    "walk",
)
SCHEMAS = {  # what prints it -> version
    "status": 2,
    "failures": 1,
    "demo": 1,
    "replay": 1,
    "log-info": 1,
    "log-index": 1,
    "log-list": 1,
    "log-query": 1,
    "log-recover": 1,
    "log-report": 1,
    **{f"experiment-{name}": 1 for name in EXPERIMENTS},
}


def with_schema(name: str, report: dict[str, Any]) -> dict[str, Any]:
    """Raises KeyError for a shape that SCHEMAS does not list."""
    return {"schema": f"{name}/{SCHEMAS[name]}"} | report


def print_json(name: str, report: dict[str, Any]) -> None:
    print(json.dumps(with_schema(name, report)))
