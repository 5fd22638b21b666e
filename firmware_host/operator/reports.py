"""Converts estimates of the mud and causes of faults into plain dicts for JSON and MessagePack.

Units are in the names; None stands for a number that is not known.
"""

from collections.abc import Sequence
from dataclasses import fields
from math import inf, isfinite
from typing import Any

from control.fault_causes import Cause
from control.faults import FaultKind
from control.mud_estimate import Coefficient, MudEstimate
from control.records import COEFFICIENTS, Estimate, FlipperLoad, Rig, StrideEstimate
from estimation.ground_law import LawEvidence
from estimation.mud_map import Mapped, MapRow

JSON_NAMES = {"position_m": "place_m"}  # scripts read the older name
STRIDE_NAMES = {
    field.name: JSON_NAMES.get(field.name, field.name)
    for field in fields(StrideEstimate)
    if field.name not in COEFFICIENTS
}


def known(value: float) -> float | None:
    """Return the number, or None if it is not finite."""
    return value if isfinite(value) else None


def estimate_report(estimate: Estimate | Coefficient | Mapped) -> dict[str, Any]:
    """Return the estimate of one coefficient; k in N/m³, at `depth_m` where it has one."""
    return {name: known(value) if isinstance(value, float) else value for name, value in estimate._asdict().items()}


def stride_report(stride: StrideEstimate) -> dict[str, Any]:
    """Return a stride as `replay --json` and the status socket report it; k in N/m³."""
    report: dict[str, Any] = {}
    for name, json_name in STRIDE_NAMES.items():
        value = getattr(stride, name)
        report[json_name] = known(value) if isinstance(value, float) else value
    return report | _coefficient_reports(stride)


def _coefficient_reports(record: object) -> dict[str, Any]:
    """Return the estimates of a record's three coefficients; None for one that is not known."""
    found = {name: getattr(record, name) for name in COEFFICIENTS}
    return {name: estimate and estimate_report(estimate) for name, estimate in found.items()}


def mud_estimate_report(mud_estimate: MudEstimate, rig: Rig) -> dict[str, Any]:
    """Return the estimate of all flippers together, and of each."""
    apart = {flipper: _coefficient_reports(mud_estimate.of(flipper)) for flipper in rig.flippers}
    return _coefficient_reports(mud_estimate) | apart | {"boundary": mud_estimate.boundary}


def law_report(evidence: LawEvidence | None) -> dict[str, Any] | None:
    return evidence and {"name": evidence.name, "errors": dict(evidence.errors)}


def load_report(load: FlipperLoad) -> dict[str, Any]:
    """Return the mud's load on one flipper."""
    return {name: known(value) for name, value in load._asdict().items()}


def map_report(rows: Sequence[MapRow]) -> list[dict[str, Any]]:
    """Return one row for each piece of the track that a stride has measured."""
    return [{"place_m": row.position_m} | _coefficient_reports(row) for row in rows]


def check_item(identity: str, ok: bool, text: str, fix: str, *, warns: bool = False) -> dict[str, Any]:
    """Return one line of `mudskipper check`, with the fix of what blocks arming, also by force, or is a warning."""
    return {
        "id": identity,
        "ok": ok,
        "warning": warns,
        "text": text,
        "fix": fix if warns or not ok else "",
        "mandatory": not ok,
        "cause": "",
    }


def cause_report(cause: Cause) -> dict[str, Any]:
    """Return a cause of faults in one sentence, with the names of the faults that follow from it."""
    consequences = dict.fromkeys(f"{each.fault.name} {each.fault.subject}".rstrip() for each in cause.consequences)
    return {
        "name": cause.root.name,
        "subjects": [each.fault.subject for each in cause.faults],
        "message": _cause_message(cause),
        "what_to_do": cause.root.kind.what_to_do,
        "age_s": cause.age_s,
        "reaction": cause.reaction.name.lower(),
        "blocks_arming": cause.blocks_arming,
        "consequences": list(consequences),
    }


def _cause_message(cause: Cause) -> str:
    text = cause.root.message.rstrip(".") + _silence_of_bus(cause)
    *first, last = [each.fault.subject for each in cause.faults]
    if not first:
        return f"{text}."
    others = [*first[1:], last]
    return f"{text}; likewise {', '.join(others[:-1])}{' and ' if others[1:] else ''}{last}."


def _silence_of_bus(cause: Cause) -> str:
    """For a bus: since when none of its silent drives was heard."""
    silent = [dict(each.fault.values) for each in cause.consequences if each.fault.kind is FaultKind.DRIVE_SILENT]
    ages_s = [float(values.get("age_s", inf)) for values in silent]
    shown = cause.root.kind.part == "bus" and ages_s and isfinite(min(ages_s))
    return f"; no frame for {min(ages_s):.1f} s" if shown else ""
