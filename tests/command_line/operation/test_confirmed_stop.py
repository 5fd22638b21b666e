"""`stop` and `disarm` succeed only if every drive has confirmed; otherwise the operator has to cut the power."""

from __future__ import annotations

from http import HTTPStatus
from json import loads
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.live.page_server import stop_robot
from command_line.operation import confirmation, operation
from command_line.operation.confirmation import TORQUE_UNKNOWN, unconfirmed_drives
from command_line.operation.confirmed_stop import disarm, stop
from command_line.watch.orders import send_order
from control.records import JOINTS
from operator_client.status_client import NotPermittedError

SOCKET = Path("/none")
Report = dict[str, Any]


def ended(command: str, json: bool = False) -> int:
    return (stop if command == "stop" else disarm)(socket=SOCKET, json=json)


def report(mode: str, closed_loop: bool, age_s: float | None = 0.0, changed: Report | None = None) -> Report:
    """Return a status with equal drives; `changed` alters the left adduction drive."""
    drives = [{"joint": joint, "closed_loop": closed_loop, "heartbeat_age_s": age_s} for joint in JOINTS]
    drives[1] |= changed or {}
    return {"mode": mode, "notice": "", "drives": drives}


@pytest.mark.parametrize(
    ("found", "unconfirmed"),
    [
        (report("idle", closed_loop=False), 0),
        (report("hold", closed_loop=True), 0),
        (report("fault", closed_loop=False), 0),
        (report("fault", closed_loop=True), 4),
        (report("idle", closed_loop=False, age_s=0.4), 4),  # the heartbeats are older than the request
        (report("hold", closed_loop=True, changed={"heartbeat_age_s": 0.4}), 1),
        (report("boot", closed_loop=False, age_s=None), 4),
        (report("idle", closed_loop=False, changed={"heartbeat_age_s": None}), 1),
    ],
)
def test_a_drive_confirms_by_a_heartbeat_after_the_request(found: Report, unconfirmed: int) -> None:
    assert len(unconfirmed_drives(found, since_request_s=0.3)) == unconfirmed


class Robot:
    """A client that answers with these reports in order and repeats the last one."""

    reports: list[Report] = []

    def __init__(self, path: Path, timeout_s: float = 0.0) -> None:
        return

    def call(self, method: str, **params: Any) -> Any:
        if method != "status":
            return "accepted"
        return self.reports.pop(0) if len(self.reports) > 1 else self.reports[0]

    def close(self) -> None:
        return


class Clock:
    """A clock on which only waiting takes time."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s


@pytest.fixture(autouse=True)
def robot(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (operation, confirmation):
        monkeypatch.setattr(module, "StatusClient", Robot)
    monkeypatch.setattr(confirmation, "time", Clock())


@pytest.mark.parametrize("command", ["stop", "disarm"])
@pytest.mark.parametrize("mode", ["idle", "fault"])
def test_confirmed_idle_drives_are_a_success(command: str, mode: str, capsys: pytest.CaptureFixture[str]) -> None:
    Robot.reports = [report("walking", True, -1.0), report(mode, True, -1.0), report(mode, False, -1.0)]
    assert ended(command) == exit_codes.OK
    assert capsys.readouterr() == (f"{mode}\n", "")


def test_programs_read_the_mode_of_a_confirmed_stop_and_nothing_else_of_another(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """`main` adds the error object where a command has printed no JSON."""
    Robot.reports = [report("hold", True, -1.0)]
    assert ended("stop", json=True) == exit_codes.OK
    confirmed = {"schema": "operation/1", "command": "stop", "mode": "hold", "notice": ""}
    assert loads(capsys.readouterr().out) == confirmed
    Robot.reports = [report("hold", True, -1.0, {"heartbeat_age_s": 3.0})]
    assert ended("stop", json=True) == exit_codes.TORQUE_UNKNOWN
    assert capsys.readouterr().out == ""


def test_a_held_pose_is_the_success_of_a_stop_alone(capsys: pytest.CaptureFixture[str]) -> None:
    Robot.reports = [report("hold", True, -1.0)]
    assert ended("stop") == exit_codes.OK
    assert ended("disarm") == exit_codes.TIMED_OUT
    assert TORQUE_UNKNOWN in capsys.readouterr().err


@pytest.mark.parametrize("command", ["stop", "disarm"])
@pytest.mark.parametrize("changed", [{"closed_loop": True}, {"heartbeat_age_s": None}, {"heartbeat_age_s": 3.0}])
def test_a_drive_that_does_not_confirm_is_named_and_the_power_is_to_be_cut(
    command: str, changed: Report, capsys: pytest.CaptureFixture[str]
) -> None:
    Robot.reports = [report("fault", False, -1.0, changed)]
    assert ended(command) == exit_codes.TORQUE_UNKNOWN
    printed = capsys.readouterr()
    assert printed.out == "fault\n"
    assert "left_adduction" in printed.err and "right" not in printed.err and TORQUE_UNKNOWN in printed.err


def test_the_page_and_the_screen_wait_for_every_drive_as_well() -> None:
    Robot.reports = [report("walking", True, -1.0), report("hold", True, -1.0)]
    assert stop_robot(SOCKET) == (HTTPStatus.OK, b"stop: every drive has confirmed it")
    Robot.reports = [report("hold", True, -1.0, {"heartbeat_age_s": 3.0})]
    status, text = stop_robot(SOCKET)
    assert status == HTTPStatus.CONFLICT
    assert (
        text.decode()
        == send_order(SOCKET, "stop")
        == f"{TORQUE_UNKNOWN}. stop is not confirmed by " + ("left_adduction")
    )


def test_a_user_who_may_not_see_the_status_reads_that_the_stop_was_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    class Blind(Robot):
        def call(self, method: str, **params: Any) -> Any:
            if method == "status":
                raise NotPermittedError("status is for members of the group mud. Have root add you")
            return "accepted"

    monkeypatch.setattr(confirmation, "StatusClient", Blind)
    text = send_order(SOCKET, "stop")
    assert "accepted" in text and "group mud " in text and "refused" not in text and TORQUE_UNKNOWN in text
