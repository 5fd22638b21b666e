"""Every command that reads a log of the paper's authors says what is wrong with it, where, and in the same words."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from command_line import exit_codes
from firmware_host.log_reading.lab_csv import read_lab_csv
from tests.command_line.command_lines import run
from tests.lab_logs import SETTINGS, lab_columns, write_lab_log

COMMANDS = {
    "replay": ("replay",),
    "log info": ("log", "info"),
    "log report": ("log", "report", "--out", "report"),
    "plot": ("plot", "--out", "walk.png"),
}
each_command = pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)


@pytest.fixture
def hung(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log with a current that hangs for half a second, and without a setting."""
    monkeypatch.chdir(tmp_path)
    columns = lab_columns()
    columns["rightsweeping_curr"][560:660] = columns["rightsweeping_curr"][560]
    return write_lab_log(tmp_path / "hung.csv", columns, SETTINGS | {"insertion_angle": ""})


@each_command
def test_findings_are_warnings_of_every_command(command: tuple[str, ...], hung: Path) -> None:
    ended = run(*command, str(hung))
    assert ended.returncode == exit_codes.OK
    (stuck,) = [line for line in ended.stderr.splitlines() if "rightsweeping_curr" in line]
    assert str(hung) in stuck and "at 2.800 s" in stuck and "0.50 s" in stuck
    assert any("insertion_angle" in line for line in ended.stderr.splitlines())


@pytest.mark.parametrize("command", [COMMANDS[name] for name in ("replay", "log info", "log report")], ids=" ".join)
def test_findings_are_a_list_for_programs(command: tuple[str, ...], hung: Path) -> None:
    ended = run(*command, str(hung), "--json")
    setting, stuck = json.loads(ended.stdout)["findings"]
    assert (setting["kind"], setting["column"], setting["time_s"], setting["line"]) == ("missing setting", *[None] * 3)
    assert stuck["kind"] == "stuck signal" and stuck["file"] == str(hung)
    assert (stuck["column"], stuck["time_s"], stuck["line"]) == ("rightsweeping_curr", 2.8, 564)


@each_command
def test_nonsense_is_refused_by_every_command(command: tuple[str, ...], hung: Path) -> None:
    columns = lab_columns()
    columns["leftsweeping_pos"] = columns["leftsweeping_pos"] * 360.0
    path = write_lab_log(hung.parent / "degrees.csv", columns)
    ended = run(*command, str(path))
    assert ended.returncode == exit_codes.UNHEALTHY and "Traceback" not in ended.stderr
    assert "degrees.csv: line" in ended.stderr and "column leftsweeping_pos" in ended.stderr


def test_log_info_says_what_a_csv_is(hung: Path) -> None:
    info = json.loads(run("log", "info", str(hung), "--json").stdout)
    log = read_lab_csv(hung)
    assert info["schema"] == "log-info/1" and info["rows"] == len(log.stamp_s)
    assert info["duration_s"] == pytest.approx(log.stamp_s[-1]) and info["rate_hz"] == pytest.approx(200.0)
    assert info["distinct_rate_hz"] == pytest.approx(200.0, rel=0.01)
    assert info["flippers"] == ["left", "right"] and info["strides"] == 3
    assert info["settings"]["lateral_angle_range"] == 0.5 and info["missing_settings"] == ["insertion_angle"]
    shown = run("log", "info", str(hung)).stdout
    assert "missing_settings insertion_angle" in shown and "lateral_angle_range 0.5" in shown
