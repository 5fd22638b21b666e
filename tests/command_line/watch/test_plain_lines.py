"""Plain lines are printed at their period, or without a pause if a line takes longer than the period."""

from itertools import count
from pathlib import Path
from types import SimpleNamespace

import pytest

from command_line.watch import plain_lines
from command_line.watch.feed import Feed


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
