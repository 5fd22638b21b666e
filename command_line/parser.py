"""The parser of the command line. A command is imported when it is used, so that `status` starts fast."""

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any, NoReturn

from command_line import exit_codes
from command_line.commands import COMMANDS, Command, Found
from command_line.function_options import add_function_options
from command_line.screen import complaints

vars(argparse)["_"] = str  # its messages stay English, as MISSING is; looking for a translation takes 2 ms
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

    def __init__(self, *arguments: Any, target: Any = None, **keywords: Any) -> None:
        """`target`: what the parser is for, as in COMMANDS."""
        super().__init__(*arguments, **keywords | {"allow_abbrev": False, "formatter_class": Formatter})
        self._target = target

    def add_target(self) -> None:
        """Add the options of the function or the study, or the commands of the group, once."""
        target, self._target = self._target, None
        if isinstance(target, Found):
            target = _named(target.function)()
        elif isinstance(target, str):
            target = _named(target)
        if isinstance(target, Mapping):
            self.add_commands(target)
        elif target is not None:
            add_function_options(self, *(target.functions() if hasattr(target, "functions") else [target]))
            self.set_defaults(target=target)

    def add_commands(self, commands: Mapping[str, Command], title: str = "action") -> None:
        """Add a parser for each command."""
        choices = self.add_subparsers(dest=title, required=True, metavar=title, prog=self.prog)
        for name, (target, text) in commands.items():
            choices.add_parser(name, help=text.partition("\n")[0], description=text, target=target)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse unknown arguments, so that a command names its own usage, not that of `mudskipper`."""
        self.add_target()
        self._require_command_first(sys.argv[1:] if args is None else args)
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            from control.computing.suggestion import suggestion

            options = [name for action in self._actions for name in action.option_strings]
            self.error(f"unrecognized arguments: {' '.join(unknown)}; {suggestion(unknown[0], options)}")
        return found, unknown

    def _require_command_first(self, given: Sequence[str]) -> None:
        """Refuse an option of a command that stands before it: argparse would take its value for the command."""
        option = given[0].partition("=")[0] if given else ""
        if self._subparsers and option.startswith("--") and option not in self._option_string_actions:
            word = self._subparsers._group_actions[0].dest.upper()
            self.error(
                f"{option} stands after the {word.lower()} that it belongs to: '{self.prog} {word} {option} ...'"
            )

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a value that is no choice with the choices, the most similar first."""
        if action.choices is not None and value not in action.choices:
            from control.computing.suggestion import suggestion

            existing = suggestion(str(value), map(str, action.choices))
            raise argparse.ArgumentError(action, f"there is no {value!r}; {existing}")

    def error(self, message: str) -> NoReturn:
        if message.startswith(MISSING):
            message = f"{message} ('{self.prog} --help' explains them)"
        complaints.append(message)
        super().error(message)


def _named(name: str) -> Any:
    module, attribute = name.rsplit(".", 1)
    return getattr(import_module(f"command_line.{module}"), attribute)


class PrintVersion(argparse.Action):
    """Prints the installed version and ends."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from firmware_host.software_version import software_version  # slow to import, and seldom wanted

        print(f"mudskipper {software_version()}")
        parser.exit()


class PrintCompletion(argparse.Action):
    """Prints a completion script for a shell and ends."""

    def __call__(self, parser: argparse.ArgumentParser, _: object, shell: object, __: object = None) -> NoReturn:
        from pathlib import Path

        import shtab

        from control.records import JOINTS

        for action in complete(parser):
            if offers := getattr(action, "offers", ""):
                words = " ".join(offers.format(joint=joint) for joint in JOINTS)
                action.complete = shtab.cmd(f"printf '%s\\n' {words}")  # type: ignore[attr-defined]
            elif action.type is Path or action.metavar == "PATH":
                action.complete = shtab.FILE  # type: ignore[attr-defined]
        print(shtab.complete(parser, str(shell)))
        parser.exit()


def build_parser(given: Sequence[str] = ()) -> Parser:
    """Build the parser of this command line: of that command alone where one is named, else of all commands."""
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
        choices=("bash", "zsh", "fish", "tcsh"),
        help="print a completion script for this shell and exit",
    )
    chosen = {name: COMMANDS[name] for name in given[:1] if name in COMMANDS}
    parser.add_commands(chosen or COMMANDS, "command")
    return parser


def complete(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Add the options of all commands, for documentation and completion, and return them."""
    if isinstance(parser, Parser):
        with suppress(ModuleNotFoundError):  # of an extra; the command itself says which
            parser.add_target()
    found = [*parser._actions]
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                found += complete(command)
    return found
