"""Figures of walks against time, from the logs of trials that a robot walked."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from experiments.pictures.recorded_walk import RecordedWalk, numbered_walk
from experiments.reports.mud_styles import file_name
from experiments.robot.log_copies import cut_log
from experiments.study.prompt import Operator
from experiments.study.result import Figure
from experiments.trackway.bench import LoggedTime
from firmware_host.log.log_folder import first_path
from logs.files.log_error import LogError
from logs.files.log_reader import read_log, read_logs
from logs.files.stored_logs import run_files

SECTION = "Walks against time"
AGAINST_TIME = (
    "{}, as figure 8 B to E of the paper: forces, coefficients and depth, then position and steps, against time. The"
    " shade changes where the robot noticed another mud; 'mudskipper plot' draws the same of any walk."
)


def walk_figures(walks: Mapping[str, LoggedTime], folder: Path, operator: Operator) -> list[Figure]:
    """Make the figure of each walk whose log is there, and report to the operator why another walk has none."""
    from experiments.pictures.walk_plot import draw_walk

    figures = []
    for key, logged in walks.items():
        try:
            walk = logged_walk(folder, logged)
        except LogError as problem:
            operator.report(f"{key} is not drawn: {problem}")
        else:
            figures.append(
                Figure(f"figure8_{file_name(key)}", AGAINST_TIME.format(key), partial(draw_walk, walk), SECTION)
            )
    return figures


def logged_walk(folder: Path, logged: LoggedTime) -> RecordedWalk:
    """Read a walk from the segments of its log that hold it; others may be missing. Raises LogError."""
    run, from_s, to_s = logged
    segments = run_files(folder / first_path(folder, run).name)
    held = [path for path in segments if len(cut_log(read_log(path, from_s=from_s), from_s, to_s).ticks)]
    if not held:
        raise LogError(f"its log is not in {folder}")
    return numbered_walk(held[0], cut_log(read_logs(held, from_s=from_s), from_s, to_s))
