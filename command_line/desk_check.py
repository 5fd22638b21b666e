"""`mudskipper check` where no daemon runs: would one start here, and are the drives there?

Listens only; nothing is transmitted.
"""

from __future__ import annotations

import os
import resource
import time
from pathlib import Path
from typing import Any

from drivers.odrive_drives import OdriveDrives
from firmware_host.buses import BusError, open_ports
from firmware_host.configuration import Configuration, ConfigurationError, load_configuration
from firmware_host.reports import check_item

LISTENING_S = 0.6  # six heartbeats


def desk_check(path: Path, why_no_daemon: str) -> list[dict[str, Any]]:
    fix = "start it ('systemctl start mudskipper'), name its socket with --socket, or join the group that owns it"
    items = [check_item("daemon", False, why_no_daemon, fix)]
    try:
        configuration = load_configuration(path)
    except ConfigurationError as problem:
        return items + [check_item("configuration", False, sentence, f"edit {path}") for sentence in problem.problems]
    items.append(check_item("configuration", True, str(path), ""))
    return items + _drive_items(configuration) + _host_items(configuration)


def _drive_items(configuration: Configuration) -> list[dict[str, Any]]:
    try:
        ports = open_ports(configuration.bus)
    except BusError as problem:
        return [check_item("bus", False, str(problem), "bring the interface up: README, 'On the robot'")]
    drives = OdriveDrives(configuration.drive, ports, configuration.limits, configuration.watchdog_endpoints)
    deadline_s = time.monotonic() + LISTENING_S
    while not drives.heard and time.monotonic() < deadline_s:
        drives.read(time.monotonic())
        time.sleep(0.01)
    fix = "check its power, wiring, node id and cyclic message periods"
    items = [
        check_item(f"drive.{axis.joint}", axis.heard, "heard" if axis.heard else "not heard", fix)
        for axis in drives.axes
    ]
    drives.close()
    return items


def _host_items(configuration: Configuration) -> list[dict[str, Any]]:
    items = []
    if configuration.log.enabled:
        folder = Path(configuration.log.directory)
        nearest = next(place for place in (folder.absolute(), *folder.absolute().parents) if place.exists())
        writable = os.access(nearest, os.W_OK)
        text = f"{folder}: {'writable' if writable else 'not writable'}"
        items.append(check_item("log", writable, text, f"own {nearest}"))
    priority = configuration.loop.priority
    if priority:
        permitted = _may_schedule(priority)
        text = f"real-time priority {priority} is {'permitted' if permitted else 'not permitted: the loop may be late'}"
        items.append(check_item("realtime", permitted, text, "raise the rtprio limit (LimitRTPRIO= in the unit)"))
    return items


def _may_schedule(priority: int) -> bool:
    limit, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    return os.geteuid() == 0 or limit == resource.RLIM_INFINITY or limit >= priority
