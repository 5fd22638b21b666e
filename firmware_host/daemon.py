"""mudskipperd: the process on the robot.

Reads the configuration, opens the buses, and runs the loop until it is told to end. SIGTERM, SIGINT and SIGHUP let it
finish safely: flippers out of the mud, torque to zero, drives idle, log closed. What nobody expected ends in one place,
which idles the drives, says what happened, and exits with status 1; systemd starts it again, disarmed.
"""

from __future__ import annotations

import argparse
import errno
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path

from control.modes import ENERGISED, Mode, Request
from control.rate import RATE_HZ
from drivers.can.reopening_port import ReopeningPort
from drivers.drive_types import make_drives
from drivers.fault_injection.failing_port import failing_ports
from drivers.fault_injection.failing_pose import failing_pose
from drivers.fault_injection.failures import Failures
from drivers.pose.pose_port import OpenedPose, PoseSourceError
from firmware_host.buses import BusError, reopening_ports
from firmware_host.computer.realtime import prepare_loop
from firmware_host.computer.sd_notify import SystemdNotifier
from firmware_host.configuration.configuration import EXIT_CONFIGURATION, Configuration, LoopParameters
from firmware_host.configuration.loading import load_configuration
from firmware_host.configuration.toml_records import ConfigurationError
from firmware_host.fault_injection.failing_recorder import failing_recorder
from firmware_host.fault_injection.failing_time import failing_clock, failing_ticker
from firmware_host.fault_injection.failure_calls import failures_of, with_failures
from firmware_host.log.log_folder import first_path, new_run_id
from firmware_host.log.recorder import NullRecorder, Recorder
from firmware_host.loop import Loop
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.operator.rights import Rights, load_rights
from firmware_host.operator.status_socket import AlreadyServedError, StatusSocket
from firmware_host.pose_sources import open_pose
from firmware_host.software_version import build_metadata
from firmware_host.ticker import Tick, Ticker

EXIT_FAILED = 1
LONGEST_SHUTDOWN_S = 5.0
LONGEST_LOG_CLOSE_S = 10.0
GOODBYE_S = 0.3  # for idle requests to leave and be obeyed
GOODBYE_FRAMES = 5  # to each drive when a bug ends the loop
NOTIFY_TICKS = int(RATE_HZ / 4)


class WatchdogFeed:
    """Feeds systemd's watchdog from the ticks themselves: a loop that misses more than it makes is not healthy."""

    def __init__(self, notifier: SystemdNotifier) -> None:
        self._notifier = notifier
        self._made = self._missed = 0

    def update(self, tick: Tick, mode: Mode) -> None:
        self._made += 1
        self._missed += tick.missed
        if self._made < NOTIFY_TICKS:
            return
        if self._missed <= self._made:
            self._notifier.send("WATCHDOG=1", f"STATUS={mode.name.lower()}")
        self._made = self._missed = 0


class Shutdown:
    """Owns the wish to end, and asks the loop for one step towards it per tick."""

    def __init__(self) -> None:
        self.wanted = False
        self._since_s: float | None = None
        self._idle_since_s: float | None = None

    def ask(self, number: int, frame: object) -> None:
        """A signal handler."""
        self.wanted = True

    def step(self, loop: Loop, now_s: float) -> bool:
        """Whether the loop may end now."""
        if not self.wanted:
            return False
        loop.ending = True
        self._since_s = self._since_s or now_s
        if loop.mode not in ENERGISED:
            self._idle_since_s = self._idle_since_s or now_s
            all_idle = not any(state.closed_loop for state in loop.states)
            return all_idle or now_s - self._idle_since_s > GOODBYE_S
        in_the_mud = loop.mode is Mode.WALKING or loop.controller.cut_short
        if now_s - self._since_s > LONGEST_SHUTDOWN_S or (loop.mode in (Mode.HOLD, Mode.ARMING) and not in_the_mud):
            loop.request(Request.DISARM, now_s)
        elif in_the_mud:
            loop.request(Request.STOP, now_s)
        return False


def open_recorder(configuration: Configuration) -> Recorder | NullRecorder:
    """Of a new run. Raises OSError where no log can be written at all."""
    if not configuration.log.enabled:
        return NullRecorder()
    folder, robot = Path(configuration.log.directory), configuration.robot.name
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK):
        raise PermissionError(errno.EACCES, "is not writable", str(folder))
    run_id = new_run_id(robot)
    metadata = {"robot": robot, "run_id": run_id} | build_metadata()
    return Recorder(first_path(folder, run_id), configuration.text, metadata, configuration.log)


def run(configuration: Configuration, rights: Rights, shutdown: Shutdown) -> int:
    """Until `shutdown` is wanted and done.

    Raises BusError, PoseSourceError, AlreadyServedError or OSError before it has begun.
    """
    with ExitStack() as stack:
        # First: it refuses to be the second daemon.
        status = StatusSocket(Path(configuration.status.socket), {}, rights)
        stack.callback(status.close)
        failures = failures_of(configuration)
        buses = reopening_ports(configuration.bus, configuration.loop.wait_for_bus)
        ports = failing_ports(buses, configuration.drive, failures)
        drives = make_drives(configuration.drive, ports, configuration.limits, configuration.watchdog_endpoints)
        stack.callback(drives.close)
        pose = open_pose(configuration.pose)
        stack.callback(pose.close)
        recorder = failing_recorder(open_recorder(configuration), failures)
        stack.callback(recorder.close, LONGEST_LOG_CLOSE_S)
        wall_clock = failing_clock(time.time, failures)
        loop = Loop(configuration, drives, failing_pose(pose, failures), recorder, wall_clock=wall_clock)
        warnings: list[str] = []
        calls = OperatorCalls(loop, recorder, warnings, time.monotonic)
        status.methods = with_failures(calls.methods, failures, loop.events.report, time.monotonic)
        _serve_loop(status, loop)
        notifier = SystemdNotifier()
        stack.callback(notifier.close)
        warnings += _prepare(configuration.loop)
        return _run_loop(loop, buses, pose, failures, status, notifier, shutdown)


def _serve_loop(status: StatusSocket, loop: Loop) -> None:
    """What the socket needs of the loop beside its methods."""
    status.on_hang_up = loop.lease.hang_up
    status.spares = lambda caller: caller == loop.lease.holder
    status.report_bug = lambda message: loop.events.report(time.monotonic(), message)


def _prepare(parameters: LoopParameters) -> list[str]:
    """The process for real time: what could not be had, which is told."""
    warnings = prepare_loop(parameters.priority, parameters.cpu, parameters.lock_memory)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    return warnings


def _run_loop(
    loop: Loop,
    buses: Mapping[str, ReopeningPort],
    pose: OpenedPose,
    failures: Failures | None,
    status: StatusSocket,
    notifier: SystemdNotifier,
    shutdown: Shutdown,
) -> int:
    ticker, watchdog = failing_ticker(Ticker(), failures, loop.events.report), WatchdogFeed(notifier)
    notifier.send("READY=1", "STATUS=running")
    now_s = time.monotonic()
    try:
        while not shutdown.step(loop, now_s):
            tick = ticker.wait()
            now_s = tick.now_s
            loop.tick(tick)
            status.serve(now_s)
            watchdog.update(tick, loop.mode)
            reopen_buses(loop, buses, now_s)
            reopen_pose(loop, pose, now_s)
        notifier.send("STOPPING=1")
        return 0
    except Exception as problem:  # noqa: BLE001 - the one place where surprises end
        notifier.send("STOPPING=1")
        if failures is not None:  # or what fails on purpose would keep the drives from hearing the end
            failures.end_all()
        return end_safely(loop, problem)


def reopen_buses(loop: Loop, buses: Mapping[str, ReopeningPort], now_s: float) -> None:
    """Those that are off, while torque is: opening one may take longer than a tick."""
    if loop.mode in ENERGISED:
        return
    for name, port in buses.items():
        if port.reopen(now_s):
            loop.events.report(now_s, f"bus {name} opened again")


def reopen_pose(loop: Loop, pose: OpenedPose, now_s: float) -> None:
    """The same for a source that was unplugged."""
    if loop.mode not in ENERGISED and pose.reopen(now_s):
        loop.events.report(now_s, "the pose's source was opened again; its zero may be another one")


def end_safely(loop: Loop, problem: Exception) -> int:
    """Idle the drives, whatever state the rest is in, and say what happened."""
    loop.drives.force_idle(GOODBYE_FRAMES)
    place = traceback.extract_tb(problem.__traceback__)[-1]
    message = f"{type(problem).__name__}: {problem} ({Path(place.filename).name}, line {place.lineno})"
    print(f"mudskipperd: stopped by a bug, the drives are idle: {message}", file=sys.stderr)
    with suppress(Exception):  # or the log
        loop.events.report(time.monotonic(), f"stopped by a bug: {message}")
    return EXIT_FAILED


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="mudskipperd", description="The robot's real-time controller.")
    parser.add_argument("--config", type=Path, default=Path("/etc/mudskipper/mudskipper.toml"))
    parser.add_argument("--check-config", action="store_true", help="read the configuration, say what is wrong, end")
    options = parser.parse_args(arguments)
    try:
        configuration = load_configuration(options.config)
        rights = load_rights(configuration.status)
    except ConfigurationError as problem:
        return _refuse([f"mudskipperd: {message}" for message in problem.problems], EXIT_CONFIGURATION)
    for warning in configuration.warnings:
        print(f"mudskipperd: warning: {warning}", file=sys.stderr)
    if options.check_config:
        return 0
    shutdown = Shutdown()
    _on_signals(shutdown.ask)
    try:
        return run(configuration, rights, shutdown)
    except (BusError, PoseSourceError, AlreadyServedError) as problem:
        return _refuse([f"mudskipperd: {problem}"], EXIT_FAILED)
    except OSError as problem:
        place = f" {problem.filename}" if problem.filename else ""
        return _refuse([f"mudskipperd: cannot start:{place} {problem.strerror or problem}"], EXIT_FAILED)


def _on_signals(handler: Callable[[int, object], None]) -> None:
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, handler)


def _refuse(messages: Sequence[str], status: int) -> int:
    for message in messages:
        print(message, file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
