"""Robots in lockstep in which anything can fail: foreign frames on a bus, changed drives, moved joints, a dead loop.

`FailingRobot` is what every injector needs. `FaultBench` is the robot of the fault matrix: each of its steps is one
period of the loop, also while the loop is stalled and then misses that tick; an exception ends the loop in the same way
as in the daemon.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr
from dataclasses import replace
from io import StringIO
from random import Random
from typing import Any

from control.monitors.winding import Winding
from control.rate import PERIOD_S
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockPort
from drivers.fault_injection.failures import Failures, end_text
from firmware_host.configuration.configuration import Configuration
from firmware_host.daemon import end_safely
from firmware_host.log.recorder import HEALTHY, LogReport, NullRecorder
from firmware_host.ticker import Tick
from simulation.body.plant import Arm
from simulation.devices.drive import SimulatedDriveParameters
from simulation.devices.drive_types import make_simulated_drive
from simulation.devices.simulated_drive import SimulatedDrive
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import Track

Act = Callable[[], None]


class FailingRobot(Lockstep):
    """A robot in lockstep whose drives, joints and buses an injector can reach by the name of a joint."""

    def __init__(self, configuration: Configuration, track: Track, seed: int = 1, **options: Any) -> None:
        super().__init__(configuration, track, seed, failures=Failures(configuration.bus, seed), **options)
        self.late_acts: list[Act] = []  # called in every step after the loop's tick
        self._foreign_ports: dict[str, MockPort] = {}
        self._sound: dict[str, SimulatedDriveParameters] = {}  # of the drives that are changed
        self._changes: dict[str, list[dict[str, Any]]] = {}

    def step(self) -> None:
        super().step()
        for act in tuple(self.late_acts):
            act()

    @property
    def forced(self) -> str:
        """Return the fault to overrule, because the watchdog of a drive cannot be read; empty where it can."""
        known = all(drive.knows_watchdog for drive in self.loop.configuration.drive.values())
        return "" if known else "watchdog_unknown"

    def arm(self, forced: str = "") -> None:
        super().arm(forced or self.forced)

    def stall(self, ticks: int) -> None:
        """Make the loop miss its next ticks."""
        self.late_ticks += ticks

    def index_of(self, joint: str) -> int:
        return self.loop.configuration.rig.joints.index(joint)

    def drive(self, joint: str) -> SimulatedDrive:
        return self.robot.drives[self.index_of(joint)]

    def arm_of(self, joint: str) -> Arm:
        return self.robot.plant.arms[self.index_of(joint) // 2]

    def winding(self, joint: str) -> Winding:
        """Return the loop's thermal model of the winding, which takes seconds to warm up."""
        return self.loop.fault_monitor.joints[self.index_of(joint)].winding

    @contextmanager
    def drive_changed(self, joint: str, **changes: Any) -> Iterator[None]:
        """Change parameters of a simulated drive within this context. Several changes of one drive add up."""
        own = self._changes.setdefault(joint, [])
        if not own:
            self._sound[joint] = self.drive(joint).parameters
        own.append(changes)
        self._apply_changes(joint)
        yield
        own.remove(changes)
        self._apply_changes(joint)

    def change_drive(self, joint: str, **changes: Any) -> None:
        """Change parameters of a simulated drive for good."""
        if self._changes.get(joint):
            self._sound[joint] = replace(self._sound[joint], **changes)
            self._apply_changes(joint)
        else:
            self.drive(joint).parameters = replace(self.drive(joint).parameters, **changes)

    def _apply_changes(self, joint: str) -> None:
        merged: dict[str, Any] = {}
        for changes in self._changes[joint]:
            merged |= changes
        self.drive(joint).parameters = replace(self._sound[joint], **merged)

    @contextmanager
    def every_step(self, act: Act, late: bool = False) -> Iterator[None]:
        """Call `act` in every step within this context, before the loop's tick; `late`: after it."""
        acts = self.late_acts if late else self.acts
        acts.append(act)
        yield
        acts.remove(act)

    def send_foreign(self, joint: str, frame: Frame) -> None:
        """Send a frame on the bus of a joint's drive that is from neither drive nor loop."""
        bus = self.loop.configuration.drive[joint].bus
        if bus not in self._foreign_ports:
            self._foreign_ports[bus] = self.buses[bus].open()
        self._foreign_ports[bus].send(frame)

    def add_duplicate(self, joint: str, angle_rad: float) -> Act:
        """Connect a second drive with the joint's node id to its bus. Return its work in one step."""
        port = self.buses[self.loop.configuration.drive[joint].bus].open()
        duplicate = make_simulated_drive(self.drive(joint).parameters, Random(f"twin {joint}"))
        duplicate.reset(self.now_s)

        def live() -> None:
            duplicate.measure(angle_rad, 0.0)
            for frame in port.receive():
                for answer in duplicate.receive(frame, self.now_s):
                    port.send(answer)
            for frame in duplicate.cyclic_frames(self.now_s):
                port.send(frame)

        return live


class RowList(NullRecorder):
    """A recorder that stores the rows. Its writer reports what `reported` says."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, bytes]] = []
        self.reported = HEALTHY

    def report(self) -> LogReport:
        return self.reported

    def put(self, kind_index: int, payload: bytes) -> bool:
        self.rows.append((kind_index, payload))
        return True


class FaultBench(FailingRobot):
    """A failing robot that goes on while its loop is stalled or dead."""

    def __init__(self, configuration: Configuration, track: Track, seed: int) -> None:
        self.rows = RowList()
        super().__init__(configuration, track, seed, recorder=self.rows)
        self.loop_ticks = 0
        self._stalled_steps = 0  # coming periods in which the loop does nothing
        self.dead = False
        self.bug = ""  # the exception that ended the loop
        self._missed = 0

    def stall(self, ticks: int) -> None:
        self._stalled_steps = ticks

    def step(self) -> None:
        if not self._missed:
            self._stalled_steps += int(self._stalls.next_s() / PERIOD_S)
        self.tick_number += 1
        self.robot.advance(self.now_s)
        for act in tuple(self.acts):
            act()
        if self.dead:
            return
        if self._stalled_steps:
            self._stalled_steps -= 1
            self._missed += 1
            return
        self._tick()
        for act in tuple(self.late_acts):
            act()

    def _tick(self) -> None:
        for failure in self.failures.update(self.now_s):
            self.loop.events.report(self.now_s, end_text(failure))
        missed, self._missed = self._missed, 0
        self.loop_ticks += 1
        try:
            self.loop.tick(Tick(self.now_s, missed * PERIOD_S, self.tick_number, missed))
        except Exception as problem:  # noqa: BLE001 - the daemon catches every exception here as well
            self.bug, self.dead = f"{type(problem).__name__}: {problem}", True
            with redirect_stderr(StringIO()):
                end_safely(self.loop, problem)

    def torques_nm(self) -> list[float]:
        """Return the present torques of the motors."""
        return [drive.torque_nm(self.robot.now_s) for drive in self.robot.drives]
