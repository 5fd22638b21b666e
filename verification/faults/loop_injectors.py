"""Acts of failures in the loop and around it: stalls, bugs, modelled heat, lease, log, stamps of frames, daemon."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from control.computing.bounded_work import finished
from control.modes import Mode, Request
from control.records import Estimate, StrideEstimate
from drivers.can.frames import Frame
from drivers.can.stamp_clock import StampClock
from estimation.mud import Sampled
from verification.faults.failing_robot import FailingRobot, FaultBench
from verification.faults.injectors import during, once

ARRIVED_BEFORE_S = 0.0005  # a read


@once
def nothing(robot: FailingRobot, joint: str) -> None:
    """Inject no failure: the control group."""


@once
def lease_hung_up(robot: FailingRobot, joint: str) -> None:
    """Close the connection of the lease holder; where torque is off, right after a request to arm."""
    robot.loop.lease.renew("operator", robot.now_s, 10.0)
    if robot.loop.mode is Mode.IDLE:
        robot.loop.request(Request.ARM, robot.now_s, forced=robot.forced)
    robot.loop.lease.hang_up("operator")


@during
def writer_reports(bench: FaultBench, joint: str, changes: Mapping[str, Any]) -> Iterator[None]:
    before = bench.rows.reported
    bench.rows.reported = before._replace(**changes)
    yield
    bench.rows.reported = before


@once
def writer_lost_rows(bench: FaultBench, joint: str) -> None:
    bench.rows.reported = bench.rows.reported._replace(dropped=bench.rows.reported.dropped + 3)


@once
def port_lost_frames(robot: FailingRobot, joint: str) -> None:
    """Lose frames in the port below the one that injects failures."""
    port = robot.loop.drives.ports[robot.loop.configuration.drive[joint].bus]
    vars(port).get("_port", port).lost_frames += 3


@once
def heated(robot: FailingRobot, joint: str, temperature_c: float) -> None:
    """Set the modelled temperature, which then falls at the model's own rate."""
    robot.winding(joint).temperature_c = temperature_c


@during
def gains_changed(robot: FailingRobot, joint: str, changes: Mapping[str, float]) -> Iterator[None]:
    controller = robot.loop.controller
    before = controller.gains
    controller.gains = replace(before, **changes)
    yield
    controller.gains = before


@once
def sent_torque(robot: FailingRobot, joint: str, torque_nm: float) -> None:
    """Send a torque past every limit of the loop, as a bug would."""
    robot.loop.drives.send_torque(joint, torque_nm)


@once
def loop_stalled(robot: FailingRobot, joint: str, ticks: int) -> None:
    robot.stall(ticks)


@once
def absurd_stride(robot: FailingRobot, joint: str) -> None:
    """Make the next sample close a stride with a coefficient of 10²⁰ N/m³."""
    estimator = robot.loop.learning.estimator
    true_add = estimator.add
    wild = Estimate(1e20, 1.0, 100, True)
    stride = StrideEstimate(
        flipper="left",
        index=0,
        t_start_s=0.0,
        t_end_s=1.0,
        insertion_s=0.4,
        stance_s=0.3,
        extraction_s=0.1,
        k_p=wild,
        k_s=wild,
        k_e=wild,
        surface_m=0.0,
        depth_m=0.03,
        released=True,
        insertion_force_n=1.0,
        stance_force_n=1.0,
        extraction_force_n=-1.0,
        step_m=0.1,
    )

    def add(*arguments: Any) -> Sampled:
        del estimator.__dict__["add"]  # once
        return true_add(*arguments)._replace(closing=finished((stride,)))

    estimator.__dict__["add"] = add


# the clock


class KernelStamps:
    """Stamps the frames of a port with a wall clock, as the kernel does, and converts the stamps back."""

    def __init__(self, robot: FailingRobot, receive: Callable[[], Sequence[Frame]], step_s: float) -> None:
        self._robot = robot
        self._receive = receive
        self._step_s = step_s
        self._since_s = robot.now_s + robot.period_s - ARRIVED_BEFORE_S / 2.0  # after the frames of the next read
        self._clock = StampClock(lambda: robot.now_s, lambda: self._wall_s(robot.now_s))

    def _wall_s(self, time_s: float) -> float:
        return time_s + (self._step_s if time_s > self._since_s else 0.0)

    def receive(self) -> list[Frame]:
        offset_s = self._clock.offset_s()
        stamp_s = self._wall_s(self._robot.now_s - ARRIVED_BEFORE_S) + offset_s
        return [frame._replace(stamp_s=stamp_s) for frame in self._receive()]


@during
def wall_clock_stepped(robot: FailingRobot, joint: str, step_s: float) -> Iterator[None]:
    """Step the wall clock with which the kernel stamps the frames of every bus."""
    ports = robot.loop.drives.ports.values()
    for port in ports:
        vars(port)["receive"] = KernelStamps(robot, port.receive, step_s).receive
    yield
    for port in ports:
        del vars(port)["receive"]


# the daemon


@once
def killed(bench: FaultBench, joint: str) -> None:
    bench.dead = True


class DeliberateBugError(Exception):
    pass


@once
def bug_in(robot: FailingRobot, joint: str, path: str) -> None:
    """Make the next call of a method of the loop raise. `path` is "part.method"."""
    part, method = path.split(".")

    def broken(*arguments: Any, **options: Any) -> Any:
        raise DeliberateBugError(path)

    setattr(getattr(robot.loop, part), method, broken)
