"""Strides as strips of pictures: the flipper in the mud from one insertion to the next, and the advance of the body."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.pictures.recorded_walk import RecordedWalk
from experiments.pictures.robot_sketch import body_position_m, draw_robot, prepare
from experiments.pictures.stride_choice import MOMENTS, Stride, moments_of, outcome_of, rows_of
from experiments.reports.style import INK, OUTCOME_COLOURS

DEEPEST_M, HIGHEST_M = 0.106, 0.146  # range of a row below and above the surface
SPACING_M = 0.235  # from one moment to the next
MARGIN_M = 0.09
LEAST_ARROW_M = 0.015
WIDTH_IN, HEAD_IN, FOOT_IN = 12.0, 0.36, 0.34
ARROW: dict[str, Any] = {"arrowstyle": "-|>", "color": INK, "shrinkA": 0.0, "shrinkB": 0.0, "linewidth": 1.2}
WITH_POSE = "Arrow: advance of the body since the start of the insertion.  Red line: path of the plate's lower edge."
WITHOUT_POSE = "Red line: path of the plate's lower edge.  This log has no position of the body."


def draw_strip(walk: RecordedWalk, strides: Sequence[Stride]) -> Figure:
    """Draw one row for each stride, with its moments from left to right."""
    shown = {moment.caption for stride in strides for moment in moments_of(walk, stride)}
    captions = [caption for caption, *_ in MOMENTS if caption in shown]
    farthest_m = max(_farthest_m(walk, stride) for stride in strides)
    width_m = 2.0 * MARGIN_M + SPACING_M * (len(captions) - 1) + farthest_m
    height_in = WIDTH_IN * (DEEPEST_M + HIGHEST_M) / width_m * len(strides) + HEAD_IN + FOOT_IN
    figure = Figure(figsize=(WIDTH_IN, height_in), layout="none")  # type: ignore[arg-type]  # a valid value
    panels = figure.subplots(len(strides), 1, squeeze=False)
    figure.subplots_adjust(0.0, FOOT_IN / height_in, 1.0, 1.0 - HEAD_IN / height_in, hspace=0.0)
    for panel, stride in zip(panels[:, 0], strides, strict=True):
        prepare(panel, -MARGIN_M, width_m - MARGIN_M, DEEPEST_M, HIGHEST_M)
        _draw_row(panel, walk, stride, captions)
    for column, caption in enumerate(captions):
        centre = (MARGIN_M + column * SPACING_M) / width_m, 1.0 - 0.65 * HEAD_IN / height_in
        figure.text(*centre, caption, size=13, ha="center", va="center", color=INK)
    legend = WITH_POSE if np.any(np.isfinite(walk.body_x_m)) else WITHOUT_POSE
    figure.text(0.012, 0.45 * FOOT_IN / height_in, legend, size=12, va="center", color=INK)
    return figure


def _farthest_m(walk: RecordedWalk, stride: Stride) -> float:
    """Return the largest advance of the body in a stride."""
    rows = rows_of(walk, stride)
    return max(body_position_m(walk, row) for row in rows) - body_position_m(walk, rows.start)


def _draw_row(panel: Axes, walk: RecordedWalk, stride: Stride, captions: Sequence[str]) -> None:
    """Draw each moment of a stride below its caption."""
    first = rows_of(walk, stride).start
    start_m = body_position_m(walk, first)
    _draw_title(panel, walk, stride)
    for caption, row in moments_of(walk, stride):
        begin_m = captions.index(caption) * SPACING_M
        draw_robot(panel, walk, range(first, row + 1), begin_m - start_m)
        if np.all(np.isfinite(walk.body_x_m[[first, row]])):
            _draw_advance(panel, begin_m, body_position_m(walk, row) - start_m)


def _draw_title(panel: Axes, walk: RecordedWalk, stride: Stride) -> None:
    outcome, corner = outcome_of(walk, stride), (0.018 - MARGIN_M, HIGHEST_M - 0.03)
    details = f"number {stride['index']}, {100.0 * stride['depth_m']:.1f} cm deep, at {stride['t_start_s']:.1f} s"
    title = panel.annotate(outcome.of_stride, corner, weight="bold", size=15, color=OUTCOME_COLOURS[outcome])
    after: dict[str, Any] = {"xycoords": (title, "data"), "xytext": (10, 0), "textcoords": "offset points"}
    panel.annotate(details, (1, corner[1]), size=12, color=INK, **after)


def _draw_advance(panel: Axes, start_m: float, advance_m: float) -> None:
    z_m = 0.033 - DEEPEST_M
    panel.plot([start_m, start_m], [z_m - 0.006, z_m + 0.006], color=INK, linewidth=1.2)
    if abs(advance_m) > LEAST_ARROW_M:
        panel.annotate("", (start_m + advance_m, z_m), (start_m, z_m), arrowprops=ARROW)
    text = f"{100.0 * advance_m:+.1f} cm"
    text = "0 cm" if text in ("+0.0 cm", "-0.0 cm") else text
    panel.text(start_m - 0.003, z_m - 0.009, text, size=12, va="top", color=INK)
