"""What commands make of a daemon's answers: a stop succeeds only if every drive has confirmed it."""

from json import loads
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.operation import confirmation, operation
from command_line.operation.confirmation import TORQUE_UNKNOWN, send_order, unconfirmed_drives
from control.modes import PREVENTED
from control.records import JOINTS
from operator_client.status_client import CallRefusedError, DroppedError, NotPermittedError
from simulation.harness.local_setup import named_folder
from tests.command_line.command_lines import failure, json_of, output, run
from tests.command_line.fake_client import answer_with, next_of

REFUSAL = "status is for members of the group mudskipper. Have root run 'adduser YOU mudskipper', then log in again"
Report = dict[str, Any]
each_ending = pytest.mark.parametrize("command", ["stop", "disarm"])


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


class Clock:
    """A clock on which only waiting takes time."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s


@pytest.fixture(autouse=True)
def clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(confirmation, "time", Clock())


@pytest.mark.parametrize("adaptive", [False, True])
def test_an_adaptive_walk_leaves_out_the_depths_of_its_gait(adaptive: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    ordered: list[Report] = []
    monkeypatch.setattr(operation, "_change_mode", lambda *order: ordered.append(loads(order[-1]["gait"])))
    operation.walk(socket=Path(), gait="three_depths", adaptive=adaptive)
    assert ("depths_m" in ordered[0]) is not adaptive


@pytest.mark.parametrize("waits", [False, True])
def test_an_arm_that_a_fault_of_the_next_tick_prevents_is_refused_or_repeated(
    waits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    prevented = report("idle", False) | {"notice": f"arm {PREVENTED}left_sweep moves"}
    answer_with(monkeypatch, next_of(prevented, report("hold", True)))
    if waits:
        assert output("arm", "--wait").startswith("hold")
    else:
        assert "left_sweep moves" in failure("arm", status=exit_codes.REFUSED)


@each_ending
@pytest.mark.parametrize("mode", ["idle", "fault"])
def test_confirmed_idle_drives_are_a_success(command: str, mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    unconfirmed = report("walking", True, -1.0), report(mode, True, -1.0)
    answer_with(monkeypatch, next_of(*unconfirmed, report(mode, False, -1.0)))
    ended = run(command)
    assert (ended.returncode, ended.stdout, ended.stderr) == (exit_codes.OK, f"{mode}\n", "")


def test_a_held_pose_is_the_success_of_a_stop_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    answer_with(monkeypatch, next_of(report("hold", True, -1.0)))
    assert json_of("stop") == {"schema": "operation/1", "command": "stop", "mode": "hold", "notice": ""}
    ended = run("disarm")
    assert ended.returncode == exit_codes.TIMED_OUT and TORQUE_UNKNOWN in ended.stderr


def test_programs_read_that_a_stop_is_not_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    answer_with(monkeypatch, next_of(report("hold", True, -1.0, {"heartbeat_age_s": 3.0})))
    assert loads(run("stop", "--json").stdout)["status"] == exit_codes.TORQUE_UNKNOWN


@each_ending
def test_a_drive_that_does_not_confirm_is_named_and_the_power_is_to_be_cut(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer_with(monkeypatch, next_of(report("fault", False, -1.0, {"closed_loop": True})))
    ended = run(command)
    assert (ended.returncode, ended.stdout) == (exit_codes.TORQUE_UNKNOWN, "fault\n")
    assert "left_adduction" in ended.stderr and "right" not in ended.stderr and TORQUE_UNKNOWN in ended.stderr
    answer = send_order(Path("/none"), command)  # of the screen and the page
    assert answer.startswith(TORQUE_UNKNOWN) and "left_adduction" in answer


@each_ending
def test_a_stop_that_is_interrupted_is_not_confirmed(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    answer_with(monkeypatch, next_of(KeyboardInterrupt()))
    assert TORQUE_UNKNOWN in failure(command, status=exit_codes.INTERRUPTED)


# a user who may stop the robot, and nothing else


def for_stops_alone(method: str) -> Any:
    return "accepted" if method in ("stop", "disarm") else NotPermittedError(REFUSAL)


@each_ending
def test_a_stop_is_accepted_but_not_confirmed_where_the_status_is_not_permitted(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer_with(monkeypatch, for_stops_alone)
    ended = run(command)
    assert ended.returncode == exit_codes.TORQUE_UNKNOWN
    assert all(text in ended.stderr for text in ("accepted", "group mudskipper ", TORQUE_UNKNOWN))


@pytest.mark.parametrize("command", ["status", "arm", "walk", "walk --attended", "clear", "check"])
def test_anything_else_is_not_permitted(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    answer_with(monkeypatch, for_stops_alone)
    assert failure(*command.split(), status=exit_codes.NOT_PERMITTED) == f"mudskipper: {REFUSAL}"


@pytest.mark.parametrize("command", ["status", "check", "clear"])
def test_a_closed_connection_is_not_reported_as_a_missing_daemon(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    answer_with(monkeypatch, lambda method: DroppedError("the daemon closed the connection"))
    assert failure(command, status=exit_codes.NO_DAEMON) == "mudskipper: the daemon closed the connection"


# clear

BACK = "moves it back, then 'mudskipper clear'"


def cause(name: str, what_to_do: str) -> Report:
    return {"name": name, "message": f"It is {name}.", "what_to_do": what_to_do, "reaction": "damping"}


@pytest.mark.parametrize(
    ("name", "bus", "advice"),
    [
        ("power_cut", "robot", "Release the switch."),
        ("joint_position", "", "Move it back."),  # of no simulated robot
        ("joint_position", "robot", f"'mudskipper simulate --reset' {BACK}."),
        ("joint_position", "other", f"'mudskipper simulate --reset --bus other' {BACK}."),
    ],
)
def test_a_refused_clear_names_the_cause_and_what_ends_it(
    name: str, bus: str, advice: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(operation, "CLEARING_S", 0.0)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    socket = named_folder(bus) / "mudskipper.sock" if bus else tmp_path / "robot" / "mudskipper.sock"
    todo = {"power_cut": "release the switch", "joint_position": "move it back"}[name]
    answer_with(monkeypatch, next_of(report("fault", False) | {"causes": [cause(name, todo)]}))
    refused = failure("clear", "--socket", str(socket), status=exit_codes.REFUSED)
    assert refused == f"mudskipper: the cause is still there: It is {name}. {advice}"


# arm --wait


@pytest.mark.parametrize(
    ("mode", "option", "status"),
    [("idle", "--wait", exit_codes.OK), ("fault", "--wait", exit_codes.REFUSED), ("idle", "", exit_codes.REFUSED)],
)
def test_only_what_ends_by_itself_is_waited_for(
    mode: str, option: str, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = [CallRefusedError("The left_sweep joint moves while torque is off.")] * 3 + ["armed"]
    answer_with(
        monkeypatch,
        lambda method: answers.pop(0) if method == "arm" else {"mode": mode if answers else "hold", "notice": ""},
    )
    ended = run("arm", *filter(None, [option]))
    assert ended.returncode == status and ended.stderr.count("left_sweep joint moves") == 1


def test_a_wrong_value_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    refusals = iter([CallRefusedError("force = 'TYPO': must be one of joint_position")])
    answer_with(monkeypatch, lambda method: next(refusals) if method == "arm" else {"mode": "idle", "notice": ""})
    refused = failure("arm", "--wait", "--force", "TYPO", status=exit_codes.REFUSED)
    assert refused.startswith("mudskipper: force = 'TYPO'")
