"""`mudskipper check` where no daemon runs: checks whether one would start, and whether its drives are heard.

It listens to the buses and transmits nothing.
"""

from __future__ import annotations

import time
from math import isfinite
from pathlib import Path
from typing import Any

from control.records import JOINTS
from drivers.drive_types import make_drives
from drivers.pose.pose_port import PoseSourceError
from firmware_host.buses import BusError, open_ports
from firmware_host.computer.can_links import examine_buses, read_links
from firmware_host.computer.host_checks import examine_folder, examine_limits, this_account
from firmware_host.computer.host_facts import process_limits
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration
from firmware_host.configuration.toml_records import ConfigurationError
from firmware_host.operator.reports import check_item
from firmware_host.pose_sources import open_pose

LISTENING_S = 0.6  # six heartbeats


def check_without_daemon(path: Path, why_no_daemon: str) -> list[dict[str, Any]]:
    fix = "start it ('systemctl start mudskipper'), name its socket with --socket, or join the group that owns it"
    items = [check_item("daemon", False, why_no_daemon, fix)]
    try:
        configuration = load_configuration(path)
    except ConfigurationError as problem:
        return items + [check_item("configuration", False, message, f"edit {path}") for message in problem.problems]
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
        time.sleep(0.01)
        states = drives.read(time.monotonic())
    fix = "check its power, wiring, node id and cyclic message periods"
    items = [
        check_item(f"drive.{joint}", state.heard, "heard" if state.heard else "not heard", fix)
        for joint, state in zip(JOINTS, states, strict=True)
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
        findings.append(examine_folder(Path(configuration.log.directory), this_account()))
    findings += examine_limits(configuration.loop, process_limits(Path("/"), None))
    opened = [f"bus.{name}" for name in configuration.bus]  # _drive_items reported whether they open
    findings += [finding for finding in examine_buses(configuration, read_links()) if finding.id not in opened]
    return [finding.as_check_item for finding in findings]
