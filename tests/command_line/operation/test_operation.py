"""An operator's session against a real daemon and a simulated robot, as processes in real time."""

import json
import os
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.operation.confirmation import RESTING, TORQUE_UNKNOWN
from control.modes import ENERGISED, Mode
from control.records import JOINTS
from drivers.fault_injection.failures import Failures
from firmware_host.configuration import socket_paths
from firmware_host.configuration.configuration import EXIT_CONFIGURATION, StatusParameters
from logs.files.log_reader import read_log
from logs.files.log_summary import log_summary
from logs.replay import replay_files
from operator_client.default_paths import DEFAULT_SOCKET
from operator_client.status_client import OPERATORS
from simulation.harness.peer import WATCHDOG_S
from tests.command_line.command_lines import run
from tests.running_bench import Bench
from tests.waiting import LONGEST_S, wait_until


def test_a_session_of_all_commands_leaves_a_complete_log(own_bench: Bench) -> None:
    bench = own_bench
    assert bench.run("check").returncode == exit_codes.OK
    too_early = bench.run("walk")
    assert too_early.returncode == exit_codes.REFUSED and "mudskipper arm" in too_early.stderr
    assert json.loads(bench.run("arm", "--json").stdout)["mode"] == "hold"
    assert bench.run("move", "left_sweep=10", "right_sweep=10").stdout == "hold\n"
    assert abs(json.loads(bench.run("status", "--json").stdout)["drives"][0]["angle_rad"] - 0.1745) < 0.03
    assert bench.run("move", "left_sweep=170").returncode == exit_codes.REFUSED
    too_deep = bench.run("walk", "--depth", "19")
    assert too_deep.returncode == exit_codes.REFUSED and "19 cm" in too_deep.stderr and "5 cm" in too_deep.stderr
    described = ("--mud", "A/B", "--water", "49.5", "--trial", "3", "--tag", "wet", "--tag", "warm", "--note", "rain")
    assert bench.run("walk", "--depth", "3", *described).stdout == "walking\n"
    assert json.loads(bench.run("note", "it slips", "--json").stdout)["stamp_s"] > 0.0
    bench.wait_for(lambda report: report["strides_closed"] >= 2)
    status = json.loads(bench.run("status", "--json").stdout)
    assert status["schema"] == "status/2" and status["mode"] == "walking"
    assert all(drive["closed_loop"] for drive in status["drives"])
    table = bench.run("status").stdout
    assert "walking" in table and "left_sweep" in table and "\033" not in table
    assert "V in the last stride\n" in table and "uncopied ones last" in table
    assert bench.run("stop").stdout == "hold\n"
    assert bench.run("disarm").stdout == "idle\n"
    path = bench.stop_daemon()
    log, replayed = read_log(path), replay_files([path])
    assert path.stem.endswith("-0001_A_B_3") and log.complete
    trial = {"mud": "A/B", "water": "49.5", "trial": "3", "tags": "wet,warm", "note": "rain"}
    assert log_summary(log)["trial"] == trial
    assert any(event["text"].endswith(": it slips") for event in log.events)
    assert len(replayed.strides) >= 2 and replayed.segment == 0  # nothing before the trial is needed
    assert [stride.k_p.value for stride in replayed.strides] == [stride["k_p"] for stride in log.strides]


def test_a_killed_daemon_leaves_idle_drives_and_a_readable_log_until_an_operator_clears(own_bench: Bench) -> None:
    bench = own_bench
    bench.run("arm")
    bench.run("walk")
    bench.wait_for(lambda report: report["mode"] == "walking")
    defaults = json.loads(bench.run("trial", "set", "mud=A", "plate=flat", "--json").stdout)["defaults"]
    wait_until((bench.logs / "trial.json").exists)
    bench.daemon.kill()
    bench.daemon.wait(LONGEST_S)
    time.sleep(2.0 * WATCHDOG_S)  # only the drives' own watchdogs can have acted
    bench.restart_daemon()
    report = bench.wait_for(lambda report: report["mode"] == "idle")
    restored = {"schema": "trial/1", "defaults": defaults, "present": {}}
    assert json.loads(bench.run("trial", "--json").stdout) == restored
    assert not any(drive["closed_loop"] for drive in report["drives"])
    assert {drive["errors"] for drive in report["drives"]} == {"watchdog expired"}
    assert report["fault"]["name"] == "drive_error"
    assert bench.run("arm").returncode == exit_codes.REFUSED
    first = min(bench.logs.glob("*/*.mcap"), key=lambda path: path.name)
    assert Mode.WALKING in read_log(first).ticks["mode"]
    bench.reset()
    assert bench.run("arm").stdout == "hold\n"
    bench.run("walk", "--mud", "")
    assert json.loads(bench.run("trial", "--json").stdout)["present"] == {"plate": "flat"}


def test_a_robot_that_disappears_is_a_fault_and_its_drives_fail_the_check(own_bench: Bench) -> None:
    own_bench.run("arm")
    own_bench.robot.kill()
    silent = {"left_sweep", "right_adduction"}  # their silence may be detected in different ticks
    own_bench.wait_for(lambda report: silent <= {fault["subject"] for fault in report["faults"]})
    assert own_bench.wait_for(lambda report: report["mode"] == "fault")["fault"]
    assert own_bench.run("status").returncode == exit_codes.UNHEALTHY
    for command in ("stop", "disarm"):
        ended = own_bench.run(command)
        assert ended.returncode == exit_codes.TORQUE_UNKNOWN and TORQUE_UNKNOWN in ended.stderr
    check = own_bench.run("check", "--json")
    assert check.returncode == exit_codes.UNHEALTHY
    assert {"drive.left_sweep", "drive.right_adduction"} <= {
        item["id"] for item in json.loads(check.stdout) if not item["ok"] and item["fix"]
    }


def test_a_failing_drive_stops_the_robot_and_is_shown_and_logged(own_bench: Bench) -> None:
    bench = own_bench
    bench.run("arm")
    done = bench.run("fail", "left_sweep", "off", "--for", "5")
    assert done.returncode == exit_codes.OK and "left_sweep  off" in done.stdout
    report = bench.wait_for(lambda report: report["mode"] == "fault")
    assert "left_sweep" in json.dumps(report["fault"])
    assert "failing on purpose: left_sweep off" in bench.run("status").stdout
    assert bench.run("fail", "all", "ok").stdout == "nothing fails on purpose\n"
    bench.wait_for(lambda report: report["failing"] == [] and report["drives"][0]["angle_age_s"] < 0.1)
    texts = [event["text"] for event in read_log(bench.stop_daemon()).events]
    (begin,) = [text for text in texts if text.startswith("failing on purpose")]
    assert begin.startswith("failing on purpose: left_sweep off for 5 s, asked by ")
    assert "end of failing on purpose: left_sweep off" in texts


def test_the_list_shows_every_component_with_its_kinds(bench: Bench) -> None:
    listed = json.loads(bench.run("fail", "--list", "--json").stdout)
    table = [(row["component"], row["kind"], row["does"]) for row in listed["table"]]
    assert table == list(Failures(("left", "right")).table()) and listed["failing"] == []
    assert listed["schema"] == "failures/1"
    shown = bench.run("fail", "--list").stdout
    assert {row["family"] for row in listed["table"]} <= set(shown.split()) and all(joint in shown for joint in JOINTS)


def test_check_without_a_daemon_checks_what_it_can(short_folder: Path, tmp_path: Path, example_text: str) -> None:
    path = tmp_path / "mudskipper.toml"
    path.write_text(example_text.replace('"can0"', '"nocan0"'), encoding="utf-8")
    ended = run("check", "--socket", str(short_folder / "none"), "--config", str(path), "--json")
    assert ended.returncode == exit_codes.UNHEALTHY
    items = {item["id"]: item for item in json.loads(ended.stdout)}
    assert not items["daemon"]["ok"] and items["configuration"]["ok"]
    assert "nocan0" in items["bus"]["text"] and items["bus"]["fix"]
    assert "of walking" in items["disk"]["text"]


def test_the_version_and_a_completion_script_are_printed() -> None:
    assert run("--version").stdout.startswith("mudskipper ")
    assert "--attended" in run("--print-completion", "bash").stdout


@pytest.mark.skipif(shutil.which("fish") is None, reason="needs fish")
@pytest.mark.parametrize(
    ("typed", "offered"),
    [("log pu", ["pull"]), ("move left", ["left_adduction=", "left_sweep="]), ("init --drive odrive0", ["odrive05"])],
)  # fmt: skip
def test_fish_completes_commands_options_and_joints(tmp_path: Path, typed: str, offered: list[str]) -> None:
    script = tmp_path / "mudskipper.fish"
    script.write_text(run("--print-completion", "fish").stdout, encoding="utf-8")
    command = ["fish", "--no-config", "-c", f"source {script}; complete -C 'mudskipper {typed}'"]
    found = subprocess.run(
        command, capture_output=True, text=True, check=True, env=os.environ | {"HOME": str(tmp_path)}
    )
    assert sorted(line.split("\t")[0] for line in found.stdout.splitlines()) == offered


def test_the_command_line_and_the_daemon_agree() -> None:
    """The command line keeps copies of the daemon's constants because `status` has to start fast."""
    assert exit_codes.CONFIGURATION == EXIT_CONFIGURATION
    assert StatusParameters().socket == DEFAULT_SOCKET
    assert OPERATORS == socket_paths.OPERATORS
    assert set(RESTING) == {mode.name.lower() for mode in Mode if mode not in ENERGISED}
