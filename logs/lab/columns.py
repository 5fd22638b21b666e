"""Columns and states of the authors' CSV."""

from control.records import Phase

JOINT_COLUMNS = ("leftsweeping", "leftadduction", "rightsweeping", "rightadduction")  # in the order of JOINTS
WRITTEN_ORDER = (1, 0, 3, 2)  # the authors put adduction first
POSITION_COLUMNS = tuple(f"{joint}_pos" for joint in JOINT_COLUMNS)  # turns
CURRENT_COLUMNS = tuple(f"{joint}_curr" for joint in JOINT_COLUMNS)  # A
BACKWARD = "backward"  # setting of a walk whose stances sweep forward; 1 where this project wrote it
DEPTH_COLUMN = "insertiondepth"  # commanded, m; not in every log
BODY_COLUMNS = ("OptitrackPosition_x", "OptitrackPosition_y", "OptitrackPosition_z")
ORIENTATION_COLUMNS = tuple(f"OptitrackOrientation_{part}" for part in "xyzw")
READ_COLUMNS = (*POSITION_COLUMNS, *CURRENT_COLUMNS, DEPTH_COLUMN, *BODY_COLUMNS, *ORIENTATION_COLUMNS)

PHASES_BY_STATE = (Phase.REST, Phase.SWING, Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION, Phase.PAUSE)
STATE_OF_PHASE = {phase: state for state, phase in enumerate(PHASES_BY_STATE)} | {
    Phase.RECOVERY: 5,  # the authors have no such state; it is between extraction and swing, as their pauses are
    Phase.STROKE: 3,  # nor this one; most of it is a stance
}
PHASE_OF_STATE = {-1: Phase.REST, **dict(enumerate(PHASES_BY_STATE)), **dict.fromkeys((6, 7, 8), Phase.PAUSE)}

PAPER_CONSTANT_NM_A = 0.083  # of the authors' motors
