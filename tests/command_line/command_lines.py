"""Runs command lines: in a process of their own, or in this one where they are refused."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence

import pytest

from command_line import exit_codes
from command_line.main import main
from tests.waiting import LONGEST_S


def run(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs a command in its own process with additional environment variables."""
    command = [sys.executable, "-m", "command_line.main", *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=LONGEST_S, env=os.environ | environment, check=False
    )


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Returns the message with which a command line is refused as wrong usage."""
    return _complaint(capsys, exit_codes.USAGE, arguments)


def failure(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Returns the message of a command that failed."""
    return _complaint(capsys, exit_codes.UNHEALTHY, arguments)


def _complaint(capsys: pytest.CaptureFixture[str], status: int, arguments: Sequence[str]) -> str:
    try:
        ended: object = main(arguments)
    except SystemExit as problem:  # as argparse does it
        ended = problem.code
    printed = capsys.readouterr()
    assert (ended, printed.out) == (status, "")
    assert "Traceback" not in printed.err
    return printed.err.splitlines()[-1]
