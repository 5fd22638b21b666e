"""Student's factor: by how much a standard error from few values is too small for two of it to cover 95 %."""

from __future__ import annotations

from math import inf

from estimation.origin_fit import STUDENT


def student_factor(freedom: int) -> float:
    """Infinite where nothing tells the scatter."""
    if freedom < 1:
        return inf
    return STUDENT[freedom] if freedom < len(STUDENT) else 1.0 + 1.3 / freedom
