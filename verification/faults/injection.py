"""Injects a failure of the table into a robot in lockstep."""

from drivers.fault_injection.failure_table import FailureMode
from verification.faults import injectors, loop_injectors  # they register their acts
from verification.faults.failing_robot import FailingRobot

ACTS = injectors.ACTS
assert loop_injectors.nothing.__name__ in ACTS


def inject(robot: FailingRobot, mode: FailureMode, joint: str) -> injectors.Injection:
    """Return the context in which the failure lasts: one of `mudskipper fail`, a changed drive, or an act."""
    if mode.act:
        name, *arguments = mode.act
        return ACTS[name](robot, joint, *arguments)
    if mode.drive:
        return robot.drive_changed(joint, **mode.drive)
    return injectors.failing(robot, joint, mode.component, mode.kind)
