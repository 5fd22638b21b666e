"""What an experiment at a robot gets from the command line: a folder, the operator, and a display of progress."""

from collections.abc import Callable, Mapping
from enum import Enum, auto
from pathlib import Path
from typing import NamedTuple

from experiments.study.prompt import Operator

Show = Callable[[int, int], None]  # how many steps are done, of how many


class Session(NamedTuple):
    """The surroundings of one run of an experiment."""

    folder: Path  # exists
    operator: Operator
    show: Show
    socket: Path | None = None  # of the daemon that controls the robot; None where the robot is simulated
    simulated: bool = False
    program: Mapping[str, str] = {}  # version and sources, a part of every notebook's plan


class Ending(Enum):
    """How a finished experiment ends, for the exit status of its command."""

    DONE = auto()
    UNHEALTHY = auto()  # a check failed
    REFUSED = auto()  # something that was asked for was not done
