"""Robots that break a promise on purpose, to prove that the oracle notices it.

Each one is a patch of the product, applied while the context lasts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any
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


BREAKS: dict[str, Break] = {  # by the promise that must notice
    "LimitedMotors": no_limits,
    "LittleEnergy": damping_pushes,
    "DisarmAtOnce": disarm_ignored,
    "StopInTime": stop_ignored,
    "ArmedByRequest": arms_by_itself,
    "NoTorqueWithoutMode": silent_without_torque,
    "LeaseHeld": leases_ignored,
    "SilentLoop": no_watchdogs,
    "TrueTorque": joints_unwatched,
    "WithinStops": joints_unwatched,
    "BoundedEnergy": unwatched_and_unlimited,
    "NoFalseAlarm": false_encoder_fault,
    "NoBug": tick_raises,
    "BackToIdle": fault_stays,
    "WholeLog": rows_vanish,
}
