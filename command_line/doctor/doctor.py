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
from command_line.doctor.can_links import CanLink, examine_buses, examine_unit, read_links
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
    clock_is_synchronised,
    has_clock_chip,
    process_limits,
    thread_priority,
    unit_limits,
)
from command_line.json_output import Answer
from command_line.screen import MARKS, coloured
from control.records import DriveStates
from drivers.drive_types import make_drives
from drivers.drives import Drives
from drivers.pose.pose_port import PoseSourceError
from experiments.study.option import Option
from firmware_host.buses import BusError, open_ports
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import load_configuration
from firmware_host.configuration.service_file import UNIT, service_configuration, unit_text
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
LISTENING_S = 0.6  # six heartbeats
START = "'systemctl start mudskipper', then 'systemctl status mudskipper'"
UNANSWERED = {  # why the daemon does not say its status: how severe, and what to do
    NotPermittedError: (Level.WARN, "or run this with sudo"),
    DroppedError: (Level.WARN, "try again"),
    NoDaemonError: (Level.WARN, f"{START}; until then drives and their watchdogs are not known"),
    CallRefusedError: (Level.FAIL, START),
}


def _given_socket() -> Path | None:
    given = os.environ.get("MUDSKIPPER_SOCKET")
    return Path(given) if given else None


def doctor(
    *,
    config: Annotated[Path | None, Option("of the daemon (default: that of the service)")] = None,
    socket: Annotated[
        Path | None,
        Option(
            "Unix socket of the daemon (default: $MUDSKIPPER_SOCKET, else the configured one)",
            metavar="PATH",
            default=_given_socket,
        ),
    ] = None,
) -> Answer:
    configuration, findings = examine_configuration(config)
    if configuration is None:
        findings += [*examine_this_python(), _examine_clock()]
    else:
        findings += examine_all(configuration, socket or Path(configuration.status.socket), read_links(ROOT))
    failed = any(each.level is Level.FAIL for each in findings)
    status = exit_codes.UNHEALTHY if failed else exit_codes.OK
    return Answer([each._asdict() for each in findings], "\n".join(map(_line, findings)), status)


def _line(finding: Finding) -> str:
    fix = f"\n       -> {finding.fix}" if finding.fix else ""
    return f"{coloured(*MARKS[finding.level])} {finding.id:22} {finding.text}{fix}"


def examine_configuration(given: Path | None) -> tuple[Configuration | None, list[Finding]]:
    """Return the configuration, None where it is wrong, with the findings about its file."""
    path = given or service_configuration(ROOT)
    try:
        return load_configuration(path), [ok("configuration", str(path))]
    except ConfigurationError as problem:
        fix = f"edit {path}" if path.exists() else "'mudskipper install' makes it; or name another one with --config"
        return None, [fail("configuration", message, fix) for message in problem.problems]


def examine_all(configuration: Configuration, socket: Path, links: dict[str, CanLink]) -> Iterator[Finding]:
    pid, daemon = _ask_daemon(socket, configuration)
    service = process_limits(ROOT, pid) if pid else unit_limits(ROOT)
    shell = process_limits(ROOT, None)
    priority = thread_priority(ROOT, pid) if pid else None
    yield from examine_host(ROOT, configuration.loop, service or shell, priority)
    if service:
        yield from examine_shell(configuration.loop, shell)
    yield from examine_buses(configuration, links)
    yield from examine_unit(unit_text(ROOT), links, configuration)
    yield from examine_storage(ROOT, configuration.log, _log_writer(), pid is not None)
    yield _examine_clock()
    yield from daemon
    yield from _examine_groups(configuration, socket)
    yield from examine_this_python()
    yield ok("tick", f"this installation runs it {'compiled' if is_compiled() else 'interpreted'}")


def _examine_clock() -> Finding:
    return examine_clock(datetime.now(UTC), clock_is_synchronised(), has_clock_chip(ROOT))


def _ask_daemon(socket: Path, configuration: Configuration) -> tuple[int | None, list[Finding]]:
    """Return the daemon's process id, and the findings about itself and its drives."""
    pid = None
    try:
        with StatusClient(socket) as client:
            pid = client.daemon_pid
            return pid, list(examine_daemon(client.call("status"), software_version(), configuration))
    except tuple(UNANSWERED) as problem:
        level, fix = UNANSWERED[type(problem)]
        return pid, [Finding("daemon", level, str(problem), fix)]


def examine_daemon(status: dict[str, Any], version: str, configuration: Configuration) -> Iterator[Finding]:
    """Yield the findings about the status of a daemon; `version` is that of this command."""
    form = "compiled" if status.get("compiled") else "interpreted"  # an older daemon does not say it
    text, same = f"runs, version {status['version']}, {form}, {status['mode']}", status["version"] == version
    text += "" if same else f"; this command is version {version}"
    yield ok_if(same, "daemon", text, "'systemctl restart mudskipper', with the robot disarmed")
    for drive in status["drives"]:
        yield _examine_watchdog(drive["joint"], drive["watchdog_s"], configuration)


def _examine_watchdog(joint: str, watchdog_s: float | None, configuration: Configuration) -> Finding:
    identity, longest_s = f"watchdog.{joint}", configuration.faults.longest_watchdog_s
    drive = configuration.drive.get(joint)  # another configuration than the daemon's may have other joints
    fix = f"docs/how-to/{drive.type if drive else 'drives'}.md"
    if watchdog_s is None:
        return warn(identity, "not read back: the drive is silent, or its firmware's numbers are not known", fix)
    if watchdog_s == 0.0:
        return fail(identity, "off: nothing stops this motor when the computer dies", fix)
    slow = watchdog_s > longest_s
    text = f"{watchdog_s:g} s" + (f" is slower than faults.longest_watchdog_s = {longest_s:g}" if slow else "")
    return ok_if(not slow, identity, text, fix, Level.FAIL)


def _log_writer() -> Account:
    """Return the daemon's user where the service is installed, or else this one."""
    with suppress(KeyError):
        if (ROOT / UNIT).exists():
            user = pwd.getpwnam(OURS)
            return Account(OURS, user.pw_uid, frozenset(os.getgrouplist(OURS, user.pw_gid)))
    return this_account()


def _examine_groups(configuration: Configuration, socket: Path) -> Iterator[Finding]:
    """Check who may use the socket."""
    with suppress(OSError):
        status = socket.stat()
        yield ok("socket", f"{socket}, mode {status.st_mode & 0o777:o}, group {_group_name(status.st_gid)}")
    try:
        load_rights(configuration.status)
    except ConfigurationError as problem:
        yield from (fail("groups", message, "make the group, or leave the key out") for message in problem.problems)
    else:
        yield _examine_members(configuration.status.drive_group or OURS)


def _examine_members(group: str) -> Finding:
    try:
        members = grp.getgrnam(group).gr_mem
    except KeyError:
        return warn("groups", f"there is no group {group}", "'mudskipper install' makes it")
    text = f"operators are the members of {group}: {', '.join(members) or 'only root'}"
    return ok_if(bool(members), "groups", text, f"'adduser YOU {group}', then log in again")


def _group_name(gid: int) -> str:
    with suppress(KeyError):
        return grp.getgrgid(gid).gr_name
    return str(gid)


def check_without_daemon(path: Path | None, why_no_daemon: str) -> list[dict[str, Any]]:
    """Return the lines of `mudskipper check`. It listens whether the drives are heard, and transmits nothing."""
    fix = "start it ('systemctl start mudskipper'), name its socket with --socket, or join the group that owns it"
    configuration, findings = examine_configuration(path)
    if configuration is not None:
        findings += [*examine_drives(configuration), *examine_pose(configuration), *_examine_means(configuration)]
    return [each.as_check_item for each in (fail("daemon", why_no_daemon, fix), *findings)]


def _listen(drives: Drives) -> DriveStates:
    deadline_s = time.monotonic() + LISTENING_S
    states = drives.read(time.monotonic())
    while not drives.heard and time.monotonic() < deadline_s:
        drives.poll()
        time.sleep(0.01)
        states = drives.read(time.monotonic())
    return states


def examine_drives(configuration: Configuration) -> list[Finding]:
    """Return which drives are heard."""
    try:
        ports = open_ports(configuration.bus)
    except BusError as problem:
        return [fail("bus", str(problem), "bring the interface up: docs/how-to/install.md")]
    with closing(
        make_drives(configuration.drive, ports, configuration.limits, configuration.watchdog_endpoints)
    ) as drives:
        states = _listen(drives)
    fix = "check its power, wiring, node id and cyclic message periods"
    return [
        ok_if(state.heard, f"drive.{joint}", "heard" if state.heard else "not heard", fix, Level.FAIL)
        for joint, state in zip(configuration.rig.joints, states, strict=True)
    ]


def examine_pose(configuration: Configuration) -> list[Finding]:
    """Check a pose source. A robot walks without a pose, but its daemon requires the configured source to open."""
    if configuration.pose.chosen not in ("natnet", "rail_encoder"):
        return []
    try:
        pose = open_pose(configuration.pose)
    except PoseSourceError as problem:
        return [fail("pose", str(problem), "plug it in, or correct [pose] in the configuration")]
    deadline_s = time.monotonic() + LISTENING_S
    while not isfinite(pose.read(time.monotonic()).x_m) and time.monotonic() < deadline_s:
        time.sleep(0.01)
    pose.close()
    report = pose.report()
    return [ok_if(not report.trouble, "pose", report.message, report.what_to_do)]


def _examine_means(configuration: Configuration) -> Iterator[Finding]:
    """Yield what concerns a daemon that this user would start: folder of logs, limits, settings of the buses."""
    if configuration.log.enabled:
        yield log_space(configuration.log)
        yield examine_folder(Path(configuration.log.directory), this_account())
    yield from examine_limits(configuration.loop, process_limits(ROOT, None))
    opened = [f"bus.{name}" for name in configuration.bus]  # examine_drives reported whether they open
    yield from (each for each in examine_buses(configuration, read_links()) if each.id not in opened)
