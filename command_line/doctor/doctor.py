"""`mudskipper doctor`, and `mudskipper check` where no daemon runs: check the computer and its buses.

Each check is one line with its fix. Nothing is transmitted: `check` listens whether the drives are heard.
"""

import grp
import os
import pwd
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from datetime import UTC, datetime
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

from command_line import exit_codes
from command_line.doctor.can_links import CanLink, examine_buses, read_links
from command_line.doctor.findings import Finding, Level, fail, ok, ok_if, warn
from command_line.doctor.host_checks import (
    OURS,
    Account,
    examine_clock,
    examine_folder,
    examine_host,
    examine_limits,
    examine_shell,
    examine_storage,
    examine_this_python,
    log_space,
    this_account,
)
from command_line.doctor.host_facts import (
    UNIT,
    clock_is_synchronised,
    has_clock_chip,
    process_limits,
    thread_priority,
    unit_limits,
)
from command_line.json_output import print_value
from command_line.screen import GREEN, RED, YELLOW, coloured
from command_line.shared_options import DEFAULT_CONFIG, Json
from drivers.drive_types import make_drives
from drivers.pose.pose_port import PoseSourceError
from experiments.study.option import Option
from firmware_host.buses import BusError, open_ports
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import load_configuration
from firmware_host.operator.reports import check_item
from firmware_host.pose_sources import open_pose
from firmware_host.sockets.user_groups import load_rights
from firmware_host.software_version import is_compiled, software_version
from operator_client.status_client import (
    CallRefusedError,
    DroppedError,
    NoDaemonError,
    NotPermittedError,
    StatusClient,
)

ROOT = Path("/")
MARKS = {Level.OK: ("ok  ", GREEN), Level.WARN: ("warn", YELLOW), Level.FAIL: ("FAIL", RED)}
MAKE_CONFIGURATION = "'mudskipper install' makes it; or name another one with --config"
LISTENING_S = 0.6  # six heartbeats
START = "'systemctl start mudskipper', then 'systemctl status mudskipper'"


def _given_socket() -> Path | None:
    given = os.environ.get("MUDSKIPPER_SOCKET")
    return Path(given) if given else None


def doctor(
    *,
    config: Annotated[Path, Option("of the daemon")] = Path(DEFAULT_CONFIG),
    json: Json = False,
    socket: Annotated[
        Path | None,
        Option(
            "Unix socket of the daemon (default: $MUDSKIPPER_SOCKET, else the configured one)",
            metavar="PATH",
            default=_given_socket,
        ),
    ] = None,
) -> int:
    try:
        configuration = load_configuration(config)
    except ConfigurationError as problem:
        fix = f"edit {config}" if config.exists() else MAKE_CONFIGURATION
        failed = [fail("configuration", message, fix) for message in problem.problems]
        return _show([*failed, *examine_this_python(), _examine_clock()], json)
    findings = examine_all(configuration, socket or Path(configuration.status.socket), read_links(ROOT))
    return _show([ok("configuration", str(config)), *findings], json)


def examine_all(configuration: Configuration, socket: Path, links: dict[str, CanLink]) -> Iterator[Finding]:
    pid, daemon = _ask_daemon(socket, configuration.faults.longest_watchdog_s)
    service = process_limits(ROOT, pid) if pid else unit_limits(ROOT)
    shell = process_limits(ROOT, None)
    priority = thread_priority(ROOT, pid) if pid else None
    yield from examine_host(ROOT, configuration.loop, service or shell, priority)
    if service:
        yield from examine_shell(configuration.loop, shell)
    yield from examine_buses(configuration, links)
    yield from examine_storage(ROOT, configuration.log, _log_writer(), pid is not None)
    yield _examine_clock()
    yield from daemon
    yield from _examine_groups(configuration, socket)
    yield from examine_this_python()
    yield ok("tick", f"this installation runs it {'compiled' if is_compiled() else 'interpreted'}")


def _examine_clock() -> Finding:
    return examine_clock(datetime.now(UTC), clock_is_synchronised(), has_clock_chip(ROOT))


def _ask_daemon(socket: Path, longest_watchdog_s: float) -> tuple[int | None, list[Finding]]:
    """Returns the daemon's process id, and the findings about itself and its drives."""
    pid = None
    try:
        client = StatusClient(socket)
        with closing(client):
            pid = client.daemon_pid
            return pid, list(examine_daemon(client.call("status"), software_version(), longest_watchdog_s))
    except NotPermittedError as problem:
        return pid, [warn("daemon", str(problem), "or run this with sudo")]
    except DroppedError as problem:
        return pid, [warn("daemon", str(problem), "try again")]
    except NoDaemonError as problem:
        return pid, [warn("daemon", f"{problem}: drives and their watchdogs are not known", START)]
    except CallRefusedError as problem:
        return pid, [fail("daemon", str(problem), START)]


def examine_daemon(status: dict[str, Any], version: str, longest_watchdog_s: float) -> Iterator[Finding]:
    """Yields the findings about the status of a daemon; `version` is that of this command."""
    form = "compiled" if status.get("compiled") else "interpreted"  # an older daemon does not say it
    text, same = f"runs, version {status['version']}, {form}, {status['mode']}", status["version"] == version
    text += "" if same else f"; this command is version {version}"
    yield ok_if(same, "daemon", text, "'systemctl restart mudskipper', with the robot disarmed")
    for drive in status["drives"]:
        yield _examine_watchdog(f"watchdog.{drive['joint']}", drive["watchdog_s"], longest_watchdog_s)


def _examine_watchdog(identity: str, watchdog_s: float | None, longest_s: float) -> Finding:
    fix = "docs/how-to/odrive.md"
    if watchdog_s is None:
        return warn(identity, "not read back: the drive is silent, or its firmware's numbers are not known", fix)
    if watchdog_s == 0.0:
        return fail(identity, "off: nothing stops this motor when the computer dies", fix)
    slow = watchdog_s > longest_s
    text = f"{watchdog_s:g} s" + (f" is slower than faults.longest_watchdog_s = {longest_s:g}" if slow else "")
    return ok_if(not slow, identity, text, fix, Level.FAIL)


def _log_writer() -> Account:
    """Returns the daemon's user where the service is installed, or else this one."""
    with suppress(KeyError):
        if (ROOT / UNIT).exists():
            user = pwd.getpwnam(OURS)
            return Account(OURS, user.pw_uid, frozenset(os.getgrouplist(OURS, user.pw_gid)))
    return this_account()


def _examine_groups(configuration: Configuration, socket: Path) -> Iterator[Finding]:
    """Checks who may use the socket."""
    with suppress(OSError):
        status = socket.stat()
        yield ok("socket", f"{socket}, mode {status.st_mode & 0o777:o}, group {_group_name(status.st_gid)}")
    try:
        load_rights(configuration.status)
    except ConfigurationError as problem:
        yield from (fail("groups", message, "make the group, or leave the key out") for message in problem.problems)
        return
    name = configuration.status.drive_group or OURS
    try:
        members = grp.getgrnam(name).gr_mem
    except KeyError:
        yield warn("groups", f"there is no group {name}", "'mudskipper install' makes it")
        return
    text = f"operators are the members of {name}: {', '.join(members) or 'only root'}"
    yield ok_if(bool(members), "groups", text, f"'adduser YOU {name}', then log in again")


def _group_name(gid: int) -> str:
    with suppress(KeyError):
        return grp.getgrgid(gid).gr_name
    return str(gid)


def _show(findings: list[Finding], as_json: bool) -> int:
    if as_json:
        print_value([each._asdict() for each in findings])
    else:
        print("\n".join(map(_line, findings)))
    failed = any(finding.level is Level.FAIL for finding in findings)
    return exit_codes.UNHEALTHY if failed else exit_codes.OK


def _line(finding: Finding) -> str:
    fix = f"\n       -> {finding.fix}" if finding.fix else ""
    return f"{coloured(*MARKS[finding.level])} {finding.id:22} {finding.text}{fix}"


def check_without_daemon(path: Path, why_no_daemon: str) -> list[dict[str, Any]]:
    fix = "start it ('systemctl start mudskipper'), name its socket with --socket, or join the group that owns it"
    items = [check_item("daemon", False, why_no_daemon, fix)]
    try:
        configuration = load_configuration(path)
    except ConfigurationError as problem:
        fix = f"edit {path}" if path.exists() else MAKE_CONFIGURATION
        return items + [check_item("configuration", False, message, fix) for message in problem.problems]
    items.append(check_item("configuration", True, str(path), ""))
    return items + _drive_items(configuration) + _pose_items(configuration) + _host_items(configuration)


def _drive_items(configuration: Configuration) -> list[dict[str, Any]]:
    try:
        ports = open_ports(configuration.bus)
    except BusError as problem:
        return [check_item("bus", False, str(problem), "bring the interface up: docs/how-to/install.md")]
    drives = make_drives(configuration.drive, ports, configuration.limits, configuration.watchdog_endpoints)
    deadline_s = time.monotonic() + LISTENING_S
    states = drives.read(time.monotonic())
    while not drives.heard and time.monotonic() < deadline_s:
        drives.poll()
        time.sleep(0.01)
        states = drives.read(time.monotonic())
    fix = "check its power, wiring, node id and cyclic message periods"
    items = [
        check_item(f"drive.{joint}", state.heard, "heard" if state.heard else "not heard", fix)
        for joint, state in zip(configuration.rig.joints, states, strict=True)
    ]
    drives.close()
    return items


def _pose_items(configuration: Configuration) -> list[dict[str, Any]]:
    """Checks a pose source. A robot walks without a pose, but its daemon requires the configured source to open."""
    if configuration.pose.chosen not in ("natnet", "rail_encoder"):
        return []
    try:
        pose = open_pose(configuration.pose)
    except PoseSourceError as problem:
        return [check_item("pose", False, str(problem), "plug it in, or correct [pose] in the configuration")]
    deadline_s = time.monotonic() + LISTENING_S
    while not isfinite(pose.read(time.monotonic()).x_m) and time.monotonic() < deadline_s:
        time.sleep(0.01)
    pose.close()
    return [check_item("pose", True, pose.report().message, "")]


def _host_items(configuration: Configuration) -> list[dict[str, Any]]:
    findings = []
    if configuration.log.enabled:
        findings += [log_space(configuration.log), examine_folder(Path(configuration.log.directory), this_account())]
    findings += examine_limits(configuration.loop, process_limits(Path("/"), None))
    opened = [f"bus.{name}" for name in configuration.bus]  # _drive_items reported whether they open
    findings += [finding for finding in examine_buses(configuration, read_links()) if finding.id not in opened]
    return [finding.as_check_item for finding in findings]
