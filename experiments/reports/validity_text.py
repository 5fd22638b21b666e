"""Says why coefficients have no valid value: a table shows a dash or brackets."""

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from control.records import COEFFICIENTS


def why_not_valid(strides: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return a sentence for each reason why a coefficient has no valid value in some of these reports of strides."""
    estimates = [(name, stride[name]) for stride in strides for name in COEFFICIENTS if stride[name]]
    counts = Counter((name, estimate["reason"]) for name, estimate in estimates if not estimate["valid"])
    of = Counter(name for name, _ in estimates)
    return [f"{name} is not valid in {count} of {of[name]}: {reason}." for (name, reason), count in counts.items()]
