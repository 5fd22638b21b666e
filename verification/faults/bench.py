"""A robot in lockstep with hooks for every failure: foreign frames on a bus, a loop that stalls or dies, exceptions in
the loop, moved joints, a duplicate node id. An exception ends the loop in the same way as in the daemon.

Every step is one period of the loop, also while the loop is stalled; the loop then misses that tick.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr
from io import StringIO
from random import Random

from control.monitors.winding import Winding
from control.rate import PERIOD_S
from drivers.can.frames import Frame
from drivers.fault_injection.failures import Failures, end_text
from firmware_host.configuration.configuration import Configuration
from firmware_host.daemon import end_safely
from firmware_host.log.recorder import HEALTHY, LogReport, NullRecorder
from firmware_host.log.rows import EVENT, EVENT_KIND, TICK_KIND
from firmware_host.ticker import Tick
from simulation.body.plant import Arm
from simulation.devices.drive import SimulatedDrive
from simulation.devices.drive_types import make_simulated_drive
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import Track

Act = Callable[[], None]


class CountingRecorder(NullRecorder):
    """A Recording. Owns the count of the ticks' rows, the texts of the events, and the report of its writer."""

    def __init__(self) -> None:
        self.ticks = 0
        self.texts: list[str] = []
        self.reported = HEALTHY

    def report(self) -> LogReport:
        return self.reported

    def put(self, kind_index: int, payload: bytes) -> bool:
        if kind_index == TICK_KIND:
            self.ticks += 1
        elif kind_index == EVENT_KIND:
            self.texts.append(EVENT.decode(payload)["text"])
        return True


class FaultBench(Lockstep):
    def __init__(self, configuration: Configuration, track: Track, seed: int) -> None:
        self.rows = CountingRecorder()
        failures = Failures(configuration.bus, seed)
        super().__init__(configuration, track, seed, recorder=self.rows, failures=failures)
        self._foreign_ports = {name: bus.open() for name, bus in self.buses.items()}
        self._acts: list[Act] = []  # called in every step, after the robot's and before the loop's
        self._late_acts: list[Act] = []  # called after the loop's
        self.loop_ticks = 0
        self.stalled_steps = 0  # coming periods in which the loop does nothing
        self.dead = False
        self.bug = ""  # the exception that ended the loop
        self._missed = 0

    def step(self) -> None:
        if not self._missed:
            self.stalled_steps += int(self._stalls.next_s() / PERIOD_S)
        self.tick_number += 1
        self.robot.advance(self.now_s)
        for act in tuple(self._acts):
            act()
        if self.dead:
            return
        if self.stalled_steps:
            self.stalled_steps -= 1
            self._missed += 1
            return
        self._tick()
        for act in tuple(self._late_acts):
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

    @property
    def forced(self) -> bool:
        """Return whether the robot is armed by force, because the watchdog of a drive cannot be read."""
        return not all(drive.reports_settings for drive in self.loop.configuration.drive.values())

    def arm(self, forced: bool = False) -> None:
        super().arm(forced or self.forced)

    @contextmanager
    def every_step(self, act: Act, late: bool = False) -> Iterator[None]:
        """Call `act` in every step within this context; `late`: after the loop's tick."""
        acts = self._late_acts if late else self._acts
        acts.append(act)
        yield
        acts.remove(act)

    def send_foreign(self, joint: str, frame: Frame) -> None:
        """Sends a frame on the bus of a joint's drive that is from neither drive nor loop."""
        self._foreign_ports[self.loop.configuration.drive[joint].bus].send(frame)

    def index_of(self, joint: str) -> int:
        return self.loop.configuration.rig.joints.index(joint)

    def drive(self, joint: str) -> SimulatedDrive:
        return self.robot.drives[self.index_of(joint)]

    def arm_of(self, joint: str) -> Arm:
        return self.robot.plant.arms[self.index_of(joint) // 2]

    def winding(self, joint: str) -> Winding:
        """The loop's thermal model of the winding, which takes seconds to warm up."""
        return self.loop.fault_monitor.joints[self.index_of(joint)].winding

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

    def torques_nm(self) -> list[float]:
        """The present torques of the motors."""
        return [drive.torque_nm(self.robot.now_s) for drive in self.robot.drives]
