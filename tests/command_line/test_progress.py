"""Progress shows how much is done, and how long the rest will take at the pace so far."""

from __future__ import annotations

import sys

import pytest

from command_line.screen import PACE_S, Count, Progress, time_left_text


@pytest.mark.parametrize(
    ("elapsed_s", "done", "text"),
    [
        (0.5 * PACE_S, 5, ""),  # no pace yet
        (10.0, 0, ""),
        (10.0, 25, ", 30 s left"),
        (100.0, 25, ", 5 min left"),
        (10.0, 100, ""),
    ],
)
def test_the_time_left_follows_from_the_pace(elapsed_s: float, done: int, text: str) -> None:
    assert time_left_text(Count(7.0, 0), Count(7.0 + elapsed_s, done), 100) == text


def test_each_part_of_the_work_has_a_pace_of_its_own(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now_s = [0.0]
    monkeypatch.setattr("command_line.screen.time.monotonic", lambda: now_s[0])
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    progress = Progress("")
    for now_s[0], what, done in ((0.0, "rows read", 0), (100.0, "rows read", 90), (100.0, "rows written", 0)):
        progress.follow(what, done, 100)
    now_s[0] = 110.0
    progress.follow("rows written", 50, 100)
    shown = capsys.readouterr().err.split("\r")
    assert "90 of 100 rows read, 11 s left" in shown[2]
    assert "50 of 100 rows written, 10 s left" in shown[4]
