"""Reads the corners of a flipper's plate from a text file: one a line, outward and upward in m, # for comments."""

from pathlib import Path

from control.plate_outline import Corner, outline_problems

LARGEST_FILE_BYTES = 100_000


def read_corners(path: Path) -> tuple[Corner, ...]:
    """Raises ValueError, with the line, for a file that is not the outline of a plate."""
    try:
        with path.open("rb") as file:
            lines = file.read(LARGEST_FILE_BYTES).decode("utf-8-sig").splitlines()
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not a text file") from None
    numbered = ((number, line.partition("#")[0].strip()) for number, line in enumerate(lines, 1))
    corners = tuple(_corner(path, number, text) for number, text in numbered if text)
    problem = next(outline_problems(corners), "")
    if problem:
        raise ValueError(f"{path}: {problem}")
    return corners


def _corner(path: Path, number: int, text: str) -> Corner:
    try:
        outward_m, upward_m = (float(part) for part in text.replace(",", " ").split())
    except ValueError:
        raise ValueError(f"{path}, line {number}: {text}: must be two numbers in m, such as 0.0125, 0.07") from None
    return outward_m, upward_m
