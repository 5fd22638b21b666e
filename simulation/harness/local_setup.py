"""A folder in which a simulated robot and a real daemon find each other on a machine without CAN.

It holds the daemon's configuration, the two local buses, the status socket and the pose socket. The configuration is
that of a robot: nothing in it says that the drives are simulated, only that the buses are local. On two processors that
all processes share, signals arrive less punctually than on a robot, so their bounds are wider.
"""

import json
from pathlib import Path

from drivers.can.run_folder import make_own_folder, run_folder, write_private_file

CONFIGURATION = """\
# A robot whose drives are simulated on local buses.

[robot]
name = "simulated"

[bus.left]
interface = "mudskipper_local"
channel = {left}

[bus.right]
interface = "mudskipper_local"
channel = {right}

[drive.left_sweep]
bus = "left"
node_id = 0
sign = 1
command_delay_s = 0.25

[drive.left_adduction]
bus = "left"
node_id = 1
sign = -1
command_delay_s = 0.25

[drive.right_sweep]
bus = "right"
node_id = 3
sign = -1
command_delay_s = 0.25

[drive.right_adduction]
bus = "right"
node_id = 2
sign = 1
command_delay_s = 0.25

# As a calibration of these joints would show.
[friction.left_sweep]
viscous_nm_s = 0.002

[friction.left_adduction]
viscous_nm_s = 0.002

[friction.right_sweep]
viscous_nm_s = 0.002

[friction.right_adduction]
viscous_nm_s = 0.002

# The endpoints of the watchdogs in the simulated drives.
[[watchdog_endpoints]]
firmware = "0.6.11"
hardware = "0.0.0"
enable = 2
timeout = 1

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


def named_folder(name: str) -> Path:
    """Returns the same private folder for every process of this user: short, as the path of a Unix socket must be.

    Raises ValueError for a name with a path in it, and OSError where another user could write to the folder.
    """
    if Path(name).name != name or name == "..":
        raise ValueError(f"{name!r} is not a plain name")
    return make_own_folder(run_folder() / name)


def make_buses(folder: Path) -> None:
    """Makes the folders of the two local buses."""
    for name in ("left", "right"):
        make_own_folder(folder / name)


def write_local_setup(folder: Path, logs: Path) -> Path:
    """Returns the configuration's path, for `mudskipperd --config` and for the simulated robot."""
    make_buses(folder)
    path = folder / "mudskipper.toml"
    write_private_file(path, configuration_text(folder, logs.absolute()))
    return path


def configuration_text(folder: Path, logs: Path) -> str:
    """Writes paths as JSON strings, which are TOML strings too."""
    paths = {
        "left": folder / "left",
        "right": folder / "right",
        "logs": logs,
        "status": folder / "mudskipper.sock",
        "pose": folder / "pose.sock",
    }
    return CONFIGURATION.format(**{name: json.dumps(str(path)) for name, path in paths.items()})
