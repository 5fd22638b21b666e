"""Runs `mudskipper simulate`: the simulated robot alone, for a daemon in another terminal."""

import argparse
import os
import sys
from functools import partial
from pathlib import Path

from command_line import exit_codes
from command_line.screen import complain
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import load_configuration, parse_configuration
from simulation.harness import peer
from simulation.harness.local_setup import configuration_text, make_buses, named_folder, write_local_setup
from simulation.harness.world import load_world
from simulation.mud.clay import MUDS


def simulate(options: argparse.Namespace) -> int:
    unknown = [water for water in options.mud or () if water not in MUDS]
    if unknown:
        complain(f"--mud {unknown[0]}: known water contents are {', '.join(MUDS)}")
        return exit_codes.USAGE
    try:
        if options.world:
            complain(*load_world(options.world).warnings)  # before anything is made; the peer reads it again
        if options.config:
            return peer.simulate(load_configuration(options.config), options)
        folder, logs = named_folder(options.bus), Path("logs").absolute()
        make_buses(folder)
        configuration = parse_configuration(configuration_text(folder, logs))
        return peer.simulate(configuration, options, partial(_write_and_announce, folder, logs))
    except ConfigurationError as problem:
        complain(*problem.problems)
        return exit_codes.CONFIGURATION
    except ValueError as problem:
        complain(f"--bus {problem}")
        return exit_codes.USAGE


def _write_and_announce(folder: Path, logs: Path) -> None:
    path = write_local_setup(folder, logs)
    programs = Path(sys.executable).parent
    print(f"Simulating, until Ctrl-C. In other terminals:\n  {programs}/mudskipperd --config {path}")
    print(f"  export MUDSKIPPER_SOCKET={folder}/mudskipper.sock; {programs}/mudskipper status")
    print(f"'kill -USR1 {os.getpid()}' moves joints back that lie beyond their limits.", flush=True)
