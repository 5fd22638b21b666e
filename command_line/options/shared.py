"""Options that every study has, whatever its function declares."""

import argparse
from pathlib import Path

from command_line.shared_options import default_socket


def add_socket(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--socket",
        type=Path,
        default=default_socket(),
        metavar="PATH",
        help="Unix socket of the daemon (default: $MUDSKIPPER_SOCKET, else that of the service or the simulated robot)",
    )


def add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print JSON for programs")
