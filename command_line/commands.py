"""What the parsers of all commands share: how a command is added, and where the daemon is found."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

DEFAULT_SOCKET = "/run/mudskipper/mudskipper.sock"
DEFAULT_CONFIG = "/etc/mudskipper/mudskipper.toml"
if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]  # which is generic for type checkers alone
else:
    Commands = argparse._SubParsersAction


def add(commands: Commands, name: str, place: str, text: str) -> argparse.ArgumentParser:
    """`place` is `module.function` of this package, imported when the command is used."""
    command = commands.add_parser(name, help=text, description=text)
    command.set_defaults(place=place)
    return command


def add_socket(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--socket",
        type=Path,
        default=Path(os.environ.get("MUDSKIPPER_SOCKET", DEFAULT_SOCKET)),
        help="of the daemon (default: $MUDSKIPPER_SOCKET or %(default)s)",
    )
