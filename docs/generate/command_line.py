"""Writes the reference of the command line from the parser that reads it."""

import argparse
import os
from collections.abc import Iterator

from command_line import exit_codes
from command_line.parser import build_parser, complete
from docs.generate.markdown import code, table


def commands() -> Iterator[str]:
    os.environ["COLUMNS"] = "100"  # the width of a usage line
    parser = build_parser()
    complete(parser)
    yield from _options(parser)
    yield from _commands(parser)


def exit_statuses() -> Iterator[str]:
    rows = [(str(status), meaning) for status, meaning in exit_codes.MEANINGS.items()]
    yield from table(("status", "meaning"), rows)


def _commands(parser: argparse.ArgumentParser) -> Iterator[str]:
    """Yield the section of every command, those of a group after each other."""
    for group in parser._actions:
        if not isinstance(group, argparse._SubParsersAction):
            continue
        for command in group.choices.values():
            if any(isinstance(action, argparse._SubParsersAction) for action in command._actions):
                yield from _commands(command)
            else:
                yield from _section(command)


def _section(command: argparse.ArgumentParser) -> Iterator[str]:
    yield f"## {command.prog}"
    yield ""
    yield command.description or ""
    yield ""
    yield "```text"
    yield command.format_usage().removeprefix("usage: ").rstrip()
    yield "```"
    yield from _options(command)


def _options(command: argparse.ArgumentParser) -> Iterator[str]:
    rows = [_row(command, action) for action in command._actions if _is_documented(action)]
    if rows:
        yield from table(("argument", "meaning"), rows)


def _is_documented(action: argparse.Action) -> bool:
    return not isinstance(action, argparse._HelpAction | argparse._SubParsersAction)


def _row(command: argparse.ArgumentParser, action: argparse.Action) -> tuple[str, str]:
    formatter = command._get_formatter()
    value = formatter._format_args(action, formatter._get_default_metavar_for_optional(action))
    name = ", ".join(action.option_strings)
    return code(f"{name} {value}".strip()), formatter._expand_help(action) if action.help else ""
