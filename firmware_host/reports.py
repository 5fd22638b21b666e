"""What the program knows, as plain dicts of numbers and strings for JSON and MessagePack: units in the names, None for
a number that is not known.
"""

from __future__ import annotations

from dataclasses import asdict
from math import isfinite
from typing import Any

from control.records import Estimate, StrideEstimate


def known(value: float) -> float | None:
    return value if isfinite(value) else None


def estimate_report(estimate: Estimate) -> dict[str, Any]:
    return {
        "value": known(estimate.value),
        "std_error": known(estimate.std_error),
        "samples": estimate.samples,
        "valid": estimate.valid,
        "reason": estimate.reason,
    }


def stride_report(stride: StrideEstimate) -> dict[str, Any]:
    """A stride as `replay --json` and the status socket tell it; k in N/m³."""
    report = {
        name: known(value) if isinstance(value, float) else value
        for name, value in asdict(stride).items()
        if name not in ("k_p", "k_s", "k_e")
    }
    return report | {name: estimate_report(getattr(stride, name)) for name in ("k_p", "k_s", "k_e")}


def check_item(identity: str, ok: bool, text: str, fix: str) -> dict[str, Any]:
    """One line of `mudskipper check`: fine, or what to do."""
    return {"id": identity, "ok": ok, "text": text, "fix": "" if ok else fix}
