"""A folder in which a simulated robot and a real daemon find each other on a machine without CAN.

It holds the daemon's configuration, the two local buses, the status socket and the pose socket. The configuration is
that of a robot: nothing in it says that the drives are simulated, only that the buses are local. On two processors that
all processes share, signals arrive less punctually than on a robot, so their bounds are wider.
"""

import ctypes
import json
import os
import tomllib
from pathlib import Path
from typing import Any

import tomlkit

from control.records import TWO_FLIPPERS, Rig
from drivers.can.run_folder import make_own_folder, run_folder, write_private_file
from simulation.devices.drive_types import PUBLISHED_NUMBERS
from simulation.harness.drive_presets import mark_calibrated

FEW_PROCESSORS = 2  # as of a virtual machine; a slow computer with more needs one for each of both
HEAD = """\
# A robot whose drives are simulated on local buses.

[robot]
name = "simulated"

"""
BUS = """\
[bus.{name}]
interface = "mudskipper_local"
channel = {channel}

"""
DRIVE = """\
[drive.{joint}]
bus = "{bus}"
node_id = {node_id}
sign = {sign}
command_delay_s = 0.25
calibrated = {{ date = "2026-11-28", drive = "{bus} {node_id}" }}

"""
FRICTION = """\
[friction.{joint}]
viscous_nm_s = 0.002

"""
WATCHDOGS = """\
# The endpoints of the watchdogs in the simulated drives.
[[watchdog_endpoints]]
firmware = "0.6.11"
hardware = "0.0.0"
enable = 2
timeout = 1

"""
LOOP = """\

[loop]
cpu = {cpu}  # the simulated robot runs there too: a host that halts one of two processors halts both or none
"""
TAIL = """\
[faults]
late_s = 0.5
quiet_s = 0.5
silence_s = 0.5
disk_free_fraction = 0.0
jump_rad = 2.0
fast_s = 0.2
lag_s = 0.5
lag_fraction = 1.0
crawl_s = 0.5

[safety]
weakened = "a simulated robot on a computer without real time"

[log]
directory = {logs}
min_free_fraction = 0.0  # a full disk of a desktop computer deletes no logs

[status]
socket = {status}

[pose]
socket = {pose}

[failures]
allowed = true
"""
WIRED = {"left_sweep": (0, 1), "left_adduction": (1, -1), "right_sweep": (3, -1), "right_adduction": (2, 1)}


def configuration_template(rig: Rig = TWO_FLIPPERS) -> str:
    """Return the configuration of a simulated rig, each flipper on a bus of its name; paths are still to be filled in.

    `WIRED` has node id and sign of each joint.
    """
    parts = [HEAD]
    if rig != TWO_FLIPPERS:
        parts.append(f"[rig]\nflippers = {json.dumps(rig.flippers)}\n\n")
    parts += [BUS.format(name=flipper, channel=f"{{{flipper}}}") for flipper in rig.flippers]
    for joint in rig.joints:
        node_id, sign = WIRED[joint]
        drive = DRIVE.format(joint=joint, bus=joint.split("_")[0], node_id=node_id, sign=sign)
        parts.append(drive.replace("{", "{{").replace("}", "}}"))
    parts.append("# As a calibration of these joints would show.\n")
    parts += [FRICTION.format(joint=joint) for joint in rig.joints]
    return "".join([*parts, WATCHDOGS, TAIL])


CONFIGURATION = configuration_template()


def named_folder(name: str) -> Path:
    """Return the same private folder for every process of this user: short, as the path of a Unix socket must be.

    Raises ValueError for a name with a path in it, and OSError where another user could write to the folder.
    """
    if Path(name).name != name or name in ("", ".."):
        raise ValueError(f"{name!r} is not a plain name")
    return make_own_folder(run_folder() / name)


def make_buses(folder: Path) -> None:
    """Make the folders of the two local buses."""
    for name in ("left", "right"):
        make_own_folder(folder / name)


def write_local_setup(folder: Path, logs: Path, text: str = "") -> Path:
    """Return the configuration's path, for `mudskipperd --config` and for the simulated robot."""
    make_buses(folder)
    path = folder / "mudskipper.toml"
    write_private_file(path, text or configuration_text(folder, logs.absolute()))
    write_private_file(
        folder / "flat_endpoints.json", json.dumps(PUBLISHED_NUMBERS, indent=1)
    )  # as the drives' maker does
    return path


def configuration_text(folder: Path, logs: Path) -> str:
    return (CONFIGURATION + LOOP).format(**_local_values(folder, logs))


def _local_values(folder: Path, logs: Path) -> dict[str, str]:
    """Return paths as JSON strings, which are TOML strings too, and, of two processors, the one that runs this."""
    paths = {
        "left": folder / "left",
        "right": folder / "right",
        "logs": logs,
        "status": folder / "mudskipper.sock",
        "pose": folder / "pose.sock",
    }
    values = {name: json.dumps(str(path)) for name, path in paths.items()}
    few = len(os.sched_getaffinity(0)) <= FEW_PROCESSORS
    return values | {"cpu": str(ctypes.CDLL(None).sched_getcpu() if few else -1)}


def with_simulated_watchdogs(text: str) -> str:
    """Return a robot's configuration that knows the firmware of the simulated drives too."""
    document: dict[str, Any] = tomlkit.parse(text)
    _add_watchdogs(document)
    return tomlkit.dumps(document)


def _add_watchdogs(document: dict[str, Any]) -> None:
    endpoints = tomllib.loads(WATCHDOGS)["watchdog_endpoints"]
    document.setdefault("watchdog_endpoints", tomlkit.aot()).extend(endpoints)


def local_copy(text: str, folder: Path, logs: Path) -> str:
    """Return a robot's configuration for this computer: local buses, and sockets, bounds and logs as of `simulate`.

    Geometry, drives, gait, limits and gains stay those of the robot, and its emulated drives are calibrated.
    """
    document: dict[str, Any] = tomlkit.parse(text)
    mark_calibrated(document)
    for number, bus in enumerate(document["bus"].values()):
        bus.pop("options", None)
        bus |= {"interface": "mudskipper_local", "channel": str(make_own_folder(folder / f"bus{number}"))}
    for group in ("read_group", "drive_group"):  # of the robot's computer
        document.get("status", {}).pop(group, None)
    if document.get("emergency_stop", {}).get("source") in ("gpio", "key"):  # likewise
        del document["emergency_stop"]
    local = tomllib.loads((TAIL + LOOP).format(**_local_values(folder, logs)))
    _add_watchdogs(document)
    if document.get("pose", {}).get("source") not in (None, "", "none"):
        local["pose"]["source"] = "socket"
    for section, values in local.items():
        document.setdefault(section, tomlkit.table()).update(values)
    return tomlkit.dumps(document)
