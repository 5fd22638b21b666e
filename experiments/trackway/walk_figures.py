"""Figures of an experiment's walks against time, from the logs in its folder: the paper's figure 8 B to E."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from experiments.pictures.recorded_walk import RecordedWalk, numbered_walk
from experiments.reports.mud_styles import file_name
from experiments.reports.report_page import Figure
from experiments.robot.log_copies import cut_log
from experiments.robot.prompt import Operator
from experiments.trackway.bench import LoggedTime
from firmware_host.log.log_folder import first_path, run_files
from firmware_host.log_reading.log_reader import LogError, read_log, read_logs

CAPTION = (
    "{}, as figure 8 B to E of the paper: forces, coefficients and depth, then position and steps, against time. The"
    " shade changes where the robot noticed another mud; 'mudskipper plot' draws the same of any walk."
)


def walk_figures(walks: Mapping[str, LoggedTime], folder: Path, operator: Operator) -> list[Figure]:
    """Make the figure of each walk whose log is there, and tell the operator why another walk has none."""
    from experiments.pictures.walk_plot import plot_walk  # matplotlib takes its time

    figures = []
    for key, logged in walks.items():
        try:
            walk = logged_walk(folder, logged)
        except LogError as problem:
            operator.report(f"{key} is not drawn: {problem}")
        else:
            figures.append(Figure(f"figure8_{file_name(key)}", CAPTION.format(key), partial(plot_walk, walk)))
    return figures


def logged_walk(folder: Path, logged: LoggedTime) -> RecordedWalk:
    """Read a walk from the segments of its log that hold it; others may be missing. Raises LogError."""
    run, from_s, to_s = logged
    segments = run_files(folder / first_path(folder, run).name)
    held = [path for path in segments if len(cut_log(read_log(path, from_s=from_s), from_s, to_s).ticks)]
    if not held:
        raise LogError(f"its log is not in {folder}")
    return numbered_walk(held[0], cut_log(read_logs(held, from_s=from_s), from_s, to_s))
