"""Adds commands to the parser. All commands share this, and the options that find the daemon."""

import argparse
import os
from pathlib import Path
from typing import TypeAlias

DEFAULT_SOCKET = "/run/mudskipper/mudskipper.sock"
DEFAULT_CONFIG = "/etc/mudskipper/mudskipper.toml"
Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"  # generic for type checkers alone


def add(commands: Commands, name: str, function: str, text: str) -> argparse.ArgumentParser:
    """Adds a command that runs `function`, named as `module.function` below this package and imported on use."""
    command = commands.add_parser(name, help=text, description=text)
    command.set_defaults(function=function)
    return command


def add_socket(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--socket",
        type=Path,
        default=Path(os.environ.get("MUDSKIPPER_SOCKET", DEFAULT_SOCKET)),
        help="Unix socket of the daemon (default: $MUDSKIPPER_SOCKET or %(default)s)",
    )


def add_json(*parsers: argparse.ArgumentParser) -> None:
    for parser in parsers:
        parser.add_argument("--json", action="store_true", help="print JSON for programs")
