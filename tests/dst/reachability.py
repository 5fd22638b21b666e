"""The limits of any program: which drives a command cannot reach, and whose torque is not ours.

The bounds of the promises follow from them. This module knows the schedule, not the robot's own state.
"""

from math import cos, inf, radians

from control.records import JOINTS
from drivers.drive_types import type_of
from drivers.fault_injection.failure_table import FailureKind
from drivers.fault_injection.failures import MOST_DELAY_S
from simulation.devices.drive import SimulatedDriveParameters
from tests.dst.operated_robot import OperatedRobot

WATCHDOG_S = 0.1
AFTERMATH_S = 0.03  # after a failure's end: delayed frames arrive, and lost requests are repeated
HEARTBEATS_S = 0.25  # until the loop has seen a drive in closed loop and has commanded it idle again
LONGEST_LAG_S = 0.02  # of a motor's current after its command
MASTER = "JOINT.master"  # while another program commands a drive, its torque is not ours
REPEAT_S = 0.1  # between two requests to go idle


class Reachability:
    """Owns the time at which each joint's commands were last disturbed."""

    def __init__(self, robot: OperatedRobot) -> None:
        self._robot = robot
        self._failures = robot.lockstep.failures
        self._period_s = robot.loop.period_s
        self._disturbed_s = [-inf] * len(JOINTS)
        self._foreign_s = [-inf] * len(JOINTS)
        self._late_s = -inf
        self._missed = robot.loop.missed_ticks
        drive = robot.loop.configuration.drive
        self._paths = [(f"bus.{drive[joint].bus}", joint, f"{joint}.command") for joint in JOINTS]
        # the drives' own resolution, to which a command is rounded, also that of no torque to a drive that others armed
        self.half_codes_nm = [0.5 * type_of(drive[joint]).gate_table(drive[joint]).torque_step_nm for joint in JOINTS]
        self._lags_s = self._current_lags_s()
        self._hastened_s = [-inf] * len(JOINTS)  # when a motor's current lost its lag
        self.stalled_s = 0.0  # since the start
        self.update()

    def update(self) -> None:
        """Call this before and after every tick.

        A failure lasts until the schedule ends it, also while the process stands still inside of a tick: the mechanics
        are ahead of the tick then.
        """
        now_s = max(self._robot.now_s, self._robot.lockstep.robot.now_s)
        missed = self._robot.loop.missed_ticks
        if missed != self._missed:
            self.stalled_s += (missed - self._missed) * self._period_s
            self._missed, self._late_s = missed, now_s
        self.cogging_nm = 2.0 * max(each.parameters.cogging_nm for each in self._robot.lockstep.robot.drives)
        lags_s = self._current_lags_s()
        for index, (before_s, lag_s) in enumerate(zip(self._lags_s, lags_s, strict=True)):
            if lag_s < before_s:
                self._hastened_s[index] = now_s
        self._lags_s = lags_s
        self.gains = [_gain(drive.parameters) for drive in self._robot.lockstep.robot.drives]
        for index, joint in enumerate(JOINTS):
            cut = bool(self._failures.failing) and any(self._cuts(component) for component in self._paths[index])
            self._disturbed_s[index] = _last_s(self._disturbed_s[index], cut, now_s)
            own = [each.mode.component for each in self._robot.active if each.mode and each.joint == joint]
            self._foreign_s[index] = _last_s(self._foreign_s[index], MASTER in own, now_s)

    def _current_lags_s(self) -> list[float]:
        return [drive.parameters.current_lag_s for drive in self._robot.lockstep.robot.drives]

    def _cuts(self, component: str) -> bool:
        failure = self._failures.of(component)
        return failure is not None and failure.kind in CUTTING

    def _recently(self, since_s: float, within_s: float) -> bool:
        return self._robot.lockstep.robot.now_s - since_s < within_s

    def longest_s(self, index: int, ticks: int) -> float:
        """Return how long a motor may keep its torque after the loop has taken it away."""
        if self.is_foreign(index):
            return inf
        if self._recently(self._disturbed_s[index], WATCHDOG_S + AFTERMATH_S) or self._recently(
            self._late_s, WATCHDOG_S + AFTERMATH_S
        ):
            return WATCHDOG_S + MOST_DELAY_S + AFTERMATH_S
        return ticks * self._period_s

    def longest_idling_s(self, index: int) -> float:
        """Return how long a drive may stay in closed loop after the loop has commanded it idle."""
        if self._recently(self._disturbed_s[index], HEARTBEATS_S + REPEAT_S):
            return inf
        return HEARTBEATS_S + REPEAT_S

    def bunched_s(self, index: int) -> float:
        """Return by how much the times between commands may shrink before they take effect."""
        late = self._recently(self._disturbed_s[index], AFTERMATH_S)
        hastened = self._recently(self._hastened_s[index], AFTERMATH_S)
        return self._period_s + (MOST_DELAY_S if late else 0.0) + (LONGEST_LAG_S if hastened else 0.0)

    def is_foreign(self, index: int) -> bool:
        """Return whether another program commands the drive's torque.

        Where the loop sends none, because the drive reports an error, its last torque stays until the drive's watchdog.
        """
        return self._recently(self._foreign_s[index], WATCHDOG_S + AFTERMATH_S)

    def is_energised_by_others(self, index: int) -> bool:
        return self._recently(self._foreign_s[index], HEARTBEATS_S + REPEAT_S)


def _last_s(before_s: float, lasts: bool, now_s: float) -> float:
    """Return when a failure last was active: for ever while it is."""
    return inf if lasts else min(before_s, now_s)


def _gain(parameters: SimulatedDriveParameters) -> float:
    """Return the motor's true torque for a commanded one."""
    return (1.0 + parameters.torque_constant_error) * cos(radians(parameters.commutation_error_deg))


CUTTING = (FailureKind.OFF, FailureKind.STUCK, FailureKind.SLOW, FailureKind.INTERMITTENT, FailureKind.BUS_OFF)
