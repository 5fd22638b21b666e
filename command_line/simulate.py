"""Runs `mudskipper simulate`: the simulated robot alone, for a daemon in another terminal."""

import os
import sys
from functools import partial
from pathlib import Path
from typing import Annotated

from command_line.errors import usage_error
from command_line.screen import complain
from command_line.shared_options import SIMULATED, Seed
from experiments.study.option import Option
from firmware_host.configuration.loading import load_configuration, parse_configuration
from simulation.harness import peer
from simulation.harness.local_setup import configuration_text, make_buses, named_folder, write_local_setup
from simulation.harness.world import load_world
from simulation.mud.clay import MUDS


def simulate(
    *,
    bus: Annotated[str, Option("of the local bus")] = SIMULATED,
    config: Annotated[Path | None, Option("use the buses of this configuration")] = None,
    mud: Annotated[
        tuple[str, ...],
        Option("water content: 48.5, 53.1, 45.3", metavar="W", choices=tuple(MUDS), alternative="ground"),
    ] = (),
    world: Annotated[Path | None, Option("describes the ground and more", alternative="ground")] = None,
    on_blocks: Annotated[bool, Option("no mud: the flippers move in air, for the bench", alternative="ground")] = False,
    seed: Seed = 1,
) -> int:
    if world:
        complain(*load_world(world).warnings)  # before anything is made; the peer reads it again
    ground = peer.Ground(waters=mud, world=world, on_blocks=on_blocks)
    if config:
        return peer.simulate(load_configuration(config), ground, seed)
    try:
        folder = named_folder(bus)
    except ValueError as problem:
        raise usage_error(f"--bus {problem}") from None
    logs = Path("logs").absolute()
    make_buses(folder)
    configuration = parse_configuration(configuration_text(folder, logs))
    return peer.simulate(configuration, ground, seed, partial(_write_and_announce, folder, logs))


def _write_and_announce(folder: Path, logs: Path) -> None:
    path = write_local_setup(folder, logs)
    programs = Path(sys.executable).parent
    print(f"Simulating, until Ctrl-C. In other terminals:\n  {programs}/mudskipperd --config {path}")
    print(f"  export MUDSKIPPER_SOCKET={folder}/mudskipper.sock; {programs}/mudskipper status")
    print(f"'kill -USR1 {os.getpid()}' moves joints back that lie beyond their limits.")
    print(f"'kill -USR2 {os.getpid()}' presses the emergency stop, and again to release it.", flush=True)
