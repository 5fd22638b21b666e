"""Options of the commands that are not declared at their functions yet."""

import argparse
from pathlib import Path
from typing import TypeAlias

from command_line.shared_options import DEFAULT_CONFIG as DEFAULT_CONFIG
from command_line.shared_options import default_socket

AXES = ("x", "y", "z")  # of motion capture
Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"  # generic for type checkers alone


def add(commands: Commands, name: str, function: str, text: str) -> argparse.ArgumentParser:
    """Adds a command of a group, such as `log info`, that runs `function`."""
    command = commands.add_parser(name, help=text, description=text)
    command.set_defaults(function=function)
    return command


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
