"""A healthy joint, its monitor and one tick of it, for the tests of a joint's faults."""

from math import inf, radians
from typing import Any

from control.faults import Fault
from control.limits import JointRange
from control.monitors.joint_monitor import JointMonitor, TickFacts
from control.parameters.fault_bounds import FaultBounds
from control.parameters.joint_limits import JointLimits
from control.parameters.winding_parameters import WindingParameters
from control.rate import PERIOD_S
from control.records import DriveState, JointTarget

JOINT = "left_sweep"
NOW_S = 1000.0
LIMITS, BOUNDS, WINDING = JointLimits(), FaultBounds(), WindingParameters()
CURRENT_LIMIT_A, TORQUE_CONSTANT_NM_A = 12.0, 0.083
SPAN = JointRange(radians(-60.0), radians(60.0))


def make_monitor(
    bounds: FaultBounds = BOUNDS, limits: JointLimits = LIMITS, answers_only: bool = False, fastest_rad_s: float = inf
) -> JointMonitor:
    drive = (WINDING, CURRENT_LIMIT_A, TORQUE_CONSTANT_NM_A)
    return JointMonitor(JOINT, limits, SPAN, bounds, *drive, answers_only=answers_only, fastest_rad_s=fastest_rad_s)


def healthy(now_s: float = NOW_S, **changes: Any) -> DriveState:
    """Return the state of a drive that has just sent everything, with these changes."""
    state = DriveState(
        angle_rad=0.1,
        velocity_rad_s=0.0,
        angle_stamp_s=now_s,
        current_a=0.0,
        current_stamp_s=now_s,
        closed_loop=True,
        heartbeat_stamp_s=now_s,
        temperature_c=25.0,
        temperature_stamp_s=now_s,
        bus_voltage_v=24.0,
    )
    return state._replace(**changes)


def faults_of(
    monitor: JointMonitor,
    state: DriveState,
    now_s: float = NOW_S,
    torque_nm: float = 0.0,
    target: JointTarget | None = None,
    **changes: Any,
) -> list[Fault]:
    """Return the faults that the monitor finds in one tick, with these changes of the loop's state."""
    facts = TickFacts(now_s, PERIOD_S, True, True, False)._replace(**changes)
    faults = monitor.update(facts, state, torque_nm, target)
    assert all(fault.subject == JOINT for fault in faults)
    return faults


def names_of(monitor: JointMonitor, state: DriveState, now_s: float = NOW_S, **changes: Any) -> set[str]:
    return {fault.name for fault in faults_of(monitor, state, now_s, **changes)}
