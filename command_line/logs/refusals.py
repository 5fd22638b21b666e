"""Turns the errors of the commands on logs into messages and exit statuses."""

import argparse
from collections.abc import Callable
from functools import wraps

from command_line import exit_codes
from command_line.screen import complain
from firmware_host.configuration.file_problems import ConfigurationError
from logs.files.log_error import LogError

Command = Callable[[argparse.Namespace], int]


class UsageError(Exception):
    """The options do not fit the log."""


def explain_errors(command: Command) -> Command:
    """Makes a command print the message of an error and return its exit status."""

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
