"""The documented order of modes by how hard they stop the robot, and the mildest mode that each reaction permits."""

from control.faults import Reaction
from control.modes import Mode

HARDNESS = {Mode.WALKING: 0, Mode.HOLD: 1, Mode.STOPPING: 2, Mode.DAMPING: 3, Mode.FAULT: 4, Mode.IDLE: 4}
MILDEST = {
    Reaction.NONE: 0,
    Reaction.WARN: 0,
    Reaction.HOLD: 1,
    Reaction.SOFT_STOP: 2,
    Reaction.DAMPING: 3,
    Reaction.DRIVES_IDLE: 4,
}
