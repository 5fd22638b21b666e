"""Converts estimates of the mud into plain dicts for JSON and MessagePack.

Units are in the names; None stands for a number that is not known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any

from control.mud_estimate import Coefficient, MudEstimate
from control.records import FLIPPERS, Estimate, StrideEstimate
from estimation.mud_map import Mapped, MapRow

COEFFICIENTS = ("k_p", "k_s", "k_e")


def known(value: float) -> float | None:
    """Return the number, or None if it is not finite."""
    return value if isfinite(value) else None


def estimate_report(estimate: Estimate) -> dict[str, Any]:
    return {
        "value": known(estimate.value),
        "std_error": known(estimate.std_error),
        "samples": estimate.samples,
        "valid": estimate.valid,
        "reason": estimate.reason,
        "at_least": estimate.at_least,
    }


JSON_NAMES = {"position_m": "place_m"}  # scripts read the older name


def stride_report(stride: StrideEstimate) -> dict[str, Any]:
    """Return a stride as `replay --json` and the status socket report it; k in N/m³."""
    report = {
        JSON_NAMES.get(name, name): known(value) if isinstance(value, float) else value
        for name, value in asdict(stride).items()
        if name not in COEFFICIENTS
    }
    return report | {name: estimate_report(getattr(stride, name)) for name in COEFFICIENTS}


def coefficient_report(coefficient: Coefficient | Mapped | None) -> dict[str, Any] | None:
    """Return the estimate of one coefficient; k in N/m³ at `depth_m`."""
    if coefficient is None:
        return None
    return {name: known(value) if isinstance(value, float) else value for name, value in coefficient._asdict().items()}


def mud_estimate_report(mud_estimate: MudEstimate) -> dict[str, Any]:
    """Return the estimate of both flippers together, and of each."""
    together = {name: coefficient_report(getattr(mud_estimate, name)) for name in COEFFICIENTS}
    apart = {
        flipper: {name: coefficient_report(getattr(mud_estimate.of(flipper), name)) for name in COEFFICIENTS}
        for flipper in FLIPPERS
    }
    return together | apart | {"boundary": mud_estimate.boundary}


def map_report(rows: Sequence[MapRow]) -> list[dict[str, Any]]:
    """Return one row for each piece of the track that a stride has measured."""
    return [
        {"place_m": row.position_m} | {name: coefficient_report(getattr(row, name)) for name in COEFFICIENTS}
        for row in rows
    ]


def check_item(identity: str, ok: bool, text: str, fix: str) -> dict[str, Any]:
    """Return one line of `mudskipper check`, with the fix if it is not ok."""
    return {"id": identity, "ok": ok, "text": text, "fix": "" if ok else fix}
