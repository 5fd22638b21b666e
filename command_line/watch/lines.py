"""Lines of styled text: what the panels write and a terminal shows. Nothing here knows a terminal's library."""

import textwrap
from collections.abc import Iterable, Sequence

Piece = tuple[str, str]  # a text and the name of its style, one of STYLES
Line = tuple[Piece, ...]
STYLES = {  # name -> style, as rich writes it
    "": "",
    "title": "bold",
    "dim": "dim",
    "good": "green",
    "warn": "yellow",
    "bad": "bold red",
    "alarm": "bold white on red",
    "ready": "bold black on green",
    "busy": "bold black on yellow",
    "plain": "reverse",
    "force": "cyan",
    "mud": "#c08040",
    "old": "dim italic",
}
BLOCKS = "▁▂▃▄▅▆▇█"


def length(line: Line) -> int:
    return sum(len(text) for text, _ in line)


def fit(line: Line, width: int) -> Line:
    """Cut or fill a line to this width; a cut line ends in an ellipsis."""
    missing = width - length(line)
    if missing >= 0:
        return (*line, (" " * missing, "")) if missing else line
    pieces: list[Piece] = []
    left = max(width - 1, 0)
    for text, style in line:
        pieces.append((text[:left], style))
        left -= len(text[:left])
    return (*pieces, ("…", "dim")) if width > 0 else ()


def column_width(columns: int, width: int) -> int:
    return (width - 2 * (columns - 1)) // columns


def side_by_side(lines: Sequence[Line], width: int) -> Line:
    """Put lines next to each other, each in its column; the last one gets the rest."""
    column = column_width(len(lines), width)
    pieces: list[Piece] = []
    for line in lines[:-1]:
        pieces += [*fit(line, column), ("  ", "")]
    return (*pieces, *fit(lines[-1], width - (column + 2) * (len(lines) - 1)))


def wrapped(text: str, style: str, width: int, indent: int = 0, longest: int = 2) -> list[Line]:
    """Break a text into at most `longest` lines, the first of them after an indent that is not written."""
    rows = textwrap.wrap(text, max(width, 8), initial_indent=" " * indent, max_lines=longest, placeholder=" …")
    if not rows:
        return []
    return [((rows[0][indent:], style),), *(((row, style),) for row in rows[1:])]


def aged(line: Line) -> Line:
    """Return the line in the style of values that are no longer true."""
    return tuple((text, "old") for text, _ in line)


def plain_text(lines: Iterable[Line]) -> str:
    return "\n".join("".join(text for text, _ in line).rstrip() for line in lines)


def sparkline(values: Sequence[float | None], width: int, low: float | None = None, high: float | None = None) -> str:
    """Draw the last `width` values from `low` to `high`, by default their own range; a space for an unknown one."""
    shown = list(values)[-width:] if width > 0 else []
    known = [value for value in shown if value is not None]
    low = min(known, default=0.0) if low is None else low
    high = max(known, default=0.0) if high is None else high
    return "".join(" " if value is None else _block(value, low, high) for value in shown)


def _block(value: float, low: float, high: float) -> str:
    fraction = (value - low) / (high - low) if high > low else 0.5
    return BLOCKS[min(max(int(fraction * len(BLOCKS)), 0), len(BLOCKS) - 1)]
