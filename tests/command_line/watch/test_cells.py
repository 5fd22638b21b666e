"""The cells of the screen: the most important text comes first, and values that are not known look so."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from command_line.watch.history import History
from command_line.watch.machine_cells import BAD, OLD, alarm_text, drive_rows, machine_text
from command_line.watch.mud_cells import BOUND, coefficient_rows, trend
from control.faults import FaultKind
from control.records import FLIPPERS, JOINTS
from simulation.harness.lockstep import Lockstep
from tests.command_line.watch.served_robot import ServedRobot

NOW_S = 50.0


@pytest.fixture(scope="session")
def walked_history(walking: Lockstep) -> History:
    walked, history = ServedRobot(walking), History()
    while strides := walked.ask("strides", since=history.next_stride):
        history.add_strides(strides)
    history.add_status(walked.ask("status"), NOW_S)
    return history


@pytest.fixture
def history(walked_history: History) -> History:
    return copy.deepcopy(walked_history)


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


def test_faults_of_one_cause_are_one_alarm(walked: ServedRobot, history: History) -> None:
    history.status |= {"mode": "fault", "causes": dead_buses(walked)}
    first, advice = alarm_text(history, NOW_S).plain.split("\n")
    assert first.startswith(" FAULT ") and "8 faults" in first
    assert advice.startswith("-> ")


def test_a_silent_drive_has_unknown_torque(history: History) -> None:
    history.status["drives"] = [
        drive | {"angle_age_s": 1.6, "heartbeat_age_s": 1.6} for drive in history.status["drives"]
    ]
    for _, angle, *_, age, torque, _ in drive_rows(history, heard=True):
        assert (torque.plain, torque.style, age.plain, angle.style) == ("unknown", BAD, "1.6 s", OLD)


def test_torque_is_unknown_while_the_daemon_is_silent(history: History) -> None:
    assert alarm_text(history, NOW_S + 12.0).plain.startswith(" NO ANSWER ")
    assert {row[5].plain for row in drive_rows(history, heard=False)} == {"unknown"}


@pytest.mark.parametrize("roomy", [False, True])
def test_the_holder_of_the_lease_is_shown(history: History, roomy: bool) -> None:
    history.status |= {"lease": "uid 1000 (process 7)", "lease_left_s": 0.73}
    assert "uid 1000 (process 7), 0.7 s" in machine_text(history, roomy).plain


def test_a_lower_bound_is_marked_and_an_unknown_value_is_a_dash(history: History) -> None:
    history.status["mud"]["left"]["k_s"] |= {"at_least": True}
    history.status["mud"]["right"]["k_s"] = None
    _, left, _, _, right, *_ = coefficient_rows(history, FLIPPERS)[1]
    assert left.plain.startswith("≥") and left.style == BOUND
    assert right.plain == "-"


@pytest.mark.parametrize(("values", "arrow"), [((1.0,), " "), ((1.0, 1.3), "→"), ((1.0, 1.5), "↗"), ((1.5, 1.0), "↘")])
def test_the_arrow_shows_a_change_beyond_the_errors(values: tuple[float, ...], arrow: str) -> None:
    assert trend([{"valid": True, "value": value, "std_error": 0.1} for value in values]) == arrow
