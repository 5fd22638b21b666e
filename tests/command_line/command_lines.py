"""Runs command lines in this process or in a separate one."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from typing import Any

import pytest

from command_line import exit_codes
from command_line.main import main
from firmware_host import daemon
from tests.waiting import LONGEST_S


def run(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command with additional environment variables, in this process: it has imported all libraries already."""
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
        for name, value in environment.items():
            patch.setenv(name, value)
        status = _status(arguments)
    return subprocess.CompletedProcess(arguments, status, out.getvalue(), err.getvalue())


def start_process(*arguments: str, **environment: str) -> subprocess.Popen[str]:
    """Start a command in a process of its own, with pipes for what it prints."""
    command = [sys.executable, "-u", "-m", "command_line.main", *arguments]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=os.environ | environment)


def run_process(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own to its end."""
    with start_process(*arguments, **environment) as process:
        printed, complaints = process.communicate(timeout=LONGEST_S)
    return subprocess.CompletedProcess(arguments, process.returncode, printed, complaints)


def output(*arguments: str) -> str:
    """Return what a command prints that succeeds."""
    ended = run(*arguments)
    assert ended.returncode == exit_codes.OK, ended.stderr
    return ended.stdout


def json_of(*arguments: str) -> Any:
    """Return what a command that succeeds prints for programs."""
    return json.loads(output(*arguments, "--json"), parse_constant=pytest.fail)  # NaN is not valid JSON


def refusal(*arguments: str) -> str:
    """Return the message with which a command line is refused as wrong usage."""
    return failure(*arguments, status=exit_codes.USAGE)


def failure(*arguments: str, status: int = exit_codes.UNHEALTHY) -> str:
    """Return the message of a command that failed."""
    ended = run(*arguments)
    assert (ended.returncode, ended.stdout) == (status, "")
    assert "Traceback" not in ended.stderr
    return ended.stderr.splitlines()[-1]


def _status(arguments: Sequence[str]) -> int:
    """Return the exit status of `mudskipper`, or of `mudskipperd` where that is the first argument."""
    try:
        return daemon.main(arguments[1:]) if arguments[:1] == ("mudskipperd",) else main(arguments)
    except SystemExit as ended:  # as argparse does it
        return int(ended.code or 0)
