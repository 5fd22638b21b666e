"""What the operating system has against a file, as a sentence for people."""

from __future__ import annotations

from pathlib import Path


def why_not(problem: OSError, place: Path | None = None) -> str:
    """Of a copy or a move, its target is named; the place where the problem names no file."""
    where, why = problem.filename2 or problem.filename or place, problem.strerror or str(problem)
    return f"{where}: {why}" if where else why
