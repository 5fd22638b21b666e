"""Options that several commands on logs have."""

from pathlib import Path
from typing import Annotated, TypeAlias

from experiments.study.option import Option
from firmware_host.configuration.configuration import CaptureAxis

MOST = 100000
LogFiles: TypeAlias = Annotated[
    tuple[Path, ...], Option("log of this project, its segments, or a CSV file of the paper's authors")
]
Segments: TypeAlias = Annotated[
    tuple[Path, ...], Option("log of this project; several files are the segments of one run")
]
Vertical: TypeAlias = Annotated[
    CaptureAxis | None,
    Option("axis of a CSV log's motion capture that points up: x, y or z (default: y)", metavar="AXIS"),
]
Walk: TypeAlias = Annotated[int, Option("number of the walk (default: the last)", low=0, high=MOST)]
Folder: TypeAlias = Annotated[Path | None, Option("of the logs (default: the configured one)", metavar="DIR")]
