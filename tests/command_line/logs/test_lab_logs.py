"""Every command that reads a log of the paper's authors reports its problems and their position in the same words."""

from pathlib import Path

import numpy as np
import pytest

import mudskipper
from command_line import exit_codes
from experiments.lablogs.estimates import EvaluatedLog, read_log
from firmware_host.configuration.loading import parse_configuration
from logs.lab.lab_csv import read_lab_csv
from logs.replay import Replay
from tests.command_line.command_lines import failure, json_of, output, refusal, run
from tests.lab_logs import SETTINGS, lab_columns, write_lab_log

pytestmark = pytest.mark.usefixtures("png_alone")


@pytest.fixture
def hung(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write a log in which one current is frozen for half a second and one setting is missing."""
    monkeypatch.chdir(tmp_path)
    columns = lab_columns()
    columns["rightsweeping_curr"][560:660] = columns["rightsweeping_curr"][560]
    return write_lab_log(tmp_path / "hung.csv", columns, SETTINGS | {"insertion_angle": ""})


@pytest.mark.parametrize("command", ["replay", "log info", "log report --out report", "plot --out walk.png"])
def test_findings_are_warnings_of_every_command(command: str, hung: Path) -> None:
    ended = run(*command.split(), str(hung))
    assert ended.returncode == exit_codes.OK
    (stuck,) = [line for line in ended.stderr.splitlines() if "rightsweeping_curr" in line]
    assert str(hung) in stuck and "at 2.800 s" in stuck and "0.50 s" in stuck
    assert any("insertion_angle" in line for line in ended.stderr.splitlines())


@pytest.mark.parametrize("command", ["replay", "log info"])
def test_findings_are_a_list_for_programs(command: str, hung: Path) -> None:
    setting, stuck = json_of(*command.split(), str(hung))["findings"]
    assert (setting["kind"], setting["column"], setting["time_s"], setting["line"]) == ("missing setting", *[None] * 3)
    assert stuck["kind"] == "stuck signal" and stuck["file"] == str(hung)
    assert (stuck["column"], stuck["time_s"], stuck["line"]) == ("rightsweeping_curr", 2.8, 564)


@pytest.mark.parametrize("command", ["replay", "plot"])
def test_nonsense_is_refused_by_every_command(command: str, hung: Path) -> None:
    columns = lab_columns()
    columns["leftsweeping_pos"] = columns["leftsweeping_pos"] * 360.0
    path = write_lab_log(hung.parent / "degrees.csv", columns)
    message = failure(command, str(path))
    assert "degrees.csv: line" in message and "column leftsweeping_pos" in message


def test_log_info_describes_a_csv(hung: Path) -> None:
    info = json_of("log", "info", str(hung))
    log = read_lab_csv(hung)
    assert info["schema"] == "log-info/2" and info["rows"] == len(log.stamp_s)
    assert info["duration_s"] == pytest.approx(log.stamp_s[-1]) and info["rate_hz"] == pytest.approx(200.0)
    assert info["distinct_rate_hz"] == pytest.approx(200.0, rel=0.01)
    assert info["flippers"] == ["left", "right"] and info["strides"] == 3
    assert info["settings"]["lateral_angle_range"] == 0.5 and info["missing_settings"] == ["insertion_angle"]
    shown = output("log", "info", str(hung))
    assert "missing_settings   insertion_angle" in shown and "lateral_angle_range 0.5" in shown


@pytest.fixture
def z_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write a walk in a capture with z up: the body sinks by 61 mm and advances by 33 mm along x."""
    monkeypatch.chdir(tmp_path)
    columns = lab_columns()
    stance = columns["turtle_state"] == 3
    done = np.cumsum(stance) / np.count_nonzero(stance)
    for axis, change_m in zip("xyz", (0.033 * done, 0.0 * done, -0.061 * done), strict=True):
        columns[f"OptitrackPosition_{axis}"] = 0.1 + change_m
    return write_lab_log(tmp_path / "z_up.csv", columns)


@pytest.mark.parametrize("command", ["replay", "log info"])
def test_every_command_takes_the_vertical_axis_of_the_capture(command: str, z_up: Path) -> None:
    words = (*command.split(), str(z_up))
    assert "sinks by" not in run(*words).stderr
    ended = run(*words, "--vertical", "z")
    assert ended.returncode == exit_codes.OK and "sinks by 61 mm" in ended.stderr
    assert "--vertical" in refusal(*words, "--vertical", "w")


def test_lablogs_takes_the_vertical_axis_of_its_logs(z_up: Path) -> None:
    log = read_log((z_up,), vertical="z")
    assert isinstance(log, EvaluatedLog) and any("sinks by 61 mm" in finding for finding in log.findings)


def test_a_replay_takes_the_vertical_axis_of_its_configuration(z_up: Path, example_text: str) -> None:
    """The argument `vertical` overrides the configuration."""
    configuration = parse_configuration(example_text + '\n[pose]\nvertical = "z"\n')
    by_z, by_y = mudskipper.replay(z_up, vertical="z"), mudskipper.replay(z_up)
    assert _steps_m(by_z) != _steps_m(by_y)
    assert _steps_m(mudskipper.replay(z_up, configuration=configuration)) == _steps_m(by_z)
    assert _steps_m(mudskipper.replay(z_up, configuration=configuration, vertical="y")) == _steps_m(by_y)


def _steps_m(replayed: Replay) -> list[float]:
    return [round(stride.step_m, 9) for stride in replayed.strides[2:]]  # the first stride's is unknown


def test_a_replay_refuses_a_vertical_axis_for_its_own_log(tmp_path: Path) -> None:
    with pytest.raises(mudskipper.LogError, match="vertical"):
        mudskipper.replay(tmp_path / "walk.mcap", vertical="z")
