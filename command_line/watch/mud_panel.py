"""What the robot feels: each coefficient of each flipper, the forces, and the mud along the way."""

from collections.abc import Sequence
from math import log
from typing import Any

from command_line.drive_state import is_stale
from command_line.watch.history import History
from command_line.watch.lines import Line, Piece, aged, column_width, fit, side_by_side, sparkline
from experiments.reports.text_tables import number
from experiments.reports.value_text import N_CM3, value_text

COEFFICIENTS = ("k_p", "k_s", "k_e")
TREND = 6  # strides that the trend shows
SIGNIFICANT = 2.0  # standard errors that a change must exceed
PIECE_M = 0.05  # of the strip
Report = dict[str, Any]


def coefficient_lines(history: History, width: int) -> list[Line]:
    """Return a head and one line for each coefficient, with the flippers side by side."""
    head: list[Line] = [((f"{flipper} (N/cm³)", "title"),) for flipper in history.flippers]
    rows = [[_coefficient(history, flipper, name) for flipper in history.flippers] for name in COEFFICIENTS]
    return [side_by_side(parts, width) for parts in [head, *rows]]


def _coefficient(history: History, flipper: str, name: str) -> Line:
    estimate = history.status["mud"][flipper][name]
    readings = [stride[name] for stride in history.of(flipper)][-TREND:]
    values = [reading["value"] if reading["valid"] else None for reading in readings]
    return (
        (f"{name} ", "dim"),
        (f"{_estimate_text(estimate):>17} ", "warn" if estimate and estimate["at_least"] else ""),
        (f"{trend(readings)} ", "title"),
        (sparkline(values, TREND), "mud"),
    )


def _estimate_text(estimate: Report | None) -> str:
    if estimate is None or estimate["value"] is None:
        return "-"
    bound = "≥ " if estimate["at_least"] else ""
    return bound + value_text(estimate["value"], estimate["std_error"], per=N_CM3)


def trend(readings: Sequence[Report]) -> str:
    """Return an arrow: whether the last valid reading differs from the one before by more than their errors."""
    valid = [reading for reading in readings if reading["valid"] and reading["value"] is not None]
    if len(valid) < 2:
        return " "
    before, last = valid[-2:]
    change = last["value"] - before["value"]
    error = (last["std_error"] or 0.0) + (before["std_error"] or 0.0)
    if abs(change) <= SIGNIFICANT * error:
        return "→"
    return "↗" if change > 0.0 else "↘"


def force_lines(history: History, width: int) -> list[Line]:
    """Return a line for each direction: forward, and up."""
    rows = (("forward", "force_x_n"), ("up", "force_z_n"))
    part = column_width(len(history.flippers), width)
    lines = [[_force(history, flipper, title, force, part) for flipper in history.flippers] for title, force in rows]
    return [side_by_side(parts, width) for parts in lines]


def _force(history: History, flipper: str, title: str, force: str, width: int) -> Line:
    samples = list(history.forces[f"{flipper} {force}"])
    text = f"{number(samples[-1], 1):>6} N"
    room = max(width - len(text) - 9, 0)
    line: Line = ((f"{title:8}", "dim"), (f"{sparkline(samples, room):{room}} ", "force"), (text, ""))
    drives = [drive for drive in history.status["drives"] if drive["joint"].startswith(flipper)]
    return aged(line) if any(map(is_stale, drives)) else line


def strip_lines(history: History, width: int, names: Sequence[str] = ("k_s",)) -> list[Line]:
    """Return the mud along the way: a row of blocks for each coefficient, and a scale with the robot's position."""
    pieces = _pieces(history.strides)
    if not pieces:
        return [(("mud     ", "title"), ("no stride with a position yet", "dim")), *((),) * len(names)]
    first, last = min(pieces), max(pieces)
    room = max(width - 8, 1)
    cells = max(1, min(room // (last - first + 1), 6))
    first = max(first, last - room // cells + 1)
    shown = range(first, last + 1)
    rows: list[Line] = []
    for name in names:
        readings = _carried([pieces.get(i, {}).get(name) for i in shown])
        rows.append(((f"mud {name} ", "title"), *_strip(readings, cells)))
    return [*rows, _scale(history.status["body_x_m"], first, last, cells, room)]


def _pieces(strides: Sequence[Report] | Any) -> dict[int, dict[str, Report]]:
    """Return the newest valid reading of each coefficient in each piece of the track."""
    pieces: dict[int, dict[str, Report]] = {}
    for stride in strides:
        if stride["place_m"] is not None:
            readings = {name: stride[name] for name in COEFFICIENTS if stride[name]["valid"] and stride[name]["value"]}
            pieces.setdefault(int(stride["place_m"] // PIECE_M), {}).update(readings)
    return pieces


def _carried(readings: Sequence[Report | None]) -> list[Report | None]:
    """Let a reading count until the next one: a step is longer than a piece."""
    carried: list[Report | None] = []
    for reading in readings:
        carried.append(reading or (carried[-1] if carried else None))
    return carried


def _strip(readings: Sequence[Report | None], cells: int) -> list[Piece]:
    """Draw by the logarithm: muds differ by factors. A lower bound is drawn in another style."""
    logs = [log(reading["value"]) if reading and reading["value"] > 0.0 else None for reading in readings]
    known = [value for value in logs if value is not None]
    low, high = min(known, default=0.0) - 0.35, max(known, default=0.0) + 0.1  # little mud is not no mud
    strip = []
    for reading, value in zip(readings, logs, strict=True):
        block = "·" if value is None else sparkline([value], 1, low, high)
        strip.append((block * cells, "warn" if reading and reading["at_least"] else "mud" if reading else "dim"))
    return strip


def _scale(x_m: float | None, first: int, last: int, cells: int, room: int) -> Line:
    width = (last - first + 1) * cells
    scale = list(f"{f'{first * PIECE_M:.2f} m':<{width}}")
    end = f"{(last + 1) * PIECE_M:.2f} m"
    if width >= len(end) + 8:
        scale[-len(end) :] = end
    if x_m is not None:
        cell = int((x_m / PIECE_M - first) * cells)
        if 0 <= cell < len(scale):
            scale[cell] = "▲"
        elif cell < room:
            scale += " " * (cell - len(scale)) + "▲"
    return fit((("        ", ""), ("".join(scale), "dim")), room + 8)
