"""Copies of a robot in lockstep, so that many tests can start from the same moment of one walk."""

import copyreg
from copy import deepcopy
from struct import Struct
from typing import TypeVar

from drivers.odrive import codec
from drivers.odrive05 import codec as codec05
from simulation.harness.lockstep import Lockstep

MESSAGES = [
    each for names in (vars(codec), vars(codec05)) for each in names.values() if isinstance(each, codec.Message)
]  # keys of tables, by identity

Robot = TypeVar("Robot", bound=Lockstep)
copyreg.pickle(Struct, lambda layout: (Struct, (layout.format,)))  # the layouts of rows, which refuse to be copied


def copy_of(robot: Robot) -> Robot:
    """Returns an independent robot in exactly the same state.

    Work that is not finished cannot be copied; finishing it in this tick changes no digit of its result.
    """
    robot.loop.learning.estimator.work.finish()
    shared = [robot.loop.configuration, robot.loop._tick_kind, *MESSAGES]
    return deepcopy(robot, {id(each): each for each in shared})
