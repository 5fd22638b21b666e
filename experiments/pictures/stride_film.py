"""A walk as an animated GIF from the side in real time. The camera moves with the body, the scale with the mud."""

from collections.abc import Callable, Iterator, Sequence
from math import ceil, floor, hypot
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image  # comes with matplotlib

from control.records import Phase
from experiments.pictures.recorded_walk import RecordedWalk
from experiments.pictures.robot_sketch import body_position_m, draw_robot, prepare, view_of
from experiments.pictures.stride_choice import Stride, outcome_of, rows_of
from experiments.reports.style import FORCE, INK, OUTCOME_COLOURS, SURFACE
from logs.files.whole_files import whole_file

FRAMES_PER_S = 20  # GIF counts in hundredths of a second
DEEPEST_M, HIGHEST_M, HALF_WIDTH_M = 0.085, 0.135, 0.25
WIDTH_IN, DOTS_PER_INCH = 7.2, 100
MARK_M = 0.1  # between marks in the mud
FORCE_M_N = 0.008  # length of an arrow per newton
LEAST_FORCE_N = 0.4
COLOURS = 256  # all that a GIF can have
ARROW: dict[str, Any] = {"arrowstyle": "-|>", "color": FORCE, "shrinkA": 0.0, "shrinkB": 0.0, "linewidth": 2.4}

Show = Callable[[int, int], None]  # frames done and to do
Frame = tuple[Stride, int]  # a row of the walk, with its stride


def film_frames(walk: RecordedWalk, strides: Sequence[Stride]) -> list[Frame]:
    """Return the frames in real time, stride after stride."""
    frames: list[Frame] = []
    for stride in strides:
        rows = rows_of(walk, stride)
        stamps_s = np.arange(walk.time_s[rows.start], walk.time_s[rows.stop - 1], 1.0 / FRAMES_PER_S)
        frames += [(stride, int(row)) for row in np.searchsorted(walk.time_s, stamps_s)]
    return frames


def draw_film(walk: RecordedWalk, strides: Sequence[Stride], path: Path, show: Show) -> None:
    """Write a looping GIF. All frames are drawn on one figure."""
    height_in = WIDTH_IN * (DEEPEST_M + HIGHEST_M) / (2.0 * HALF_WIDTH_M)
    canvas: Any = FigureCanvasAgg(Figure(figsize=(WIDTH_IN, height_in), dpi=DOTS_PER_INCH))
    panel = canvas.figure.subplots()
    canvas.figure.subplots_adjust(0.0, 0.0, 1.0, 1.0)

    def picture(stride: Stride, row: int) -> Image.Image:
        panel.clear()
        _draw_frame(panel, walk, stride, row)
        canvas.draw()
        return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")

    frames = film_frames(walk, strides)
    palette = _palette([picture(*frame) for frame in _fullest_frames(walk, strides)])

    def pictures() -> Iterator[Image.Image]:
        for number, frame in enumerate(frames, 1):
            yield picture(*frame).quantize(palette=palette, dither=Image.Dither.NONE)
            show(number, len(frames))

    rest = pictures()
    with whole_file(path) as hidden, hidden.open("wb") as film:
        next(rest).save(film, "GIF", save_all=True, append_images=rest, duration=1000 // FRAMES_PER_S, loop=0)


def _fullest_frames(walk: RecordedWalk, strides: Sequence[Stride]) -> list[Frame]:
    """Return the frame with the largest force of each outcome; together they have all colours of the film."""
    one_of_each = {outcome_of(walk, stride): stride for stride in strides}.values()
    return [(stride, max(rows_of(walk, stride), key=lambda row: hypot(*_force_n(walk, row)))) for stride in one_of_each]


def _palette(pictures: Sequence[Image.Image]) -> Image.Image:
    """Return one palette for the whole film, so that colours do not flicker."""
    joined = Image.fromarray(np.hstack([np.asarray(picture) for picture in pictures]))
    return joined.quantize(COLOURS, Image.Quantize.MAXCOVERAGE)


def _force_n(walk: RecordedWalk, row: int) -> tuple[float, float]:
    """Return the forward and upward force; zero where it is unknown, such as upward in stance."""
    return float(np.nan_to_num(walk.force_x_n[row])), float(np.nan_to_num(walk.force_z_n[row]))


def _draw_frame(panel: Axes, walk: RecordedWalk, stride: Stride, row: int) -> None:
    position_m = body_position_m(walk, row)
    prepare(panel, position_m - HALF_WIDTH_M, position_m + HALF_WIDTH_M, DEEPEST_M, HIGHEST_M)
    for number in range(ceil((position_m - HALF_WIDTH_M) / MARK_M), floor((position_m + HALF_WIDTH_M) / MARK_M) + 1):
        panel.plot([number * MARK_M] * 2, [-DEEPEST_M, 0.012 - DEEPEST_M], color=SURFACE, linewidth=1.2)
        corner = (number * MARK_M + 0.004, 0.003 - DEEPEST_M)
        panel.text(*corner, f"{100.0 * number * MARK_M:.0f} cm", size=9, color=SURFACE, clip_on=True)
    draw_robot(panel, walk, range(rows_of(walk, stride).start, row + 1), 0.0)
    _draw_force(panel, walk, row)
    _draw_texts(panel, walk, stride, row)


def _draw_force(panel: Axes, walk: RecordedWalk, row: int) -> None:
    """Draw the force of the mud on the flipper at its lower edge."""
    force_n = _force_n(walk, row)
    if not (walk.depth_m[row] > 0.0 and hypot(*force_n) > LEAST_FORCE_N):
        return
    x_m, z_m = view_of(walk, row, 0.0).edge
    tip = (x_m + FORCE_M_N * force_n[0], z_m + FORCE_M_N * force_n[1])
    panel.annotate("", tip, (x_m, z_m), arrowprops=ARROW, zorder=5)


def _draw_texts(panel: Axes, walk: RecordedWalk, stride: Stride, row: int) -> None:
    outcome = outcome_of(walk, stride)
    texts = {
        0.02: (f"{outcome.of_stride} {stride['index']}", OUTCOME_COLOURS[outcome]),
        0.30: (Phase(int(walk.phase[row])).name.lower(), INK),
        0.48: (f"depth {100.0 * walk.depth_m[row]:.1f} cm", INK),
        0.70: (f"force {hypot(*_force_n(walk, row)):.1f} N", FORCE),
        0.88: (f"{walk.time_s[row]:.1f} s", INK),
    }
    for x, (text, colour) in texts.items():
        panel.text(x, 0.93, text, size=11, color=colour, transform=panel.transAxes, va="center")
