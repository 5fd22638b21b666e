"""The parser of the command line. The options of a command are added when the command is used: `status` starts fast."""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any, NoReturn

from command_line import exit_codes
from command_line.commands import COMMANDS
from command_line.screen import complaints

MISSING = "the following arguments are required"  # as argparse says it


class Formatter(argparse.HelpFormatter):
    """Finds the terminal's width without shutil, whose compression libraries take longer to load than the parser."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=_columns() - 2)


def _columns() -> int:
    given = os.environ.get("COLUMNS", "")
    if given.isdecimal() and int(given):
        return int(given)
    with suppress(AttributeError, ValueError, OSError):  # no standard output, or it is no terminal
        return os.get_terminal_size(sys.__stdout__.fileno()).columns  # type: ignore[union-attr]
    return 80


class Parser(argparse.ArgumentParser):
    """Refuses abbreviated options, also of its commands: `arm --f` would overrule failed checks."""

    def __init__(self, *arguments: Any, options: str | Callable[[Any], None] = "", **keywords: Any) -> None:
        """`options` is the function that adds the options, or its name as `module.function` in command_line.options."""
        super().__init__(*arguments, **keywords | {"allow_abbrev": False, "formatter_class": Formatter})
        self._options = options

    def add_options(self) -> None:
        add, self._options = self._options, ""
        if isinstance(add, str) and add:
            module, function = add.rsplit(".", 1)
            add = getattr(import_module(f"command_line.options.{module}"), function)
        if callable(add):
            add(self)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuses unknown arguments, so that a command names its own usage, not that of `mudskipper`."""
        self.add_options()
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        if message.startswith(MISSING):
            message = f"{message} ('{self.prog} --help' explains them)"
        complaints.append(message)
        super().error(message)


class PrintVersion(argparse.Action):
    """Prints the installed version and ends."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from firmware_host.software_version import software_version  # slow to import, and seldom wanted

        print(f"mudskipper {software_version()}")
        parser.exit()


class PrintCompletion(argparse.Action):
    """Prints a completion script for a shell and ends."""

    def __call__(self, parser: argparse.ArgumentParser, _: object, shell: object, __: object = None) -> NoReturn:
        import shtab

        add_all_options(parser)
        print(shtab.complete(parser, str(shell)))
        parser.exit()


def build_parser(given: Sequence[str] = ()) -> Parser:
    """Builds the parser of this command line: of that command alone where one is named, else of all commands."""
    statuses = ", ".join(f"{status} {meaning}" for status, meaning in exit_codes.MEANINGS.items())
    parser = Parser(
        prog="mudskipper",
        description="Operates a robot that crawls over mud on two flippers.",
        epilog=f"Exit status: {statuses}.",
    )
    parser.add_argument("--version", action=PrintVersion, nargs=0, help="print the version and exit")
    parser.add_argument(
        "--print-completion",
        action=PrintCompletion,
        choices=("bash", "zsh", "tcsh"),
        help="print a completion script for this shell and exit",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="command")
    described = {name: (module, *what) for module, group in COMMANDS.items() for name, what in group.items()}
    for name in {*given[:1]} & described.keys() or described:
        module, function, text = described[name]
        command = commands.add_parser(name, help=text, description=text, options=f"{module}.add_{name}")
        command.set_defaults(function=function)
    return parser


def add_all_options(parser: argparse.ArgumentParser) -> None:
    """Completes a parser for its documentation."""
    if isinstance(parser, Parser):
        parser.add_options()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                add_all_options(command)
