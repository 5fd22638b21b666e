"""`mudskipper probe` writes what it found into log and configuration, and moves nothing where it is refused."""

import json
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.operation import probe
from estimation.strokes.surface import NO_SURFACE
from experiments.robot.surface_probe import ProbedSurface, Touch
from firmware_host.configuration.loading import load_configuration, parse_configuration
from tests.command_line.command_lines import failure, json_of, run

FOUND = ProbedSurface([Touch("left", 0.5, NO_SURFACE._replace(depth_m=-0.002, std_error_m=1e-4))], -0.002, 3e-4, 4e-4)


class Robot:
    """Answers as the daemon's robot, and records the calls."""

    mode = "hold"

    def __init__(self, text: str) -> None:
        self.configuration = parse_configuration(text)
        self.calls: list[str] = []

    def call(self, method: str, **params: Any) -> Any:
        self.calls.append(method)
        return {"mode": self.mode}

    def leave_holding(self) -> None:
        self.calls.append("leave_holding")

    def close(self) -> None:
        self.calls.append("close")


@pytest.fixture
def robot(example_text: str, monkeypatch: pytest.MonkeyPatch) -> Robot:
    made = Robot(example_text)
    monkeypatch.setattr(probe, "DaemonRobot", lambda socket: made)
    monkeypatch.setattr(probe, "probe_surface", lambda robot, show: FOUND)
    return made


def test_height_and_error_go_to_the_log_and_to_the_file(robot: Robot, tmp_path: Path, example_text: str) -> None:
    path = tmp_path / "mudskipper.toml"
    path.write_text(example_text, encoding="utf-8")
    report = json_of("probe", "--config", str(path))
    assert (report["schema"], report["depth_m"], len(report["touches"])) == ("probe/1", -0.002, 1)
    assert robot.calls == ["status", "note", "leave_holding"]
    changed = load_configuration(path)
    assert changed.geometry.axis_height_m == pytest.approx(robot.configuration.geometry.axis_height_m - 0.002)
    assert changed.estimation.surface_error_m == report["surface_error_m"] == pytest.approx(5e-4)
    assert path.with_name("mudskipper.toml.before").read_text(encoding="utf-8") == example_text


def test_a_height_with_which_strides_are_out_of_reach_is_reported_and_not_written(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(probe, "probe_surface", lambda robot, show: FOUND._replace(depth_m=0.02))
    path = tmp_path / "mudskipper.toml"
    path.write_text(robot.configuration.text, encoding="utf-8")
    ended = run("probe", "--json", "--config", str(path))
    assert ended.returncode == exit_codes.REFUSED and "max_depth_m" in ended.stderr
    assert json.loads(ended.stdout)["depth_m"] == 0.02
    assert path.read_text(encoding="utf-8") == robot.configuration.text


@pytest.mark.parametrize(("mode", "text"), [("idle", None), ("hold", "another = 1\n")])
def test_a_refused_probe_leaves_the_robot_as_it_is(robot: Robot, tmp_path: Path, mode: str, text: str | None) -> None:
    robot.mode, path = mode, tmp_path / "mudskipper.toml"
    path.write_text(text or robot.configuration.text, encoding="utf-8")
    failure("probe", "--config", str(path), status=exit_codes.REFUSED)
    assert robot.calls == ["status", "leave_holding"]
