"""Robots that break a promise on purpose, to prove that the oracle notices it.

Each one is a patch of the product, applied while the context lasts.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, NamedTuple
from unittest import mock

from control import controller, joint_pd
from control.faults import FaultKind
from control.limits import LimitedTorques
from control.modes import ENERGISED, Mode, Request
from control.records import Torques
from drivers.drives import Drives
from drivers.transmit_gate import TransmitGate
from firmware_host import loop
from firmware_host.lease import Lease
from firmware_host.log.segments import LogSegments
from firmware_host.loop import Loop
from firmware_host.loop_events import LoopEvents
from simulation.devices.odrive.device import SimulatedOdrive
from tests.dst.scenario import Call, Drift, Event, Failure, Suspend

Break = Callable[[], AbstractContextManager[Any]]


def no_limits() -> AbstractContextManager[Any]:
    """Loop and gate pass every torque on."""

    def unlimited(wanted_nm: Torques, *others: Any) -> LimitedTorques:
        return LimitedTorques(wanted_nm, limited=False, finite=True)

    return _both(
        mock.patch.object(loop, "apply_limits", unlimited),
        mock.patch.object(TransmitGate, "torque_problem", lambda *arguments: ""),
    )


def damping_pushes() -> AbstractContextManager[Any]:
    """Damping has the wrong sign."""

    def pushing(*arguments: Any) -> Torques:
        return joint_pd.damping_torques_nm(*arguments).map(lambda torque_nm: -torque_nm)

    return mock.patch.object(controller, "damping_torques_nm", pushing)


def _ignoring(ignored: Request) -> AbstractContextManager[Any]:
    true_request = Loop.request

    def request(self: Loop, wanted: Request, *arguments: Any, **options: Any) -> str | None:
        return None if wanted is ignored else true_request(self, wanted, *arguments, **options)

    return mock.patch.object(Loop, "request", request)


def disarm_ignored() -> AbstractContextManager[Any]:
    """A disarm is accepted and forgotten."""
    return _ignoring(Request.DISARM)


def stop_ignored() -> AbstractContextManager[Any]:
    """A stop is accepted and forgotten."""
    return _ignoring(Request.STOP)


def arms_by_itself() -> AbstractContextManager[Any]:
    """The loop arms again as soon as nothing prevents it."""
    true_pop = Loop._pop_request

    def pop(self: Loop) -> Request:
        if self.mode is Mode.IDLE and not self.faults.blocking():
            return Request.ARM
        return true_pop(self)

    return mock.patch.object(Loop, "_pop_request", pop)


def silent_without_torque() -> AbstractContextManager[Any]:
    """No command is sent any more in the modes without torque, so the drives keep their last torque."""
    true_command = Loop._command

    def command(self: Loop, now_s: float) -> None:
        if self.mode in ENERGISED:
            true_command(self, now_s)

    silent = mock.patch.object(Drives, "disarm", lambda *arguments, **options: None)
    return _both(silent, mock.patch.object(Loop, "_command", command))


@contextmanager
def _both(first: AbstractContextManager[Any], second: AbstractContextManager[Any]) -> Iterator[None]:
    with first, second:
        yield


def fault_stays() -> AbstractContextManager[Any]:
    """A fault never ends."""
    return mock.patch("control.fault_latch.FaultLatch._is_over", lambda *arguments: False)


@contextmanager
def joints_unwatched() -> Iterator[None]:
    """Nothing watches joints or torques: if only one monitor were removed, another would replace it."""
    monitor = "firmware_host.fault_monitor.FaultMonitor"
    with (
        mock.patch("control.monitors.joint_monitor.JointMonitor.update", lambda *arguments: []),
        mock.patch("control.monitors.torque_gain_monitor.TorqueGainMonitor.update", lambda *arguments: None),
        mock.patch(f"{monitor}._check_obedience", lambda *arguments: None),
    ):
        yield


def unwatched_and_unlimited() -> AbstractContextManager[Any]:
    """A joint that runs away is driven with any torque."""
    return _both(no_limits(), joints_unwatched())


def false_encoder_fault() -> AbstractContextManager[Any]:
    """A monitor reports a fault of an encoder that has none."""
    fault = FaultKind.ENCODER_JUMP.fault("left_sweep")
    return mock.patch("control.monitors.encoder_monitor.EncoderMonitor.update", lambda *arguments: fault)


def tick_raises() -> AbstractContextManager[Any]:
    """The loop has a bug that only a stop meets."""
    return mock.patch.object(LoopEvents, "report_request", side_effect=ZeroDivisionError)


def rows_vanish() -> AbstractContextManager[Any]:
    """The log's writer sometimes loses a row without reporting it."""
    true_write = LogSegments.write

    def write(self: LogSegments, rows: Any) -> None:
        true_write(self, rows[:-1])

    return mock.patch.object(LogSegments, "write", write)


def leases_ignored() -> AbstractContextManager[Any]:
    """Any operator may move the robot, whoever holds the lease."""
    return mock.patch.object(Lease, "refusal", lambda *arguments, **options: None)


def no_watchdogs() -> AbstractContextManager[Any]:
    """The drives follow their last command for ever."""
    return mock.patch.object(SimulatedOdrive, "_trip_if_due", lambda *arguments: None)


class Broken(NamedTuple):
    """A robot that breaks a promise, and the start, the events and the duration that show it."""

    patch: Break
    start: str
    events: tuple[Event, ...] = ()
    for_s: float = 0.3


BREAKS = {  # by the promise that must notice
    "LimitedMotors": Broken(no_limits, "stance", (Failure(0.01, "left_sweep.arm", "blocked", 0.2),)),
    "LittleEnergy": Broken(damping_pushes, "stance", (Failure(0.05, "bus.left", "stuck", 0.02),), 1.0),
    "DisarmAtOnce": Broken(disarm_ignored, "stance", (Call(0.05, "guest", "disarm"),)),
    "StopInTime": Broken(stop_ignored, "hold", (Call(0.0, "pilot", "walk"), Call(0.1, "guest", "stop"))),
    "ArmedByRequest": Broken(arms_by_itself, "stance", (Call(0.05, "guest", "disarm"),), 0.8),
    "NoTorqueWithoutMode": Broken(silent_without_torque, "stance", (Failure(0.05, "left_sweep.error", "stuck", 0.05),)),
    "LeaseHeld": Broken(
        leases_ignored, "hold", (Call(0.0, "pilot", "lease", {"for_s": 1.0}), Call(0.1, "second", "walk"))
    ),
    "SilentLoop": Broken(no_watchdogs, "stance", (Suspend(0.05, 0.4, "drives.send"),), 0.6),
    "TrueTorque": Broken(
        joints_unwatched, "path", (Drift(0.0, "left_sweep", {"torque_constant_error": 4.0}, 1.5),), 1.5
    ),
    "WithinStops": Broken(joints_unwatched, "stance", (Failure(0.0, "left_sweep.motor", "inverted", 1.2),), 1.2),
    "BoundedEnergy": Broken(unwatched_and_unlimited, "stance", (Failure(0.0, "left_sweep.motor", "inverted", 0.6),)),
    "NoFalseAlarm": Broken(false_encoder_fault, "stance"),
    "NoBug": Broken(tick_raises, "hold", (Call(0.05, "guest", "stop"), Call(0.1, "pilot", "clear"))),
    "BackToIdle": Broken(fault_stays, "hold", (Failure(0.05, "left_sweep", "off", 0.05),)),
    "WholeLog": Broken(rows_vanish, "release"),
}
