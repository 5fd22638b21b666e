"""Messages for people about files that the operating system refuses."""

from pathlib import Path


def why_not(problem: OSError, place: Path | None = None) -> str:
    """Names the target of a copy or a move, or `place` where the problem names no file."""
    where, why = problem.filename2 or problem.filename or place, problem.strerror or str(problem)
    return f"{where}: {why}" if where else why
