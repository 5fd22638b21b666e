"""`mudskipper doctor` runs without a daemon, with one, and with a wrong configuration."""

import json
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.doctor import doctor
from command_line.doctor.doctor import examine_all, examine_daemon, examine_pose
from command_line.doctor.findings import Level
from control.records import JOINTS
from drivers.pose.natnet_sockets import NatNetParameters
from drivers.pose.rail_encoder import RailEncoderParameters
from firmware_host.configuration.configuration import Configuration, PoseParameters
from firmware_host.configuration.loading import load_configuration
from simulation.devices.natnet_server import LOOPBACK, NatNetServer, RecordedPose
from simulation.harness.local_setup import write_local_setup
from tests.command_line.command_lines import run
from tests.running_bench import Bench
from tests.waiting import LONGEST_S

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


# the source of the pose, which `mudskipper check` examines when no daemon runs


def test_a_source_that_does_not_open_fails_and_a_robot_without_one_has_no_line_for_it(
    configuration: Configuration,
) -> None:
    assert examine_pose(configuration) == []
    pytest.importorskip("serial", reason="pyserial is not installed")
    encoder = RailEncoderParameters(device="/dev/nothing", metres_per_count=1e-5)
    (item,) = examine_pose(replace(configuration, pose=PoseParameters("rail_encoder", rail_encoder=encoder)))
    assert item.level is Level.FAIL and "/dev/nothing" in item.text and item.fix


def test_motion_capture_is_received(configuration: Configuration, monkeypatch: pytest.MonkeyPatch) -> None:
    with NatNetServer() as server:
        natnet = NatNetParameters(server=LOOPBACK, group="", command_port=server.address[1])
        looked_at = replace(configuration, pose=PoseParameters("natnet", natnet=natnet))
        (item,) = examine_pose(looked_at)
        assert item.level is Level.WARN and item.fix
        ended = threading.Event()

        def stream() -> None:
            while not ended.is_set():
                server.add(RecordedPose(time.monotonic(), (time.monotonic() % 1000.0 * 1e-3, 0.0, 0.0)))
                server.step(time.monotonic())
                time.sleep(0.005)

        streaming = threading.Thread(target=stream)
        streaming.start()
        monkeypatch.setattr(doctor, "LISTENING_S", LONGEST_S)  # a pose ends it
        (item,) = examine_pose(looked_at)
        ended.set()
        streaming.join()
    assert item.level is Level.OK and item.text.startswith("NatNet 4.1 from 127.0.0.1: ")
