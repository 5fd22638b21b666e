"""mudskipperd: the process on the robot.

The daemon reads the configuration, opens the buses, and runs the loop until a signal ends it. SIGTERM, SIGINT and
SIGHUP let it finish safely: flippers out of the mud, torque to zero, drives idle, log closed. An unexpected exception
ends in one handler, which idles the drives, reports the exception, and exits with status 1; systemd starts the daemon
again, disarmed.
"""

import argparse
import errno
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path

from control.modes import ENERGISED, Mode, Request
from control.rate import RATE_HZ
from drivers.can.bus_lock import BusRole
from drivers.can.reopening_port import ReopeningPort
from drivers.drive_types import make_drives
from drivers.fault_injection.failing_port import failing_ports
from drivers.fault_injection.failing_pose import FailingPose
from drivers.fault_injection.failures import Failures
from drivers.pose.pose_port import OpenedPose, PoseSource, PoseSourceError
from drivers.power_switch import PowerSwitchError, open_power_switch
from firmware_host.buses import BusError, lock_buses, reopening_ports
from firmware_host.computer.awake_processors import AwakeProcessors
from firmware_host.computer.realtime import prepare_loop
from firmware_host.computer.sd_notify import SystemdNotifier
from firmware_host.configuration.configuration import EXIT_CONFIGURATION, Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import load_configuration
from firmware_host.configuration.service_file import CONFIGURATION, service_configuration
from firmware_host.configuration.socket_paths import rows_path
from firmware_host.fault_injection.failing_host import FailingClock, FailingRecorder, FailingTicker
from firmware_host.fault_injection.failure_calls import failures_of, with_failures
from firmware_host.log.log_folder import first_path, new_run_id
from firmware_host.log.recorder import NullRecorder, Recorder, Recording
from firmware_host.loop import Loop
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.pose_sources import open_pose
from firmware_host.sockets.rights import Rights
from firmware_host.sockets.socket_file import AlreadyServedError
from firmware_host.sockets.status_socket import StatusSocket
from firmware_host.sockets.user_groups import load_rights
from firmware_host.software_version import build_metadata
from firmware_host.ticker import Tick, Ticker
from firmware_host.trial import load_defaults

EXIT_FAILED = 1
LONGEST_SHUTDOWN_S = 5.0  # then torque goes off wherever the flippers are
LONGEST_LOG_CLOSE_S = 10.0
IDLING_S = 0.3  # the longest time that drives may take to go idle
IDLE_REQUESTS = 5  # to each drive when a bug ends the loop
NOTIFY_TICKS = int(RATE_HZ / 4)  # ticks between two messages to systemd


class WatchdogFeed:
    """Feeds systemd's watchdog from the ticks, unless more ticks are missed than run."""

    def __init__(self, notifier: SystemdNotifier) -> None:
        self._notifier = notifier
        self._ran = self._missed = 0

    def update(self, tick: Tick, mode: Mode) -> None:
        self._ran += 1
        self._missed += tick.missed
        if self._ran < NOTIFY_TICKS:
            return
        if self._missed <= self._ran:
            self._notifier.send("WATCHDOG=1", f"STATUS={mode.name.lower()}")
        self._ran = self._missed = 0


class Shutdown:
    """Owns whether the daemon must end, and requests one step towards the end from the loop in each tick."""

    def __init__(self) -> None:
        self.requested = False
        self._since_s: float | None = None
        self._idle_since_s: float | None = None

    def request(self, number: int, frame: object) -> None:
        """Handle a signal."""
        self.requested = True

    def step(self, loop: Loop, now_s: float) -> bool:
        """Request the next step of the shutdown; return whether the loop may end now."""
        if not self.requested:
            return False
        loop.ending = True
        self._since_s = self._since_s or now_s
        if loop.mode not in ENERGISED:
            self._idle_since_s = self._idle_since_s or now_s
            all_idle = not any(state.closed_loop for state in loop.states)
            return all_idle or now_s - self._idle_since_s > IDLING_S
        in_the_mud = loop.mode is Mode.WALKING or loop.controller.cut_short
        if now_s - self._since_s > LONGEST_SHUTDOWN_S or (loop.mode in (Mode.HOLD, Mode.ARMING) and not in_the_mud):
            loop.request(Request.DISARM, now_s)
        elif in_the_mud:
            loop.request(Request.STOP, now_s)
        return False


def open_recorder(configuration: Configuration, rights: Rights) -> Recorder | NullRecorder:
    """Start the log of a new run; raises OSError if the log cannot be written."""
    if not configuration.log.enabled:
        return NullRecorder()
    folder, robot = Path(configuration.log.directory), configuration.robot.name
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK):
        raise PermissionError(errno.EACCES, "is not writable", str(folder))
    run_id = new_run_id(robot)
    metadata = {"robot": robot, "run_id": run_id} | build_metadata()
    stream = {"path": str(rows_path(Path(configuration.status.socket))), "rights": rights}
    return Recorder(
        first_path(folder, run_id), configuration.text, metadata, configuration.log, stream, configuration.rig
    )


def run(configuration: Configuration, rights: Rights, shutdown: Shutdown) -> int:
    """Run the loop until the shutdown is complete; return the exit status.

    Raises BusError, PoseSourceError, PowerSwitchError, AlreadyServedError or OSError before the first tick.
    """
    with ExitStack() as stack:
        # The socket comes first, since it detects another daemon.
        status = StatusSocket(Path(configuration.status.socket), {}, rights)
        stack.callback(status.close)
        stack.enter_context(lock_buses(configuration.bus, BusRole.COMMANDS))
        failures = failures_of(configuration)
        buses = reopening_ports(configuration.bus, configuration.loop.wait_for_bus)
        ports = failing_ports(buses, configuration.drive, failures)
        drives = make_drives(configuration.drive, ports, configuration.limits, configuration.watchdog_endpoints)
        stack.callback(drives.close)
        power_switch = open_power_switch(configuration.emergency_stop)
        pose = open_pose(configuration.pose)
        stack.callback(pose.close)
        recorder: Recording = open_recorder(configuration, rights)
        seen_pose: PoseSource = pose
        wall_clock: Callable[[], float] = time.time
        if failures is not None:
            recorder = FailingRecorder(recorder, failures)
            seen_pose, wall_clock = FailingPose(pose, failures), FailingClock(time.time, failures)
        stack.callback(recorder.close, LONGEST_LOG_CLOSE_S)
        loop = Loop(configuration, drives, seen_pose, recorder, wall_clock=wall_clock, power_switch=power_switch)
        warnings = status.warnings
        defaults = load_defaults(Path(configuration.log.directory)) if configuration.log.enabled else {}
        calls = OperatorCalls(loop, warnings, time.monotonic, wall_clock, defaults)
        status.methods = with_failures(
            calls.methods, failures, loop.events.report, time.monotonic, calls.require_own_robot
        )
        status.on_hang_up = loop.lease.hang_up
        status.is_protected = lambda caller: caller == loop.lease.holder
        status.report_bug = lambda message: loop.events.report(time.monotonic(), message)
        for warning in configuration.warnings:
            loop.events.report(time.monotonic(), f"warning: {warning}")
        notifier = SystemdNotifier()
        stack.callback(notifier.close)
        processors = AwakeProcessors(configuration.loop.stay_awake)
        stack.callback(processors.close)
        warnings += [processors.problem] if processors.problem else []
        warnings += prepare_loop(configuration.loop.priority, configuration.loop.cpu, configuration.loop.lock_memory)
        _print_warnings("", warnings)
        return _run_loop(loop, buses, pose, failures, status, notifier, processors, shutdown)


def _print_warnings(program: str, warnings: Iterable[str]) -> None:
    for warning in warnings:
        print(f"{program}warning: {warning}", file=sys.stderr)


def _run_loop(
    loop: Loop,
    buses: Mapping[str, ReopeningPort],
    pose: OpenedPose,
    failures: Failures | None,
    status: StatusSocket,
    notifier: SystemdNotifier,
    processors: AwakeProcessors,
    shutdown: Shutdown,
) -> int:
    watchdog, ticker = WatchdogFeed(notifier), Ticker()
    wait = ticker.wait if failures is None else FailingTicker(ticker, failures, loop.events.report).wait
    if repairing := loop.recorder.report().repairing:
        print(f"mudskipperd: repairing {repairing} logs that earlier runs did not finish; see 'status'", flush=True)
    notifier.send("READY=1", "STATUS=running")
    print(f"mudskipperd: ready, operated by 'mudskipper' through {status.path}", flush=True)
    now_s = time.monotonic()
    try:
        while not shutdown.step(loop, now_s):
            tick = wait()
            now_s = tick.now_s
            loop.tick(tick)
            serve(loop, status, now_s)
            watchdog.update(tick, loop.mode)
            processors.update(loop.mode in ENERGISED)
            reopen_buses(loop, buses, now_s)
            reopen_pose(loop, pose, now_s)
        notifier.send("STOPPING=1")
        return 0
    except Exception as problem:  # noqa: BLE001 - the only handler of unexpected exceptions
        notifier.send("STOPPING=1")
        if failures is not None:  # an injected failure could keep the drives from going idle
            failures.end_all()
        return end_safely(loop, problem)


def serve(loop: Loop, status: StatusSocket, now_s: float) -> None:
    """Serve clients; the time counts as a part of the tick."""
    begun_s = time.monotonic()
    status.serve(now_s)
    loop.timing.add_serving(time.monotonic() - begun_s)


def reopen_buses(loop: Loop, buses: Mapping[str, ReopeningPort], now_s: float) -> None:
    """Open lost buses again, only while torque is off: opening a bus may take longer than a tick."""
    if loop.mode in ENERGISED:
        return
    for name, port in buses.items():
        if port.reopen(now_s):
            loop.events.report(now_s, f"bus {name} opened again")


def reopen_pose(loop: Loop, pose: OpenedPose, now_s: float) -> None:
    """Open a pose source again that was unplugged, only while torque is off."""
    if loop.mode not in ENERGISED and pose.reopen(now_s):
        loop.events.report(now_s, "the pose source was opened again; its zero may have moved")


def end_safely(loop: Loop, problem: Exception) -> int:
    """Idle the drives without relying on the rest of the loop, and report the exception."""
    loop.drives.force_idle(IDLE_REQUESTS)
    origin = traceback.extract_tb(problem.__traceback__)[-1]
    message = f"{type(problem).__name__}: {problem} ({Path(origin.filename).name}, line {origin.lineno})"
    print(f"mudskipperd: stopped by a bug, the drives are idle: {message}", file=sys.stderr)
    with suppress(Exception):  # the log itself may have failed
        loop.events.report(time.monotonic(), f"stopped by a bug: {message}")
    return EXIT_FAILED


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="mudskipperd", description="The robot's real-time controller.", allow_abbrev=False
    )
    parser.add_argument("--config", type=Path, action="append", help=f"(default: the service's, /{CONFIGURATION})")
    parser.add_argument("--check-config", action="store_true", help="validate the configuration and exit")
    options = parser.parse_args(arguments)
    path, *others = options.config or [service_configuration()]
    if others:
        parser.error(f"argument --config: is given twice, as {path} and {others[0]}; give it once")
    try:
        configuration = load_configuration(path)
        rights = load_rights(configuration.status)
    except ConfigurationError as problem:
        return _refuse([f"mudskipperd: {message}" for message in problem.problems], EXIT_CONFIGURATION)
    _print_warnings("mudskipperd: ", configuration.warnings)
    if options.check_config:
        print(f"mudskipperd: {path} is valid")
        return 0
    shutdown = Shutdown()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, shutdown.request)
    try:
        return run(configuration, rights, shutdown)
    except (BusError, PoseSourceError, PowerSwitchError, AlreadyServedError) as problem:
        return _refuse([f"mudskipperd: {problem}"], EXIT_FAILED)
    except OSError as problem:
        path = f" {problem.filename}" if problem.filename else ""
        return _refuse([f"mudskipperd: cannot start:{path} {problem.strerror or problem}"], EXIT_FAILED)


def _refuse(messages: Sequence[str], status: int) -> int:
    for message in messages:
        print(message, file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
