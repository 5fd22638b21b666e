"""Options of the commands on motor drives, while the daemon does not run."""

import argparse
from pathlib import Path

from command_line.options.shared import Commands, add, add_json, default_configuration
from drivers.drive_types import DRIVE_BENCHES

Parser = argparse.ArgumentParser


def add_drives(drives: Parser) -> None:
    actions = drives.add_subparsers(dest="action", required=True, metavar="action")
    _add_find(actions)
    _add_setup(actions)
    _add_zero(actions)


def _add_find(actions: Commands) -> None:
    find = add(actions, "find", "drives.find.find", "List the drives that answer on the buses.")
    _add_configuration(find)
    add_json(find)
    find.add_argument("--bus", action="append", metavar="NAME", help="configured bus, repeatable (default: all)")
    find.add_argument("--interface", metavar="NAME", help="of python-can, such as socketcan, without a configuration")
    find.add_argument("--channel", metavar="NAME", help="of that interface, such as can0")
    find.add_argument("--fd", action="store_true", help="that interface carries CAN FD")
    find.add_argument(
        "--type", action="append", choices=tuple(DRIVE_BENCHES), help="ask drives of this type alone, repeatable"
    )


def _add_setup(actions: Commands) -> None:
    text = "Compare the drives' settings with the configuration, and write those that differ."
    setup = add(actions, "setup", "drives.setup.setup", text)
    _add_configuration(setup)
    setup.add_argument("joint", nargs="*", metavar="JOINT", help="such as left_sweep (default: all)")
    what = setup.add_mutually_exclusive_group()
    what.add_argument("--write", action="store_true", help="write and store what differs, one drive at a time")
    what.add_argument("--restore", type=Path, metavar="FILE", help="write the old settings of this file again")
    setup.add_argument(
        "--backup", type=Path, metavar="FILE", help="with --write: new file for the old settings; else: compare with it"
    )
    setup.add_argument(
        "--endpoints",
        type=Path,
        action="append",
        metavar="FILE",
        help="flat_endpoints.json of an ODrive's build, repeatable (default: those next to the configuration)",
    )


def _add_zero(actions: Commands) -> None:
    text = "Make a joint's present position its angle zero, in the configuration file."
    zero = add(actions, "zero", "drives.zero.zero", text)
    _add_configuration(zero)
    zero.add_argument("joint", nargs="+", metavar="JOINT", help="such as left_sweep")
    zero.add_argument("--yes", action="store_true", help="write it without asking")


def _add_configuration(parser: Parser) -> None:
    parser.add_argument(
        "--config",
        type=Path,
        default=default_configuration(),
        metavar="FILE",
        help="of the robot (default: that of the daemon, or of the simulated robot)",
    )
