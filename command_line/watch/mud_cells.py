"""What the robot feels, as cells and texts: its coefficients, its strides, forces, and the mud along its path."""

from collections.abc import Sequence
from itertools import accumulate
from math import log
from typing import Any

from rich.text import Text

from command_line.robot_text import OLD, at_depth, cm, is_stale
from command_line.screen import coefficient
from command_line.watch.bars import BARS, bars
from command_line.watch.history import History
from control.records import COEFFICIENTS
from experiments.reports.text_tables import number

FORCES = {"forward": "force_x_n", "up": "force_z_n"}
LEAST_FORCE_N = 2.0  # that fills the height of its curve: noise looks like noise
TREND = 6  # strides that the trend shows
SIGNIFICANT = 2.0  # standard errors that a change must exceed
PIECE_M = 0.05  # of the mud along the path
MUD, BOUND = "#c08040", "yellow"
Report = dict[str, Any]
Row = list[Text]  # cells


def right(text: str, style: str = "") -> Text:
    return Text(text, style, justify="right")


def coefficient_rows(history: History, flippers: Sequence[str]) -> list[Row]:
    """Return a row for each coefficient: name, then estimate, change and the last strides of each flipper."""
    return [
        [Text(name, "dim"), *(cell for flipper in flippers for cell in _coefficient(history, flipper, name))]
        for name in COEFFICIENTS
    ]


def _coefficient(history: History, flipper: str, name: str) -> Row:
    estimate = history.status["mud"].get(flipper, {}).get(name)
    is_known = estimate and estimate["value"] is not None
    readings = [stride[name] for stride in history.of(flipper)][-TREND:]
    valid = [reading for reading in readings if reading["valid"]]
    floor = 2.0 * SIGNIFICANT * max((reading["repeatability"] or 0.0 for reading in valid), default=0.0)
    return [
        right(at_depth(estimate), BOUND if estimate["at_least"] else "") if is_known else right("-"),
        Text(trend(readings), "bold", justify="center"),
        Text(bars([reading["value"] for reading in valid], floor)[0], "cyan"),
    ]


def trend(readings: Sequence[Report]) -> str:
    """Return an arrow: whether the last valid reading differs from the one before by more than their errors."""
    valid = [reading for reading in readings if reading["valid"] and reading["value"] is not None]
    if len(valid) < 2:
        return " "
    before, last = valid[-2:]
    change = last["value"] - before["value"]
    error = (last["repeatability"] or 0.0) + (before["repeatability"] or 0.0)
    if abs(change) <= SIGNIFICANT * error:
        return "→"
    return "↗" if change > 0.0 else "↘"


def force_text(history: History, width: int) -> Text:
    """Return a line for each direction of the force: the curve of the last seconds on each flipper, and the newest."""
    flippers = list(history.status["loads"])
    room = max(width // len(flippers) - 19, 0)
    lines = []
    for direction, name in FORCES.items():
        line = Text()
        for index, flipper in enumerate(flippers):
            samples_n = history.forces_n(index, name, max(room, 1))
            stale = any(is_stale(each) for each in history.status["drives"] if each["joint"].startswith(flipper))
            line.append(f"{direction:8}", "bold")
            line.append(bars(samples_n, LEAST_FORCE_N)[0][:room].rjust(room), OLD if stale else "cyan")
            line.append(f"{number(samples_n[-1], 1):>7} N  ", OLD if stale else "")
        lines.append(line)
    return Text("\n", no_wrap=True, overflow="crop").join(lines)


def stride_rows(history: History) -> list[Row]:
    """Return a row for each stride that is remembered, the newest first."""
    return [
        [
            right(f"{stride['index']}"),
            Text(f" {stride['flipper']}"),
            *(right(coefficient(stride[name])) for name in COEFFICIENTS),
            *(right(cm(stride[name])) for name in ("depth_m", "chosen_depth_m")),
            right(cm(stride["step_m"])) if stride["released"] else right("stuck", "bold red"),
        ]
        for stride in reversed(history.strides)
    ]


def strip_text(history: History, width: int, names: Sequence[str]) -> Text:
    """Return coefficients along the path on logarithmic scales, above a scale with the robot's position."""
    pieces = {int(each["place_m"] // PIECE_M) for each in history.strides if each["place_m"] is not None}
    if not pieces:
        return Text("mud     no stride with a position yet" + "\n" * len(names), "dim")
    room = max(width - 8, 1)
    x_m = history.status["body_x_m"]
    last = max(*pieces, min(pieces) if x_m is None else int(x_m // PIECE_M))
    first = max(min(pieces), last - room + 1)
    cells = min(room // (last - first + 1), 6)
    scale = _scale(first, last, cells, x_m, room)
    rows = [Text.assemble((f"mud {name} ", "bold"), *_blocks(history, name, first, last, cells)) for name in names]
    return Text("\n", no_wrap=True, overflow="crop").join([*rows, Text.assemble("        ", scale)])


def _scale(first: int, last: int, cells: int, x_m: float | None, room: int) -> Text:
    """Return the ends of the shown path, the last one left of the robot's position if that is where it would stand."""
    start, end, length = f"{first * PIECE_M:.2f} m", f" {(last + 1) * PIECE_M:.2f} m", (last + 1 - first) * cells
    cell = -1 if x_m is None else int((x_m / PIECE_M - first) * cells)
    is_beside = length - len(end) <= cell and len(start + end) <= cell
    scale = Text(start.ljust((cell if is_beside else length) - len(end)) + end, "dim")
    if 0 <= cell < room:
        scale.pad_right(max(0, cell + 1 - len(scale)))
        scale = Text.assemble(scale[:cell], ("▲", "bold"), scale[cell + 1 :])
    return scale


def _blocks(history: History, name: str, first: int, last: int, cells: int) -> list[tuple[str, str]]:
    """Return the newest valid values by the logarithm, as muds differ by factors. One counts until the next."""
    newest = {
        int(stride["place_m"] // PIECE_M): stride[name]
        for stride in history.strides
        if stride["place_m"] is not None and stride[name]["valid"] and stride[name]["value"]
    }
    readings: list[Report | None] = list(
        accumulate(map(newest.get, range(first, last + 1)), lambda before, new: new or before)
    )
    logs = [log(reading["value"]) for reading in readings if reading]
    low, high = min(logs, default=0.0) - 0.35, max(logs, default=0.0) + 0.1  # little mud is not no mud
    blocks = []
    for reading in readings:
        block = "·"
        if reading:
            block = BARS[int((log(reading["value"]) - low) / (high - low) * len(BARS))]
        blocks.append((block * cells, BOUND if reading and reading["at_least"] else MUD))
    return blocks
