"""Runs the simulated robot and the daemon's own loop in one process, in step, as fast as they compute.

In every tick the robot simulates until the tick's time, then the loop runs exactly as in the daemon. All frames are
encoded and decoded.
"""

from collections.abc import Callable, Mapping
from typing import Any

from control.controller import WalkOrder
from control.modes import Mode, Request
from control.rate import PERIOD_S
from drivers.can.mock_bus import MockBus
from drivers.drive import DriveParameters
from drivers.drive_types import make_drives
from drivers.drives import Drives
from drivers.fault_injection.failing_port import failing_ports
from drivers.fault_injection.failing_pose import FailingPose
from drivers.fault_injection.failures import USUAL_S, Failures, begin_text, end_text
from drivers.pose.pose_port import PoseSource
from firmware_host.configuration.configuration import Configuration
from firmware_host.fault_injection.failing_host import FailingClock, FailingRecorder, Stalls
from firmware_host.log.recorder import NullRecorder, Recording
from firmware_host.loop import Loop
from firmware_host.ticker import Tick
from simulation.body.free_body import BodyShape
from simulation.body.plant_parameters import PlantParameters
from simulation.devices.drive import SimulatedDriveParameters
from simulation.devices.motion_capture import SimulatedPose
from simulation.devices.motion_capture_parameters import AT_EVERY_TICK, MotionCaptureParameters
from simulation.harness.robot import SimulatedRobot
from simulation.mud.disturbances import NONE, Disturbances, drive_changes
from simulation.mud.track import Track

FIXED_OF_DRIVE = frozenset(  # by the configuration
    {
        "type",
        "node_id",
        "sign",
        "zero_turn",
        "torque_constant_nm_a",
        "current_limit_a",
        "model",
        "serial_number",
        "velocity_range_rad_s",
        "torque_range_nm",
    }
)
GIVEN = FIXED_OF_DRIVE | {  # as far as its type has them
    "encoder_counts",
    "encoder_direction",
    "watchdog_s",
    "heartbeat_period_s",
}


def drives_of(configuration: Configuration, **changes: Any) -> dict[str, SimulatedDriveParameters]:
    """Return simulated drives with the configuration's ids, signs, zeros, models, heartbeats and torque constants."""
    return {joint: _drive_of(drive, changes) for joint, drive in configuration.drive.items()}


def _drive_of(drive: DriveParameters, changes: Mapping[str, Any]) -> SimulatedDriveParameters:
    """Return a drive whose motor has the calibrated torque constant, while it may state torque by another one."""
    given = {name: getattr(drive, name) for name in GIVEN if hasattr(drive, name)}
    known_nm_a = getattr(drive, "reported_constant_nm_a", drive.torque_constant_nm_a)
    stronger = drive.torque_constant_nm_a / known_nm_a * (1.0 + changes.get("torque_constant_error", 0.0))
    own = {"torque_constant_nm_a": known_nm_a, **changes, "torque_constant_error": stronger - 1.0}
    return SimulatedDriveParameters(**(given | own))


def plant_of(
    configuration: Configuration, disturbances: Disturbances = NONE, fixed_base: bool = False, **changes: Any
) -> PlantParameters:
    """Return mechanics that fit a configuration, with changes by name."""
    fitting: dict[str, Any] = {
        "rig": configuration.rig,
        "geometry": configuration.geometry,
        "arm_mass": configuration.arm,
        "disturbances": disturbances,
        "fixed_base": fixed_base,
        "body": BodyShape(axis_above_belly_m=configuration.geometry.axis_height_m),
    }
    return PlantParameters(**(fitting | changes))


class Lockstep:
    """Owns the common time of robot and loop. Disturbances change the mud and the drives.

    `plant` and `drives` replace those made from configuration, disturbances and base. `failures` make parts of the
    loop's side fail: `fail` starts them. The loop misses as many ticks as `late_ticks` says before its next one, wakes
    up late by `late_s`, less than a period, and the wall clock is ahead by `wall_offset_s`.
    """

    _kind_of_robot: type[SimulatedRobot] = SimulatedRobot

    def __init__(
        self,
        configuration: Configuration,
        track: Track,
        seed: int = 1,
        recorder: Recording | None = None,
        disturbances: Disturbances = NONE,
        fixed_base: bool = False,
        plant: PlantParameters | None = None,
        drives: Mapping[str, SimulatedDriveParameters] | None = None,
        motion_capture: MotionCaptureParameters = AT_EVERY_TICK,
        failures: Failures | None = None,
        period_s: float = PERIOD_S,
        buses: Mapping[str, Any] | None = None,
    ) -> None:
        """`buses`: others than the mock ones; of each the robot opens an end first, then the loop."""
        self.period_s = period_s
        self.late_ticks = 0
        self.wall_offset_s = 0.0
        self.buses = buses or {name: MockBus() for name in configuration.bus}
        self.robot = self._kind_of_robot(
            plant or plant_of(configuration, disturbances, fixed_base),
            track,
            drives or drives_of(configuration, **drive_changes(disturbances)),
            configuration.bus_of,
            {name: bus.open() for name, bus in self.buses.items()},
            seed,
        )
        pose: PoseSource = SimulatedPose(self.robot.plant, motion_capture, seed + 1)
        wall_clock = self._wall_s
        if failures is not None:
            pose, recorder = FailingPose(pose, failures), FailingRecorder(recorder or NullRecorder(), failures)
            wall_clock = FailingClock(wall_clock, failures)
        drives_of_loop = self._connect(configuration, failures)
        self.loop = Loop(configuration, drives_of_loop, pose, recorder, self._now_s, wall_clock, period_s)
        self._can_fail = failures is not None
        self.failures = failures or Failures(configuration.bus)
        self._stalls = Stalls(self.failures)
        self.tick_number = 0
        self.late_s = 0.0
        self.acts: list[Callable[[], None]] = []  # called in every step, after the robot's and before the loop's

    def _connect(self, configuration: Configuration, failures: Failures | None) -> Drives:
        """Return the loop's drives, at its ends of the buses."""
        wires = failing_ports({name: bus.open() for name, bus in self.buses.items()}, configuration.drive, failures)
        return make_drives(configuration.drive, wires, configuration.limits, configuration.watchdog_endpoints)

    @property
    def now_s(self) -> float:
        return self.tick_number * self.period_s + self.late_s

    def _now_s(self) -> float:  # a method, which a copy of the robot rebinds, unlike a lambda
        return self.now_s

    def _wall_s(self) -> float:
        return self.now_s + self.wall_offset_s

    def step(self) -> None:
        missed = int(self._stalls.next_s() / self.period_s) + self.late_ticks
        self.late_ticks = 0
        self.tick_number += 1 + missed
        self.robot.advance(self.now_s)
        for act in tuple(self.acts):
            act()
        for failure in self.failures.update(self.now_s):
            self.loop.events.report(self.now_s, end_text(failure))
        self.loop.tick(Tick(self.now_s, missed * self.period_s + self.late_s, self.tick_number, missed))

    def fail(self, component: str, kind: str, for_s: float = USUAL_S) -> None:
        """Make a component fail from the next tick on. Raises RuntimeError where it is refused."""
        refused = self.failures.refusal(component, kind, for_s) if self._can_fail else "no failures were given"
        if refused:
            raise RuntimeError(refused)
        self.loop.events.report(self.now_s, begin_text(component, kind, for_s, "lockstep"))
        self.failures.begin(component, kind, self.now_s, for_s)

    def run_for(self, duration_s: float) -> None:
        for _ in range(round(duration_s / self.period_s)):
            self.step()

    def run_until(self, done: Callable[[], bool], longest_s: float) -> bool:
        """Return whether `done` became true within `longest_s` of simulated time."""
        for _ in range(round(longest_s / self.period_s)):
            if done():
                return True
            self.step()
        return done()

    def arm(self, forced: str = "") -> None:
        """Go from power-on to holding the pose. Raises RuntimeError with the reason where that fails."""
        self.run_until(lambda: self.loop.mode is Mode.IDLE and not self.loop.faults.blocking(forced), 3.0)
        refused = self.loop.request(Request.ARM, self.now_s, forced=forced)
        if refused or not self.run_until(lambda: self.loop.mode is Mode.HOLD, 3.0):
            fault = self.loop.fault
            raise RuntimeError(refused or f"not armed: {fault.message if fault else self.loop.mode.name.lower()}")

    def walk(self, order: WalkOrder) -> None:
        """Start a walk. Raises RuntimeError where it is refused."""
        refused = self.loop.request(Request.WALK, self.now_s, order)
        if refused:
            raise RuntimeError(refused)
        self.step()
