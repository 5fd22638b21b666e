"""Prints what a command reports as JSON for programs. An object names its shape and version under `schema`.

A version only grows by keys. A key that changes its meaning or goes away makes a new version. Lists stay lists. A
command that fails before it has printed JSON prints an `error`.
docs/reference/json.md describes each shape.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from command_line import exit_codes
from command_line.screen import drop_output

JSON = "--json"
answers: list[None] = []  # one for each JSON that this command has printed

SCHEMAS = {  # what prints it -> version
    "status": 2,
    "error": 1,
    "operation": 1,
    "failures": 1,
    "demo": 1,
    "drives-find": 1,
    "probe": 1,
    "trial": 1,
    "note": 1,
    "replay": 1,
    "log-annotate": 1,
    "log-comparison": 1,
    "log-info": 2,
    "log-index": 1,
    "log-list": 1,
    "log-pull": 1,
    "log-query": 1,
    "log-recover": 1,
    "log-report": 1,
}


class Answer(NamedTuple):
    """What a command has found, for programs and for people. A command that returns one has the option --json."""

    report: Any  # None: `main` prints the error of the command
    text: str
    status: int = exit_codes.OK
    schema: str = ""  # a key of SCHEMAS, unless the report is a list or has its schema already

    def print(self, as_json: bool) -> int:
        """Print it, and return the exit status, which a reader that has closed the output does not change."""
        try:
            if not as_json:
                print(*filter(None, [self.text]), flush=True)
            elif self.report is not None:
                print_value(
                    {"schema": f"{self.schema}/{SCHEMAS[self.schema]}"} | self.report if self.schema else self.report
                )
        except BrokenPipeError:
            drop_output()
        return self.status


def print_value(value: Any) -> None:
    """Print one line of JSON. Raises ValueError for a number that JSON does not have."""
    import json  # every command imports this module, and few print JSON

    answers.append(None)
    print(json.dumps(value, allow_nan=False), flush=True)


def print_error(status: int, messages: Sequence[str]) -> None:
    """Print why a command failed, in the one shape of all commands."""
    error = {"status": status, "meaning": exit_codes.MEANINGS[status], "messages": list(messages)}
    Answer(error, "", schema="error").print(as_json=True)
