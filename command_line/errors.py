"""The errors that end a command: their messages, and the exit status of each."""

from collections.abc import Sequence

from command_line import exit_codes
from command_line.screen import complain
from operator_client.status_client import CallRefusedError, DroppedError, NoDaemonError, NotPermittedError

NO_DAEMON = (
    "{}. Start it with 'systemctl start mudskipper', or name its socket with --socket. "
    "Without a robot, 'mudskipper simulate' makes one."
)
EXTRA_OF = {  # by module
    "matplotlib": "plots", "PIL": "plots", "pyarrow": "data", "duckdb": "data", "pandas": "data",
    "distributed": "cluster",
}  # fmt: skip


class CommandError(Exception):
    """A command cannot go on. Its messages are printed, and the status ends the program."""

    def __init__(self, *messages: str, status: int = exit_codes.UNHEALTHY) -> None:
        super().__init__("\n".join(messages))
        self.messages = messages
        self.status = status


def usage_error(message: str) -> CommandError:
    """Return the error of options that cannot be used together or here."""
    return CommandError(message, status=exit_codes.USAGE)


def report(problem: Exception) -> int:
    """Print why a command ended and return its exit status. Raise an error that is not expected again."""
    messages, status = _explain(problem)
    complain(*messages)
    return status


def _explain(problem: Exception) -> tuple[Sequence[str], int]:
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
        case ModuleNotFoundError(name=str(name)) if extra := EXTRA_OF.get(name.partition(".")[0]):
            needed = f"{name.partition('.')[0]} is not installed, which this needs"
            return [f"{needed}: install mudskipper with its extra '{extra}'"], exit_codes.UNHEALTHY
    return _explain_files_and_buses(problem)


def _explain_files_and_buses(problem: Exception) -> tuple[Sequence[str], int]:
    from firmware_host.buses import BusError  # imports too much for `status`
    from firmware_host.configuration.file_problems import ConfigurationError, why_not
    from logs.files.log_error import LogError

    match problem:
        case ConfigurationError():
            return problem.problems, exit_codes.CONFIGURATION
        case BusError() | LogError():
            return [str(problem)], exit_codes.UNHEALTHY
        case OSError():
            return [why_not(problem)], exit_codes.UNHEALTHY
    raise problem
