"""`mudskipper simulate`: the robot without its controller, for a daemon that is started by hand."""

from __future__ import annotations

import argparse
from pathlib import Path

from command_line import exit_codes
from command_line.screen import complain
from simulation import peer
from simulation.clay import MUDS
from simulation.local_setup import named_folder, write_local_setup


def simulate(options: argparse.Namespace) -> int:
    waters = options.mud or list(MUDS)
    unknown = [water for water in waters if water not in MUDS]
    if unknown:
        complain(f"--mud {unknown[0]}: known water contents are {', '.join(MUDS)}")
        return exit_codes.USAGE
    path = options.config or _local_configuration(options.bus)
    arguments = ["--config", str(path), "--seed", str(options.seed)]
    for water in waters:
        arguments += ["--mud", water]
    return peer.main(arguments)


def _local_configuration(bus: str) -> Path:
    folder = named_folder(bus)
    path = write_local_setup(folder, Path("logs"))
    print(f"The robot is on the bus. In other terminals:\n  mudskipperd --config {path}")
    print(f"  export MUDSKIPPER_SOCKET={folder}/mudskipper.sock; mudskipper status", flush=True)
    return path
