"""Commands that cannot work are refused with an exit status and name what is wrong, without a robot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.experiments import conduct as bench
from command_line.experiments import studies
from command_line.main import main
from command_line.operation import operation
from command_line.screen import coefficient
from control.records import JOINTS
from experiments.reports.text_tables import number
from firmware_host import daemon
from operator_client.status_client import DroppedError
from tests.command_line.command_lines import failure, refusal


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
    assert (
        "robot.toml: not a TOML file: Expected '=' after a key in a key/value pair (at line 2, column 11)" in reported
    )
    assert "fix it there: " in reported


@pytest.mark.parametrize("command", ["list", "index", "recover"])
def test_without_a_configuration_a_folder_of_logs_has_to_be_named(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("command_line.logs.catalogue_commands.DEFAULT_CONFIG", "/none/robot.toml")
    assert "name the folder" in refusal(capsys, "log", command, "--config", "/none/robot.toml")


def test_unknown_arguments_are_refused_with_the_usage_of_their_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert refusal(capsys, "stop", "--jsn").startswith("mudskipper stop: error: unrecognized arguments: --jsn")
    assert "'mudskipper log --help'" in refusal(capsys, "log")


def test_a_joint_is_named_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert "left_sweep is named twice" in refusal(capsys, "move", "left_sweep=5", "left_sweep=10")


def test_the_status_names_drives_that_were_not_heard_yet() -> None:
    heard: dict[str, Any] = {"angle_age_s": 0.0, "current_age_s": 0.0, "heartbeat_age_s": 0.1}
    drives = [heard | {"joint": joint} for joint in JOINTS]
    drives[1] = drives[1] | {"heartbeat_age_s": None}
    drives[3] = drives[3] | {"angle_age_s": None}
    line = operation._boot_line(drives)
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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("actuator", "--lever", "12cm"), "12cm: must be from 1 to 100 cm"),
        (("loadcell", "--scale", "many"), "many: must be more than 0"),
        (("loadcell", "--plate", "3x"), "3x: width and height must be from"),
        (("flipper", "--depth", "deep"), "deep: must be more than 0 and at most 20 cm"),
        *((("walk", "--mud", mud), f"{mud}: must be a mud and its length") for mud in ("=30", "47.6=long", "47.6=3")),
        (("walk", "--out", __file__), "must be a folder"),
    ],
)
def test_a_wrong_value_of_an_option_is_refused_by_that_value(
    arguments: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in refusal(capsys, "experiment", *arguments)


@pytest.mark.parametrize("experiment", ["walk", "trackway", "actuator"])
def test_without_matplotlib_no_experiment_begins(
    experiment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in (bench, studies):
        monkeypatch.setattr(module, "find_spec", lambda name: None)
    arguments = ("experiment", experiment, "--simulated", "--out", str(tmp_path / "none"))
    assert "extra 'plots'" in failure(capsys, *arguments)
    assert not (tmp_path / "none").exists()
