"""The cells of the screen: the most important text comes first, and values that are not known look so."""

import copy
import re
from collections import deque
from typing import Any

import pytest

from command_line.operation.attended_walk import LiveLine
from command_line.operation.status import status_text
from command_line.robot_text import BAD, OLD
from command_line.watch.bars import bars
from command_line.watch.history import History, Sample
from command_line.watch.joint_plots import View
from command_line.watch.mud_cells import BOUND, coefficient_rows, force_text, strip_text, trend
from command_line.watch.plain_lines import plain_line
from command_line.watch.robot_cells import alarm_text, drive_rows, faults_text, machine_text
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


@pytest.mark.parametrize("ahead_m", [0.0, 0.01, 0.02, 0.03, 0.04, 0.05])
def test_the_mark_of_the_robot_leaves_the_numbers_of_the_path_whole(history: History, ahead_m: float) -> None:
    history.status["body_x_m"] = max(stride["place_m"] for stride in history.strides) + ahead_m
    scale = strip_text(history, 80, ("k_s",)).plain.splitlines()[-1]
    assert "▲" in scale and len(re.findall(r"\d\.\d\d m", scale)) == 2


def test_a_cut_of_the_power_takes_the_place_of_the_mode(history: History, capsys: pytest.CaptureFixture[str]) -> None:
    history.status |= {"mode": "fault", "power_cut": "all drives fell silent at once"}
    assert alarm_text(history, NOW_S).plain.startswith(" POWER CUT ")
    assert plain_line(history, NOW_S).startswith("power cut, ")
    assert status_text(history.status).startswith(f"{history.status['robot']}: power cut, ")
    LiveLine().show(history.status)  # of `joy` and an attended walk
    assert capsys.readouterr().out.startswith("power cut, ")


def test_status_says_which_law_the_ground_follows_and_by_how_much(history: History) -> None:
    history.status["mud"]["law"] = {"name": "undecided", "errors": {"mud": 0.364, "sand": 1.22}}
    shown = "ground undecided: each coefficient is predicted wrong from the others, as mud by 36 % and sand by 122 %"
    assert shown in status_text(history.status)
    history.status["mud"]["law"] = None  # nothing is known yet
    assert "\nground" not in status_text(history.status)


def test_a_silent_drive_has_unknown_torque(history: History) -> None:
    history.status["drives"] = [
        drive | {"angle_age_s": 1.6, "heartbeat_age_s": 1.6} for drive in history.status["drives"]
    ]
    for _, angle, *_, age, torque, _ in drive_rows(history, silence_s=0.0):
        assert (torque.plain, torque.style, age.plain, angle.style) == ("unknown", BAD, "1.6 s", OLD)


def test_torque_is_unknown_and_values_age_while_the_daemon_is_silent(history: History) -> None:
    assert alarm_text(history, NOW_S + 12.0).plain.startswith(" NO ANSWER ")
    assert {(row[5].plain, row[6].plain) for row in drive_rows(history, silence_s=12.0)} == {("12.0 s", "unknown")}


def test_every_fault_is_listed_with_its_advice(walked: ServedRobot, history: History) -> None:
    causes = dead_buses(walked)
    history.status |= {"mode": "fault", "causes": causes, "faults": walked.ask("status")["faults"]}
    listed = faults_text(history).plain
    for fault in history.status["faults"]:
        assert listed.count(fault["message"]) + sum(fault["name"] == cause["name"] for cause in causes)
        assert fault["what_to_do"] in listed


@pytest.mark.parametrize(
    ("values", "floor", "height", "lines"),
    [
        ((0.0, 0.02, None, 0.01), 2.0, 1, ["▁▁ ▁"]),
        ((0.0, 1.0, 2.0), 0.5, 1, ["▁▅█"]),
        ((0.0, 1.0), 0.5, 2, [" █", "▁█"]),
        ((), 1.0, 2, ["", ""]),
    ],
)
def test_bars_fill_the_height_only_beyond_the_floor(
    values: tuple[float | None, ...], floor: float, height: int, lines: list[str]
) -> None:
    assert bars(values, floor, height) == lines


def test_plots_of_joints_scroll_back_and_follow_again(walked_history: History) -> None:
    history = copy.copy(walked_history)
    signals: dict[str, Any] = {"angle_rad": (0.5,) * 4, "current_a": (None,) * 4, "torque_command_nm": (0.0,) * 4}
    signals |= dict.fromkeys(("force_x_n", "force_z_n"), (0.0,) * 2)
    history.samples = deque(Sample(time_s=each / 10, body_x_m=None, **signals) for each in range(1000))
    view = View(period_s=0.1)
    assert view.text(history, 80, 20).plain.count("▁") == 4 * 56
    view.scroll(-0.5, history, 80)
    assert view.end_s == pytest.approx(94.3)
    view.zoom(2.0)
    assert "▁" * 56 in view.text(history, 80, 20).plain
    view.signal = 1  # the current is unknown
    assert "▁" not in view.text(history, 80, 20).plain
    view.scroll(1e9, history, 80)
    assert view.end_s is None
    view.signal = 0
    view.scroll(-1e9, history, 80)  # to the first sample, at the left end
    assert view.text(history, 80, 20).plain.count("▁") == 4 * 56


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
    assert trend([{"valid": True, "value": value, "repeatability": 0.1} for value in values]) == arrow


def test_a_daemon_that_restarts_with_another_number_of_flippers_has_its_own_samples(history: History) -> None:
    both = copy.deepcopy(history.status)
    left = both | {"drives": both["drives"][:2], "loads": {"left": both["loads"]["left"]}}
    for report in (left, both, left):
        history.add_status(report, NOW_S)
        force_text(history, 80)
        assert ("right_sweep" in View(period_s=0.1).text(history, 80, 24).plain) == (report is both)
