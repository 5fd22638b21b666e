"""Commands that cannot work are refused with an exit status and name what is wrong, without a robot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.experiments import studies
from command_line.main import main
from command_line.operation import operation
from command_line.robot_text import unheard_text
from command_line.screen import coefficient
from control.records import JOINTS
from experiments.reports.text_tables import number
from firmware_host import daemon
from operator_client.status_client import DroppedError
from tests.command_line.command_lines import failure


class Client:
    """Fails in every call with `problem`."""

    problem: Exception

    def __init__(self, path: Path) -> None:
        return

    def call(self, method: str, **params: Any) -> Any:
        raise self.problem

    def close(self) -> None:
        return


@pytest.mark.parametrize("command", ["status", "check", "clear"])
def test_a_closed_connection_is_not_reported_as_a_missing_daemon(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(operation, "StatusClient", Client)
    Client.problem = DroppedError("the daemon closed the connection")
    assert main([command]) == exit_codes.NO_DAEMON
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "mudskipper: the daemon closed the connection\n")


@pytest.mark.parametrize(
    "arguments",
    [
        ["check", "--socket", "/none", "--config"],
        ["doctor", "--socket", "/none", "--config"],
        ["log", "list", "--config"],
        ["log", "recover", "--config"],
        ["replay", "/none.mcap", "--config"],
        ["simulate", "--config"],
        ["simulate", "--world"],
        ["demo", "--world"],
        ["experiment", "actuator", "--simulated", "--config"],
        ["mudskipperd", "--config"],
    ],
    ids=" ".join,
)
def test_a_file_that_is_not_toml_is_refused_by_name_and_line(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.toml").write_text("[limits]\ntorque_nm 0.8\n", encoding="utf-8")
    command, *others = arguments
    program = daemon.main if command == "mudskipperd" else main
    status = program([*others, "robot.toml"] if command == "mudskipperd" else [*arguments, "robot.toml"])
    assert status == (exit_codes.UNHEALTHY if command in ("check", "doctor") else exit_codes.CONFIGURATION)
    printed = capsys.readouterr()
    reported = " ".join((printed.out + printed.err).split())
    assert "robot.toml: not a TOML file: " in reported and "line 2, column 11" in reported


def test_the_status_names_drives_that_were_not_heard_yet() -> None:
    heard: dict[str, Any] = {"angle_age_s": 0.0, "current_age_s": 0.0, "heartbeat_age_s": 0.1}
    drives = [heard | {"joint": joint} for joint in JOINTS]
    drives[1] = drives[1] | {"heartbeat_age_s": None}
    drives[3] = drives[3] | {"angle_age_s": None}
    line = unheard_text({"drives": drives})
    assert "left_adduction, right_adduction" in line and "left_sweep" not in line


@pytest.mark.parametrize(("value", "text"), [(-0.0001, "0.000"), (-0.0, "0.000"), (-0.001, "-0.001"), (None, "-")])
def test_a_zero_has_no_sign(value: float | None, text: str) -> None:
    assert number(value) == text


@pytest.mark.parametrize(
    ("valid", "at_least", "text"),
    [(True, False, "1.235 ± 0.046"), (True, True, "≥ 1.235 ± 0.046"), (False, True, "(≥ 1.235 ± 0.046)")],
)
def test_an_estimate_is_printed_with_its_standard_error_and_its_limits(valid: bool, at_least: bool, text: str) -> None:
    reported = {"value": 1.23456e6, "std_error": 4.56e4, "valid": valid, "at_least": at_least}
    assert coefficient(reported) == text
    assert coefficient(reported | {"value": None}) == "-"


def test_without_matplotlib_no_experiment_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(studies, "find_spec", lambda name: None)
    arguments = ("experiment", "trackway", "--simulated", "--out", str(tmp_path / "none"))
    assert "extra 'plots'" in failure(capsys, *arguments)
    assert not (tmp_path / "none").exists()
