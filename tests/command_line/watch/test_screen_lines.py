"""The lines of the screen fit every terminal, and the most important ones come first."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from command_line.watch.history import History
from command_line.watch.lines import Line, length, plain_text
from command_line.watch.screen_lines import Footer, screen_lines
from control.faults import FaultKind
from control.records import JOINTS
from simulation.harness.lockstep import Lockstep
from tests.command_line.watch.served_robot import ServedRobot

NOW_S = 50.0


@pytest.fixture(scope="session")
def history(walking: Lockstep) -> History:
    walked, history = ServedRobot(walking), History()
    while strides := walked.ask("strides", since=history.next_stride):
        history.add_strides(strides)
    for _ in range(80):
        history.add_status(walked.ask("status"), NOW_S)
    return history


def lines_of(
    history: History, width: int = 80, height: int = 24, help_shown: bool = False, now_s: float = NOW_S
) -> list[Line]:
    return screen_lines(history, now_s, width, height, Footer(), help_shown)


def changed(history: History, **values: Any) -> History:
    """Return the same history with other values in its status."""
    other = copy.deepcopy(history)
    other.status.update(values)
    return other


@pytest.mark.parametrize("help_shown", [False, True])
@pytest.mark.parametrize(
    ("width", "height"), [(80, 24), (81, 25), (120, 31), (120, 40), (200, 60), (40, 10), (10, 3), (1, 1)]
)
def test_it_fills_every_terminal_exactly(history: History, width: int, height: int, help_shown: bool) -> None:
    lines = lines_of(history, width, height, help_shown)
    assert [length(line) for line in lines] == [width] * height


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 40)])
def test_nothing_but_sentences_is_cut_at_home(history: History, width: int, height: int) -> None:
    assert "…" not in plain_text(lines_of(history, width, height))


def test_at_home_it_shows_every_part(history: History) -> None:
    text = plain_text(lines_of(history))
    parts = (
        "WALKING",
        "cm now",
        "cm next: ",
        "slip",
        "speed",
        "left (N/cm³)",
        "right (N/cm³)",
        "forward",
        "up",
        "mud k_s",
        "▲",
    )
    for part in (*parts, *JOINTS, " / ", "torque", "Hz", "log", "lease", "? help"):
        assert part in text, part


def test_a_larger_terminal_shows_more_strides(history: History) -> None:
    counts = [plain_text(lines_of(history, 120, height)).count(" right ") for height in (24, 40, 60)]
    assert counts == sorted(counts) and counts[0] < counts[1] < counts[2]


def dead_buses(walked: ServedRobot) -> list[dict[str, Any]]:
    """Return the causes that the daemon reports some time after both buses went off."""
    loop = walked.robot.loop
    faults = [
        kind.fault(joint, age_s=1.6)
        for joint in JOINTS
        for kind in (FaultKind.DRIVE_SILENT, FaultKind.HEARTBEAT_SILENT)
    ]
    loop.faults.update([*faults, *(FaultKind.BUS_OFF.fault(name) for name in ("left", "right"))], True)
    causes: list[dict[str, Any]] = walked.ask("status")["causes"]
    return causes


def test_the_alarm_is_one_cause_in_the_first_lines(walked: ServedRobot, history: History) -> None:
    lines = lines_of(changed(history, mode="fault", causes=dead_buses(walked)))
    first = plain_text(lines[:3])
    assert first.startswith(" FAULT  ")
    for text in ("left bus is off", "right", "no frame for 1.6 s", "8 faults", "check wiring"):
        assert text in " ".join(first.split()), text


def test_a_silent_drive_has_unknown_torque(history: History) -> None:
    drives = [drive | {"angle_age_s": 1.6, "heartbeat_age_s": 1.6} for drive in history.status["drives"]]
    lines = lines_of(changed(history, drives=drives))
    rows = [line for line in lines if plain_text([line]).startswith(JOINTS)]
    assert len(rows) == 4
    for row in rows:
        assert ("unknown", "bad") in row and "1.6 s" in plain_text([row])
        assert any(style == "old" for _, style in row)


def test_everything_looks_old_when_the_daemon_is_silent(history: History) -> None:
    header, *body = lines_of(history, now_s=NOW_S + 12.0)
    assert plain_text([header]).startswith(" NO ANSWER  ") and "12 s" in plain_text([header])
    styles = {style for line in body[2:-1] for text, style in line if text.strip()}
    assert styles == {"old"}
    assert plain_text(body).count("unknown") == 1 + len(JOINTS)


def test_a_lost_lease_and_its_rest_are_shown(history: History) -> None:
    text = plain_text(lines_of(changed(history, lease="uid 1000 (process 7)", lease_left_s=0.73)))
    assert "uid 1000 (process 7), 0.7 s" in text


def test_a_lower_bound_is_marked(history: History) -> None:
    mud = copy.deepcopy(history.status["mud"])
    mud["left"]["k_s"] |= {"at_least": True}
    mud["right"]["k_s"] = None
    row = next(line for line in lines_of(changed(history, mud=mud)) if plain_text([line]).startswith("k_s"))
    left, right = plain_text([row])[:39], plain_text([row])[39:]
    assert "≥" in left and "±" in left and "±" not in right


def test_a_robot_without_a_position_and_without_strides_is_shown() -> None:
    empty = History(problem="nothing")
    assert "nothing" in plain_text(lines_of(empty))
