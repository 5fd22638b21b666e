"""Turns the errors of the commands on logs into messages and exit statuses, and says where a log ends early."""

import argparse
from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path

from command_line import exit_codes
from command_line.screen import complain
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.log.log_file import is_being_written
from logs.files.log_error import LogError

Command = Callable[[argparse.Namespace], int]


class UsageError(Exception):
    """The options do not fit the log."""


def explain_errors(command: Command) -> Command:
    """Make a command print the message of an error and return its exit status."""

    @wraps(command)
    def run(options: argparse.Namespace) -> int:
        try:
            return command(options)
        except ConfigurationError as problem:
            complain(*problem.problems)
            return exit_codes.CONFIGURATION
        except (LogError, UsageError) as problem:
            complain(str(problem))
            return exit_codes.USAGE if isinstance(problem, UsageError) else exit_codes.UNHEALTHY

    return run


def complain_of_end(files: Sequence[Path], complete: bool) -> None:
    """Say that the daemon still writes a log, or that its writer was cut off."""
    if not complete:
        is_written = any(map(is_being_written, files))
        what, until = ("is still being written", "now") if is_written else ("was cut off", "there")
        complain(f"the log {what}: everything up to {until} was read")
