"""The errors that end a command: their messages, and the exit status of each.

The modules that define them are imported once one is caught, since most commands do without most of them.
"""

import sys
from collections.abc import Sequence

from command_line import exit_codes
from command_line.screen import complain

NO_DAEMON = (
    "{}. Start it with 'systemctl start mudskipper', or name its socket with --socket. "
    "Without a robot, 'mudskipper simulate' makes one."
)
EXTRA_OF = {  # by module
    "matplotlib": "plots", "scipy": "plots", "PIL": "plots", "pyarrow": "data", "duckdb": "data", "pandas": "data",
    "distributed": "cluster", "evdev": "inputs", "zenoh": "ros2", "rosbags": "ros2",
}  # fmt: skip
PACKAGES = {"PIL": "pillow", "evdev": "evdev-binary", "zenoh": "eclipse-zenoh"}  # whose name is not that of the module


class CommandError(Exception):
    """A command cannot go on. Its messages are printed, and the status ends the program."""

    def __init__(self, *messages: str, status: int = exit_codes.UNHEALTHY) -> None:
        super().__init__("\n".join(messages))
        self.messages = messages
        self.status = status


def missing_library(module: str) -> str:
    """Return the message for a library of an extra that is not installed."""
    command = f"'{sys.executable} -m pip install {PACKAGES.get(module, module)}'"
    extra = f"install mudskipper with its extra '{EXTRA_OF[module]}'"
    return f"{module} is not installed, which this needs: {command}, or {extra}"


def usage_error(message: str) -> CommandError:
    """Return the error of options that cannot be used together or here."""
    return CommandError(message, status=exit_codes.USAGE)


def report(problem: Exception) -> int:
    """Print why a command ended and return its exit status. Raise an error that is not expected again."""
    messages, status = explain(problem)
    complain(*messages)
    return status


def explain(problem: Exception) -> tuple[Sequence[str], int]:
    """Return the messages and the exit status of an error. Raise one that is not expected again."""
    from operator_client.status_client import CallRefusedError, DroppedError, NoDaemonError, NotPermittedError

    text = str(problem)
    match problem:
        case CommandError():
            return problem.messages, problem.status
        case DroppedError():
            return [text], exit_codes.NO_DAEMON
        case NoDaemonError():
            return [NO_DAEMON.format(text)], exit_codes.NO_DAEMON
        case NotPermittedError():
            return [text], exit_codes.NOT_PERMITTED
        case CallRefusedError():
            return [text], exit_codes.REFUSED
        case ModuleNotFoundError(name=str(name)) if name.partition(".")[0] in EXTRA_OF:
            return [missing_library(name.partition(".")[0])], exit_codes.UNHEALTHY
    return _explain_files_and_buses(problem)


def _explain_files_and_buses(problem: Exception) -> tuple[Sequence[str], int]:
    from experiments.robot.bench_errors import AccessDeniedError, BenchError, DaemonLostError
    from firmware_host.buses import BusError
    from firmware_host.configuration.file_problems import ConfigurationError, UnreadableFileError, why_not
    from logs.files.log_error import LogError

    match problem:
        case UnreadableFileError():  # as any other input that is missing
            return problem.problems, exit_codes.UNHEALTHY
        case ConfigurationError():
            return problem.problems, exit_codes.CONFIGURATION
        case DaemonLostError():
            return [str(problem)], exit_codes.NO_DAEMON
        case AccessDeniedError():
            return [str(problem)], exit_codes.NOT_PERMITTED
        case BenchError():
            return [str(problem)], exit_codes.REFUSED
        case BusError() | LogError():
            return [str(problem)], exit_codes.UNHEALTHY
        case OSError():
            return [why_not(problem)], exit_codes.UNHEALTHY
    raise problem
