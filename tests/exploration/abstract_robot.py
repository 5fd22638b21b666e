"""The product's loop with its modes, latch, lease and requests, in a world that an exhaustive search decides.

Loop, fault latch, lease, operator calls and the arming sequence are the product's own code. Only their inputs are
abstract: drives, motion and fault detection.
"""

from typing import Any

from control.faults import Fault
from control.modes import ENERGISED, Health, Mode
from control.records import NEVER_S
from drivers.pose.pose_port import NO_SOURCE
from firmware_host.configuration.loading import load_configuration
from firmware_host.log.recorder import NullRecorder
from firmware_host.loop import CLEARING_S, Loop
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.rpc import RefusedError
from firmware_host.ticker import Tick
from tests.exploration.abstract_drives import PERIOD_S, AbstractDrives, Event
from tests.exploration.abstract_parts import AbstractController, AbstractMonitor
from tests.exploration.memory import (
    CALL_S,
    CALLERS,
    NOW_S,
    Call,
    Memory,
    World,
    latched_faults,
    lease_memory,
    restore_lease,
    restored_latch,
)
from tests.folders import EXAMPLE_CONFIGURATION


class NoPose:
    def read(self, now_s: float) -> Any:
        return None

    def report(self) -> Any:
        return NO_SOURCE


class Silent:
    """Takes every call and does nothing: learning, events, timing."""

    def __getattr__(self, name: str) -> Any:
        return lambda *values, **named: None

    def pop_faults(self) -> list[Fault]:
        return []


class AbstractLoop(Loop):
    """The loop without log, learning and limits of torque."""

    def _record(self, tick: Tick, sent_s: float) -> None:
        pass


class AbstractRobot:
    """Owns the loop; restores a memory, lets one event happen, and reads the memory again."""

    def __init__(self) -> None:
        self.now_s = NOW_S
        self.drives = AbstractDrives()
        self.loop = self._make_loop()
        self.controller, self.monitor = AbstractController(), AbstractMonitor()
        self.loop.controller, self.loop.fault_monitor = self.controller, self.monitor
        self.loop.events = self.loop.learning = self.loop.timing = Silent()  # type: ignore[assignment]
        self.methods = OperatorCalls(self.loop, [], lambda: CALL_S).methods

    def _make_loop(self) -> Loop:
        configuration, clock = load_configuration(EXAMPLE_CONFIGURATION), lambda: self.now_s
        return AbstractLoop(configuration, self.drives, NoPose(), NullRecorder(), clock, clock, PERIOD_S)

    # events

    def call(self, call: Call) -> bool:
        """Let an operator call, and return whether the call is accepted."""
        caller = CALLERS[call.operator]
        self.now_s = CALL_S
        if call.method == "hang_up":
            self.loop.lease.hang_up(caller)
            return True
        if call.method == "end":
            self.loop.ending = True
            return True
        try:
            self.methods[call.method](dict(call.params), caller)
        except RefusedError:
            return False
        return True

    def tick(self, world: World) -> None:
        self.now_s = NOW_S + PERIOD_S
        self.monitor.world = world
        self.controller.done = world.done
        other = self.drives.other
        if world.event is not Event.NONE:
            other.closed = world.event is Event.CLOSES
        self.drives.begin_tick(self.now_s, world.obedience)
        self.drives.obedient.send_heartbeat()
        if world.heartbeat:
            other.send_heartbeat()
        else:
            other.miss_heartbeat()
        self.loop.tick(Tick(self.now_s, 0.0, 1, 0))

    # memory

    def restore(self, memory: Memory) -> None:
        loop = self.loop
        loop.mode, loop.pending_request, loop.forced, loop.ending = (
            memory.mode, memory.pending, memory.forced, memory.ending
        )  # fmt: skip
        loop._mode_since_s = NOW_S - memory.mode_ticks * PERIOD_S
        loop._clearing_until_s = CALL_S + CLEARING_S if memory.clearing else NEVER_S
        loop.sent = loop.nothing_sent
        self.controller.restore(memory)
        self.drives.obedient.restore(memory.obedient)
        self.drives.other.restore(memory.other)
        self.drives.abstract_gate.is_open = memory.mode in ENERGISED
        restore_lease(loop.lease, memory.lease)
        loop.faults = restored_latch(memory.faults)
        loop.health = Health(drives_heard=memory.mode is not Mode.BOOT, worst=loop.faults.worst)

    def memory(self) -> Memory:
        loop = self.loop
        passed_s = self.now_s - NOW_S if self.now_s != CALL_S else 0.0
        arming, since_s = loop.mode is Mode.ARMING, self.controller._since_s
        mode_s = NOW_S + passed_s - loop._mode_since_s if arming else since_s
        timed = loop.mode in (Mode.ARMING, Mode.HOLD, Mode.STOPPING, Mode.DAMPING)
        return Memory(
            mode=loop.mode,
            mode_ticks=min(round(mode_s / PERIOD_S), 4) if timed else 0,
            pending=loop.pending_request,
            forced=loop.forced,
            ending=loop.ending,
            clearing=loop._clearing_until_s >= NOW_S + PERIOD_S + passed_s,
            moving=self.controller.is_moving,
            cut_short=self.controller.cut_short,
            faults=latched_faults(loop.faults),
            lease=lease_memory(loop.lease, NOW_S + passed_s),
            obedient=self.drives.obedient.memory(arming),
            other=self.drives.other.memory(arming),
        )
