"""`mudskipper doctor` runs without a daemon, with one, and with a wrong configuration."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.doctor.doctor import examine_all, examine_daemon
from command_line.doctor.findings import Level
from control.records import JOINTS
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration
from simulation.harness.local_setup import write_local_setup
from tests.command_line.command_lines import run
from tests.running_bench import Bench

LINES = {"configuration", "kernel", "governor", "processors", "interrupts", "disk", "log", "clock", "daemon"}


def synthetic_status(**changes: Any) -> dict[str, Any]:
    drives = [{"joint": joint, "watchdog_s": 0.1} for joint in JOINTS]
    return {"version": "1.0", "mode": "idle", "drives": drives} | changes


def test_without_a_daemon_every_line_is_there_and_says_what_to_do(short_folder: Path, tmp_path: Path) -> None:
    ended = run("doctor", "--config", str(write_local_setup(short_folder, tmp_path / "logs")), "--json")
    found = {line["id"]: line for line in json.loads(ended.stdout)}
    assert set(found) >= LINES | {"bus.left", "load.left", "bus.right", "load.right"}
    assert found["daemon"]["level"] == "warn"
    assert all(set(line) == {"id", "level", "text", "fix"} for line in found.values())
    assert all(bool(line["fix"]) is (line["level"] != "ok") for line in found.values())
    failed = any(line["level"] == "fail" for line in found.values())
    assert ended.returncode == (exit_codes.UNHEALTHY if failed else exit_codes.OK)


def test_a_wrong_configuration_fails_line_by_line(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text("[loop]\npriority = 1000\nspeed = 3\n", encoding="utf-8")
    ended = run("doctor", "--config", str(path))
    assert ended.returncode == exit_codes.UNHEALTHY
    assert all(word in ended.stdout for word in ("FAIL configuration", "loop.priority", "loop.speed", f"edit {path}"))


@pytest.mark.parametrize(
    ("watchdog_s", "level"), [(0.3, Level.OK), (None, Level.WARN), (0.0, Level.FAIL), (0.5, Level.FAIL)]
)
def test_a_drive_without_a_watchdog_that_is_quick_enough_fails(
    watchdog_s: float | None, level: Level, configuration: Configuration
) -> None:
    drives = [{"joint": "left_sweep", "watchdog_s": watchdog_s}]
    bounds = replace(configuration.faults, longest_watchdog_s=0.3)
    found = list(examine_daemon(synthetic_status(drives=drives), "1.0", replace(configuration, faults=bounds)))
    assert {finding.id: finding.level for finding in found} == {"daemon": Level.OK, "watchdog.left_sweep": level}
    assert found[1].fix in ("", f"docs/how-to/{configuration.drive['left_sweep'].type}.md")


def test_a_daemon_of_another_version_is_warned_of(configuration: Configuration) -> None:
    found = next(iter(examine_daemon(synthetic_status(), "1.1", configuration)))
    assert found.level is Level.WARN
    assert "1.0" in found.text and "1.1" in found.text


def test_a_running_daemon_reports_its_process_its_drives_and_its_limits(bench: Bench) -> None:
    configuration = load_configuration(bench.configuration)
    found = {finding.id: finding for finding in examine_all(configuration, bench.socket, {})}
    assert found["daemon"].level is Level.OK
    assert {f"watchdog.{joint}" for joint in JOINTS} <= set(found)
    assert "unfinished_logs" not in found
    assert found["loop.priority"].text.startswith("the running loop has real-time priority ")
    assert "of the daemon" in found["memlock"].text
    assert "realtime" not in found  # the loop has its priority, whatever a limit would permit
    assert found["socket"].level is Level.OK
