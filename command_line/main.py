"""Parses the command line of `mudskipper` and runs the command, whose module is imported when it is used."""

import atexit
import gc
import os
import sys
from collections.abc import Sequence
from io import TextIOWrapper

from command_line import exit_codes
from command_line.errors import report
from command_line.function_options import given_options
from command_line.json_output import JSON, Answer, answers, print_error
from command_line.parser import build_parser
from command_line.screen import complaints, drop_output

atexit.register(gc.freeze)  # a process that ends looks for garbage twice, a tenth of the time of `status`


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; with --json, one that fails prints its reason as JSON where it has printed none yet."""
    given = sys.argv[1:] if arguments is None else arguments
    complaints.clear()
    answers.clear()
    _prepare_streams()
    try:
        status = _run(given)
    except SystemExit as ended:  # as argparse ends
        _answer(given, int(ended.code or 0))
        raise
    _answer(given, status)
    return status


def _prepare_streams() -> None:
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:  # it was closed: without a standard error, `print` would take standard output
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), "w"))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without ± or ³ shows a question mark


def _answer(given: Sequence[str], status: int) -> None:
    if JSON in given and status != exit_codes.OK and not answers:
        print_error(status, complaints)


def _run(given: Sequence[str]) -> int:
    try:
        options = build_parser(given).parse_args(given)
        target = options.target
        if hasattr(target, "run"):  # a study, which several functions run
            return int(target.run(options))
        ended: Answer | int = target(**given_options(options, target))
        return ended.print(getattr(options, "json", False)) if isinstance(ended, Answer) else ended
    except KeyboardInterrupt:
        return exit_codes.INTERRUPTED
    except BrokenPipeError:
        drop_output()
        return exit_codes.OK
    except Exception as problem:  # noqa: BLE001 - `report` raises again what it does not know
        return report(problem)


if __name__ == "__main__":
    sys.exit(main())
