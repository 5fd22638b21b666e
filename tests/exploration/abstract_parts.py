"""Motion and fault detection without joints: the search decides what they report."""

from math import inf
from types import SimpleNamespace
from typing import Any

from control.controller import DAMPING_S, RESTING, SOFT_STOP_S, Controller, WalkOrder
from control.faults import Fault, FaultKind
from control.modes import ENERGISED, MOVING, Mode
from control.records import DriveStates, Joints, JointTargets, Torques, same_for_all
from firmware_host.fault_monitor import ARMING_S, FaultMonitor, MonitorInput
from firmware_host.ticker import Tick
from tests.exploration.abstract_drives import PERIOD_S, SILENT_HEARTBEATS
from tests.exploration.memory import Memory, World

LONGEST_HOLD_S = 3.0
TORQUE_NM = 0.1


class AbstractController(Controller):
    """Motion without joints: it is done when the world says so, and at the latest after the product's longest time."""

    def __init__(self) -> None:
        self.order, self.target = WalkOrder(0.03), RESTING
        self.recovery = SimpleNamespace(attempt=0, events="")  # type: ignore[assignment]
        self.done = False
        self.restore(Memory())

    def restore(self, memory: Memory) -> None:
        self._mode, self._since_s = memory.mode, memory.mode_ticks * PERIOD_S
        self.is_moving, self.cut_short = memory.moving, memory.cut_short

    @property
    def walk_finished(self) -> bool:
        return self._mode is Mode.WALKING and self.done

    @property
    def raised(self) -> bool:
        return self._mode is Mode.STOPPING and (self.done or self._since_s > SOFT_STOP_S)

    @property
    def settled(self) -> bool:
        return self._mode is Mode.DAMPING and (self.done or self._since_s > DAMPING_S)

    @property
    def rested(self) -> bool:
        return self._mode is Mode.HOLD and self._since_s > LONGEST_HOLD_S

    @property
    def followed_targets(self) -> JointTargets | None:
        return None

    @property
    def moving(self) -> bool:
        return self.is_moving

    @property
    def fault(self) -> Fault | None:
        return None

    def move(self, angles: Any, speed_rad_s: float = inf) -> None:
        self.is_moving = True

    def end_move(self) -> None:
        self.is_moving = False

    def is_up(self, states: DriveStates) -> bool:
        return True

    def step(
        self,
        dt_s: float,
        mode: Mode,
        states: DriveStates,
        trusted: Joints[bool] | None = None,
        elapsed_s: float = 0.0,
        sent_nm: Torques | None = None,
    ) -> Torques:
        if mode is not self._mode:
            self.cut_short = mode is Mode.HOLD and self._mode is Mode.WALKING
            self._mode, self._since_s, self.is_moving = mode, 0.0, False
        self._since_s += elapsed_s
        if self.is_moving:
            self._since_s, self.is_moving = 0.0, not self.done
        return same_for_all(TORQUE_NM)  # also in modes that permit none


class AbstractMonitor(FaultMonitor):
    """Detects the faults of the world, those that the drives report, and those of the lease and of arming."""

    def __init__(self) -> None:
        self.trusted = same_for_all(True)
        self.power_cut = ""
        self.world = World()
        self.found: list[Fault] = []

    def with_winding_heat(self, states: DriveStates) -> DriveStates:
        return states

    def with_probes(self, wanted: Torques, largest_nm: float) -> Torques:
        return wanted

    def update(self, tick: Tick, monitor_input: MonitorInput) -> list[Fault]:
        mode, states = monitor_input.mode, monitor_input.states
        closed = [state.closed_loop for state in states]
        kinds = list(self.world.faults)
        if monitor_input.lost_lease_holder:
            kinds.append(FaultKind.LEASE_LOST)
        oldest_s = min(state.heartbeat_stamp_s for state in states)
        if mode is not Mode.BOOT and tick.now_s - oldest_s > SILENT_HEARTBEATS * PERIOD_S:
            kinds.append(FaultKind.HEARTBEAT_SILENT)
        if mode in MOVING and not all(closed):
            kinds.append(FaultKind.DRIVE_DISARMED)
        if mode not in ENERGISED and any(closed) and self.world.heartbeat:  # it takes a few heartbeats
            kinds.append(FaultKind.DRIVE_ENERGISED)
        if mode is Mode.ARMING and tick.now_s - monitor_input.mode_since_s > ARMING_S and not all(closed):
            kinds.append(FaultKind.ARMING_FAILED)
        self.found = [kind.fault() for kind in dict.fromkeys(kinds)]
        return list(self.found)
