"""Decodes the lines of a load cell's amplifier to readings, by a named format or by a pattern that the user gives.

There is no standard. Boards with an HX711 or ADS1232 print one number a line, bare or after a label. Weighing
indicators print their state, gross or net, sign, weight and unit, with blanks in arbitrary places (A&D and compatible
ones: `ST,GS,+  12.34kg`, where ST is stable, US unstable, OL overload). Loggers print columns. A cell beyond its range
prints letters or dashes in place of a number, or stays at the last count of its converter.
"""

import re
from collections.abc import Sequence
from math import isfinite, nan
from typing import NamedTuple

GRAVITY_M_S2 = 9.80665
NEWTONS = {  # per unit of weight or force; counts and mV/V need a calibration
    "n": 1.0,
    "mn": 1e-3,
    "kn": 1e3,
    "mg": 1e-6 * GRAVITY_M_S2,
    "g": 1e-3 * GRAVITY_M_S2,
    "kg": GRAVITY_M_S2,
    "lb": 0.45359237 * GRAVITY_M_S2,
}
COUNTS, RATIO = "counts", "mv/v"  # do not determine newtons
UNITS = (*NEWTONS, COUNTS, RATIO)
CONVERTER_ENDS = (float(2**23 - 1), float(-(2**23)))  # of 24 bits, as nearly all of these amplifiers have

_NUMBER = r"(?P<value>[+-]?[ ]*(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
_UNIT = r"(?P<unit>kg|mg|g|kN|mN|N|lb|mV/V|counts?)"
NUMBER, INDICATOR, COLUMN, AUTO = "number", "indicator", "column", "auto"
PATTERNS = {
    INDICATOR: rf"(?:ST|US|SD|WT|S|U) *,? *(?:GS|NT|GR|TR|G|N|NET|GROSS) *[,:]? *{_NUMBER} *{_UNIT}?",
    NUMBER: rf"(?:[A-Za-z][\w ./#()-]*[:=] *)?{_NUMBER} *{_UNIT}?",
}
COLUMNS = {f"{COLUMN}{number}": rf"{_NUMBER} *{_UNIT}?" for number in range(1, 10)}
FORMATS = f"{AUTO}, {', '.join(sorted(PATTERNS))}, {COLUMN}1 to {COLUMN}9, or a regular expression with (?P<value>...)"
OVERLOADED = re.compile(
    r"(?:OL|UL) *,.*|.*\b(?:OL|UL|OFL|UFL|OVER|UNDER|OVERLOAD|UNDERLOAD|OUT OF RANGE|E?RR?[ -]?\d+)\b.*"
    r"|[^0-9]*[-_=^~]{4,}.*",
    re.IGNORECASE,
)


class LineReading(NamedTuple):
    value: float  # in the unit of the line, or in the configured one; NaN where the cell is overloaded
    unit: str = ""  # in lower case; empty where the line has none


class LineFormat:
    """A format of lines: `number`, `indicator`, `column2` or a regular expression.

    Columns are separated by blanks, commas, semicolons or tabs; the first is 1. A regular expression matches the whole
    line, with a group named value and optionally one named unit.
    """

    def __init__(self, name: str) -> None:
        """Compile the format; raises ValueError for an unknown one."""
        named = PATTERNS | COLUMNS
        if name not in named and "(?P<value>" not in name:
            raise ValueError(f"format {name!r}: must be {FORMATS}")
        self.name, self._column = name, int(name[-1]) if name in COLUMNS else 0
        try:
            self._pattern = re.compile(named.get(name, name), re.IGNORECASE if name in named else 0)
        except re.error as problem:
            raise ValueError(f"format {name!r}: not a regular expression: {problem}") from problem

    def decode(self, line: bytes) -> LineReading | None:
        """Return the reading, or None where the line does not have this format."""
        text = printable(line)
        if text is None:
            return None
        match = self._pattern.fullmatch(_column(text, self._column) if self._column else text)
        if match is None:
            return LineReading(nan) if OVERLOADED.fullmatch(text) else None
        try:
            value = float(match["value"].replace(" ", ""))
        except ValueError:  # the user's pattern may match other text
            return None
        if not isfinite(value):
            return None
        unit = (match.groupdict().get("unit") or "").lower()
        unit = COUNTS if unit == "count" else unit
        at_end = unit in ("", COUNTS) and value in CONVERTER_ENDS
        return LineReading(nan if at_end else value, unit)


def _column(text: str, column: int) -> str:
    cells = [cell for cell in re.split(r"[,;\t ]+", text) if cell]
    return cells[column - 1] if column <= len(cells) else ""


def printable(line: bytes) -> str | None:
    """Return the line as stripped text, or None where it contains other bytes."""
    try:
        text = line.decode("ascii").strip()
    except UnicodeDecodeError:
        return None
    return text if text and all(letter.isprintable() or letter == "\t" for letter in text) else None


def find_format(lines: Sequence[bytes]) -> LineFormat | None:
    """Return the named format that decodes most of these lines, more than half; None where neither does.

    Columns are never chosen, because only the operator knows which one is the load.
    """
    best, most = None, len(lines) // 2
    for name in (INDICATOR, NUMBER):
        line_format = LineFormat(name)
        readable = sum(line_format.decode(line) is not None for line in lines)
        if readable > most:
            best, most = line_format, readable
    return best
