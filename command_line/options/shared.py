"""Options that several commands have: the daemon's socket, the configuration, JSON."""

import argparse
import os
from pathlib import Path
from typing import TypeAlias

from drivers.can.run_folder import find_run_folder

DEFAULT_SOCKET = "/run/mudskipper/mudskipper.sock"
SIMULATED = "robot"  # the name that `mudskipper simulate` has without --bus
AXES = ("x", "y", "z")  # of motion capture
DEFAULT_CONFIG = "/etc/mudskipper/mudskipper.toml"
Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"  # generic for type checkers alone


def add(commands: Commands, name: str, function: str, text: str) -> argparse.ArgumentParser:
    """Adds a command of a group, such as `log info`, that runs `function`."""
    command = commands.add_parser(name, help=text, description=text)
    command.set_defaults(function=function)
    return command


def default_socket() -> Path:
    """Returns $MUDSKIPPER_SOCKET, else the service's socket; where no service runs, that of `mudskipper simulate`."""
    given, service = os.environ.get("MUDSKIPPER_SOCKET"), Path(DEFAULT_SOCKET)
    if given or service.exists():
        return Path(given) if given else service
    folder = find_run_folder()
    simulated = folder / SIMULATED / service.name if folder else service
    return simulated if simulated.exists() else service


def default_configuration() -> Path:
    """Returns the daemon's configuration; where there is none, that of `mudskipper simulate`."""
    configured, folder = Path(DEFAULT_CONFIG), find_run_folder()
    simulated = folder / SIMULATED / configured.name if folder else configured
    return simulated if simulated.exists() and not configured.exists() else configured


def add_socket(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--socket",
        type=Path,
        default=default_socket(),
        metavar="PATH",
        help="Unix socket of the daemon (default: $MUDSKIPPER_SOCKET, else that of the service or the simulated robot)",
    )


def add_config(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("--config", type=Path, default=Path(DEFAULT_CONFIG), metavar="FILE", help=text)


def add_vertical(parser: argparse.ArgumentParser, default: str | None = None) -> None:
    parser.add_argument(
        "--vertical",
        choices=AXES,
        default=default,
        metavar="AXIS",
        help="axis of a CSV log's motion capture that points up: x, y or z (default: y)",
    )


def add_json(*parsers: argparse.ArgumentParser) -> None:
    for parser in parsers:
        parser.add_argument("--json", action="store_true", help="print JSON for programs")
