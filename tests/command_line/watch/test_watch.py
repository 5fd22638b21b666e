"""`mudskipper watch` as a process prints plain lines into a pipe, or a screen on a terminal, which it restores."""

import os
import pty
import select
import signal
import sys
import time
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import pytest

from command_line import exit_codes
from command_line.watch import plain_lines
from command_line.watch.feed import Feed
from control.modes import Mode
from tests.command_line.command_lines import start_process
from tests.command_line.watch.served_robot import ServedRobot
from tests.waiting import LONGEST_S

WATCH = [sys.executable, "-m", "command_line.main", "watch"]
SCREEN, CURSOR = (b"\x1b[?1049h", b"\x1b[?1049l"), (b"\x1b[?25l", b"\x1b[?25h")  # xterm: switched on, restored


def test_a_pipe_gets_plain_lines_also_over_a_restart(
    walked: ServedRobot, resting: ServedRobot, short_folder: Path
) -> None:
    path = short_folder / "s"
    lines: list[str] = []

    def read_until(text: str) -> None:
        assert watch.stdout is not None
        while text not in (line := watch.stdout.readline()):
            assert line, f"ended without {text!r}: {lines}"
            lines.append(line)
        lines.append(line)

    with walked.served(path):
        watch = start_process("watch", "--socket", str(path), "--period", "0.05")
        read_until("walking, stride")
    read_until("torque unknown")
    with resting.served(path):
        read_until("idle")
        watch.send_signal(signal.SIGINT)
        rest, complaints = watch.communicate(timeout=LONGEST_S)
    assert (watch.returncode, complaints) == (exit_codes.INTERRUPTED, "")
    assert "\033" not in "".join(lines) + rest


class Terminal:
    """A pseudo-terminal in which the program runs."""

    def __init__(self, path: Path, terminal_type: str) -> None:
        self.pid, self._descriptor = pty.fork()
        if self.pid == 0:
            environment = os.environ | {"TERM": terminal_type, "LINES": "24", "COLUMNS": "80"}
            os.execve(WATCH[0], [*WATCH, "--socket", str(path)], environment)
        self.output = b""

    def read_until(self, text: bytes) -> None:
        deadline_s = time.monotonic() + LONGEST_S
        while text not in self.output and time.monotonic() < deadline_s:
            self._read()
        assert text in self.output, self.output[-2000:]

    def _read(self) -> bool:
        try:
            readable, _, _ = select.select([self._descriptor], [], [], 0.1)
            data = os.read(self._descriptor, 65536) if readable else b"-"
        except OSError:  # the program has ended
            return False
        self.output += data if readable else b""
        return bool(data)

    def press(self, key: bytes) -> int:
        """Press the key that ends the program; returns its exit status."""
        os.write(self._descriptor, key)
        while self._read():
            pass
        os.close(self._descriptor)
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


@pytest.mark.parametrize(
    ("key", "status"), [(b"q", exit_codes.OK), (b"\xff\xfcq", exit_codes.OK), (b"\x03", exit_codes.INTERRUPTED)]
)
def test_a_terminal_is_left_as_it_was(walked: ServedRobot, short_folder: Path, key: bytes, status: int) -> None:
    with walked.served(short_folder / "s"):
        terminal = Terminal(short_folder / "s", "xterm-256color")
        terminal.read_until(b"WALKING")
        assert terminal.press(key) == status
        assert walked.mode is Mode.WALKING
    for taken, returned in (SCREEN, CURSOR):
        assert terminal.output.rindex(returned) > terminal.output.rindex(taken)


def test_a_terminal_that_can_do_nothing_gets_plain_lines(walked: ServedRobot, short_folder: Path) -> None:
    with walked.served(short_folder / "s"):
        terminal = Terminal(short_folder / "s", "dumb")
        terminal.read_until(b"walking, stride")
        terminal.press(b"\x03")
    assert b"\x1b" not in terminal.output


class EndError(Exception):
    """Ends the endless lines."""


def test_a_computer_that_is_slower_than_the_period_never_waits_for_a_negative_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock, waits_s = count(), list[float]()

    def sleep(wait_s: float) -> None:
        waits_s.append(wait_s)
        if len(waits_s) == 3:
            raise EndError

    slow = SimpleNamespace(monotonic=lambda: float(next(clock)), sleep=sleep, strftime=lambda pattern: "12:00:00")
    monkeypatch.setattr(plain_lines, "time", slow)
    with pytest.raises(EndError):
        plain_lines.print_lines(Feed(tmp_path / "s", 0.5), 0.5)
    assert waits_s == [0.0, 0.0, 0.0]
    assert capsys.readouterr().out.count("torque unknown") == 3
