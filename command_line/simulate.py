"""Runs `mudskipper simulate`: the simulated robot alone, for a daemon in another terminal."""

import os
import signal
import sys
from functools import partial
from pathlib import Path
from typing import Annotated

from command_line import exit_codes
from command_line.errors import CommandError, usage_error
from command_line.screen import complain
from command_line.shared_options import Seed
from drivers.can.bus_lock import BusRole, bus_owner
from experiments.study.option import Option
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration, parse_configuration
from firmware_host.configuration.toml_records import read_text
from operator_client.default_paths import SIMULATED
from simulation.harness import peer
from simulation.harness.local_setup import configuration_text, local_copy, make_buses, named_folder, write_local_setup
from simulation.harness.world import load_world
from simulation.mud.clay import MUDS

RESET = signal.SIGUSR1, "moved back; 'mudskipper clear' clears the fault"
EMERGENCY_STOP = signal.SIGUSR2, "pressed, or released if it was pressed; 'mudskipper status' says which"


def simulate(
    *,
    bus: Annotated[str, Option("of the local bus")] = SIMULATED,
    config: Annotated[Path | None, Option("the robot of this configuration, on its buses")] = None,
    local: Annotated[bool, Option("with --config: on local buses instead of its own")] = False,
    reset: Annotated[
        bool, Option("move the joints of the robot that is simulated back into their range", alternative="task")
    ] = False,
    emergency_stop: Annotated[
        bool, Option("press the emergency stop of the robot that is simulated, or release it", alternative="task")
    ] = False,
    mud: Annotated[
        tuple[str, ...],
        Option("water content: 48.5, 53.1, 45.3", metavar="W", choices=tuple(MUDS), alternative="task"),
    ] = (),
    world: Annotated[Path | None, Option("describes the ground and more", alternative="task")] = None,
    on_blocks: Annotated[bool, Option("no mud: the flippers move in air, for the bench", alternative="task")] = False,
    seed: Seed = 1,
) -> int:
    if local and not config:
        raise usage_error("--local belongs to --config FILE; without a file the robot is local anyway")
    wanted = RESET if reset else EMERGENCY_STOP if emergency_stop else None
    ground = peer.Ground(waters=mud, world=world, on_blocks=on_blocks)
    if world and not wanted:
        complain(*load_world(world).warnings)  # before anything is made; the peer reads it again
    if config and not local:  # needs no folder, which a service without a home folder does not have
        if wanted:
            return _signal(*wanted, config)
        configuration = load_configuration(config)
        return peer.simulate(
            configuration, ground, seed, partial(_announce, config, configuration, f"--config {config}")
        )
    try:
        folder = named_folder(bus)
    except ValueError as problem:
        raise usage_error(f"--bus {problem}") from None
    if wanted:
        return _signal(*wanted, folder / "mudskipper.toml")
    return _simulate_locally(folder, config, ground, seed, "" if bus == SIMULATED else f"--bus {bus}")


def _simulate_locally(folder: Path, config: Path | None, ground: peer.Ground, seed: int, named: str) -> int:
    """Simulate the robot of a configuration, or the usual one, on local buses in this folder."""
    # a folder of logs has one daemon: it keeps the descriptions of walks there
    logs = Path("mudskipper-simulated" + f"-{folder.name}" * (folder.name != SIMULATED)).absolute()
    text = configuration_text(folder, logs)
    if config:
        text = read_text(config)
        parse_configuration(text, config)  # names the keys of the file itself
        text = local_copy(text, folder, logs)
    make_buses(folder)
    configuration = parse_configuration(text, config)
    return peer.simulate(
        configuration,
        ground,
        seed,
        lambda: _announce(write_local_setup(folder, logs, text), configuration, named),
    )


def _announce(path: Path, configuration: Configuration, named: str) -> None:
    programs = Path(sys.executable).parent
    print(f"Simulating, until Ctrl-C. In other terminals:\n  {programs}/mudskipperd --config {path}")
    print(f"  export MUDSKIPPER_SOCKET={configuration.status.socket}; {programs}/mudskipper status")
    reset = f"mudskipper simulate --reset {named}".rstrip()
    print(f"'{reset}' moves joints back that lie beyond their limits.")
    stop = f"mudskipper simulate --emergency-stop {named}".rstrip()
    print(f"'{stop}' presses the emergency stop, and again to release it.", flush=True)


def _signal(number: signal.Signals, answer: str, path: Path) -> int:
    """Signal the process that simulates the robot of this configuration; the lock of its buses names it."""
    for bus in parse_configuration(read_text(path), path).bus.values():
        if pid := bus_owner(BusRole.DRIVES, bus.interface, bus.channel):
            os.kill(pid, number)
            print(answer)
            return exit_codes.OK
    raise CommandError(f"no robot is simulated on the buses of {path}: 'mudskipper simulate' makes one")
