"""With --json, every command that fails prints its reason as a JSON object with the same keys."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.parser import build_parser
from tests.command_line.command_lines import run
from tests.waiting import LONGEST_S


@pytest.mark.parametrize(
    ("arguments", "status", "text"),
    [
        ("status --socket /none", exit_codes.NO_DAEMON, "no daemon answers on /none"),
        ("fail --list all", exit_codes.USAGE, "--list takes neither"),
        ("log info /none.mcap", exit_codes.UNHEALTHY, "/none.mcap: No such file"),
        ("status --bogus", exit_codes.USAGE, "unrecognized arguments: --bogus"),  # as argparse ends
        ("experiment sweep", exit_codes.USAGE, "--simulated"),  # of a study
    ],
)
def test_a_failure_is_one_object_with_the_messages_of_standard_error(arguments: str, status: int, text: str) -> None:
    ended = run(*arguments.split(), "--json")
    error = json.loads(ended.stdout)
    assert ended.returncode == status
    assert error.keys() == {"schema", "status", "meaning", "messages"}
    assert (error["schema"], error["status"], error["meaning"]) == ("error/1", status, exit_codes.MEANINGS[status])
    assert text in error["messages"][0]
    assert all(message in ended.stderr for message in error["messages"])


def test_a_command_that_has_answered_adds_no_error(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text("[loop]\ncpu = 'x'\n", encoding="utf-8")
    ended = run("doctor", "--config", str(tmp_path / "bad.toml"), "--json")
    assert ended.returncode == exit_codes.UNHEALTHY
    assert isinstance(json.loads(ended.stdout), list)


@pytest.mark.parametrize(
    ("words", "closed", "status"),
    [
        ("status --socket /none --json", "2>&-", exit_codes.NO_DAEMON),  # its message would stand before the JSON
        ("log list . --json", "2>&-", exit_codes.OK),
        ("check --socket /none --config /none.toml", ">&-", exit_codes.UNHEALTHY),
    ],
)
def test_a_closed_stream_changes_neither_the_exit_status_nor_the_other_stream(
    words: str, closed: str, status: int, tmp_path: Path
) -> None:
    command = ["sh", "-c", f'exec "$0" -m command_line.main {words} {closed}', sys.executable]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, cwd=tmp_path, check=False)
    assert (ended.returncode, ended.stderr) == (status, "")
    assert closed == ">&-" or json.loads(ended.stdout)


def test_an_earlier_command_leaves_no_state() -> None:
    run("log", "info", "/none.mcap", "--json")
    assert len(json.loads(run("log", "info", "/other.mcap", "--json").stdout)["messages"]) == 1


def test_a_command_line_that_names_a_command_is_parsed_as_by_the_complete_parser() -> None:
    all_commands = build_parser()
    for arguments in (["walk", "--depth", "3"], ["log", "list", "."], ["experiment", "walk", "--mud", "47"]):
        assert build_parser(arguments).parse_args(arguments) == all_commands.parse_args(arguments)


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("words", ["stop --socket /none", "status --socket /none --json"])
def test_a_reader_that_has_closed_the_output_changes_no_exit_status(words: str, unbuffered: str) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer) as output:
        ended = subprocess.run(
            [sys.executable, "-m", "command_line.main", *words.split()],
            stdout=output, stderr=subprocess.PIPE, text=True, timeout=LONGEST_S, check=False,
            env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
        )  # fmt: skip
    assert ended.returncode == exit_codes.NO_DAEMON and "BrokenPipe" not in ended.stderr
