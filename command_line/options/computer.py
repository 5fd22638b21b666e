"""Options of the commands that set up and check a computer, and serve viewers from it."""

import argparse
import os
from pathlib import Path

from command_line.option_types import geometry_value, node_id, whole
from command_line.options.shared import add_config, add_json, add_socket
from drivers.drive_types import DRIVE_TYPES

Parser = argparse.ArgumentParser


def add_live(live: Parser) -> None:
    add_socket(live)
    live.add_argument("--page", action="store_true", help="serve a page for a browser in place of a viewer's WebSocket")
    live.add_argument("--host", default="127.0.0.1", metavar="ADDRESS", help="to listen on (default: %(default)s)")
    live.add_argument("--port", type=whole(0, 65535), default=8765, metavar="N", help="0: a free one (default: 8765)")


def add_doctor(doctor: Parser) -> None:
    add_config(doctor, "of the daemon (default: %(default)s)")
    add_json(doctor)
    socket = os.environ.get("MUDSKIPPER_SOCKET")
    doctor.add_argument(
        "--socket",
        type=Path,
        default=Path(socket) if socket else None,
        metavar="PATH",
        help="Unix socket of the daemon (default: $MUDSKIPPER_SOCKET, else the configured one)",
    )


def add_init(init: Parser) -> None:
    """Without an option the question is asked; without a terminal, or with --defaults, the default is the answer."""
    option = init.add_argument
    option(
        "file", type=Path, nargs="?", default=Path("mudskipper.toml"), help="new file (default: %(default)s); -: print"
    )
    option("--defaults", action="store_true", help="ask nothing")
    option("--name", metavar="NAME", help="of the robot, in its logs")
    option("--flippers", choices=("left", "right", "both"), help="one with two motors, or both with four")
    option("--base", choices=("fixed", "moves"), help="a bench, or a body that the flippers move")
    option("--drive", choices=tuple(DRIVE_TYPES), help="protocol of the drives")
    option("--interface", metavar="NAME", help="of python-can, such as socketcan")
    option("--from-bus", action="store_true", help="search its channels for drives, and write what is found")
    option("--fd", action="store_true", help="with --from-bus: it carries CAN FD")
    option(
        "--channel", action="append", metavar="NAME", help="such as can0; twice: the left and the right flipper's own"
    )
    option("--node", type=node_id, action="append", metavar="JOINT=ID", help="right_sweep=3, repeatable")
    option("--plate", metavar="FILE", help="corners of a plate that is no rectangle: lines of outward, upward in m")
    option("--set", type=geometry_value, action="append", metavar="KEY=M", help="geometry: drop_m=0.05, repeatable")


def add_install(install: Parser) -> None:
    install.add_argument("--dry-run", action="store_true", help="only show what would be done")
    install.add_argument("--root", type=Path, default=Path("/"), metavar="DIR", help="root folder of another system")


def add_uninstall(uninstall: Parser) -> None:
    uninstall.add_argument("--purge", action="store_true", help="remove configuration, logs and user too")
    add_install(uninstall)
