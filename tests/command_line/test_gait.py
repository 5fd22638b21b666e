"""`mudskipper gait`: exit statuses, and the picture."""

from pathlib import Path

import pytest

from command_line import exit_codes
from control.geometry import FlipperGeometry
from control.parameters.gait_path import GaitPath, GaitPhase, WayPoint
from experiments.pictures.gait_picture import draw_gait
from tests.command_line.command_lines import run

SWING = '[[phase]]\nname = "swing"\nduration_s = 0.8\nway_points = [{ sweep_deg = 20.0, depth_m = -0.01 }]\n'
STANCE = '[[phase]]\nname = "stance"\nspeed_m_s = 0.3\nway_points = [{ sweep_deg = -20.0, depth_m = -0.01 }]\n'


def test_a_gait_that_is_checked_is_drawn(tmp_path: Path) -> None:
    picture = tmp_path / "path.png"
    checked = run("gait", "check", "ellipse", "--out", str(picture))
    assert checked.returncode == exit_codes.OK and "-0.72 to 3.00 to -0.72" in checked.stdout  # cm, under the body
    assert picture.stat().st_size > 10_000


def test_the_whole_path_of_a_gait_is_drawn_on_scales_and_a_pause_is_a_dot() -> None:
    deep, high = (WayPoint(sweep_deg=10.0, depth_m=depth_m) for depth_m in (0.05, -0.15))
    stance, swing = GaitPhase("stance", (deep,), duration_s=1.0), GaitPhase("swing", (high,), duration_s=1.0)
    path = GaitPath((stance, GaitPhase("pause", duration_s=0.5), swing))
    (panel,) = draw_gait(path, FlipperGeometry(), 0.02).axes
    low_m, high_m = panel.get_ylim()
    assert low_m < -0.05 and high_m > 0.15
    assert panel.get_xlabel() and panel.axison
    markers = {str(line.get_label()): line.get_marker() for line in panel.lines}
    assert (markers["stance"], markers["pause"]) == ("", "o")


@pytest.mark.parametrize(
    ("text", "status"),
    [
        (STANCE + SWING, exit_codes.OK),
        (STANCE, exit_codes.CONFIGURATION),
        (STANCE.replace("sweep_deg", "sweep") + SWING, exit_codes.CONFIGURATION),
        ("phase = 1", exit_codes.CONFIGURATION),
        ("[[phase", exit_codes.CONFIGURATION),
        ("", exit_codes.CONFIGURATION),
    ],
)
@pytest.mark.parametrize("command", ["check", "simulate"])
def test_a_file_of_ones_own_is_accepted_or_named(tmp_path: Path, text: str, status: int, command: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(f"depths_m = [0.02]\n{text}" if text else "", encoding="utf-8")
    arguments = ["--strides", "1"] if command == "simulate" else []
    found = run("gait", command, str(path), *arguments)
    assert found.returncode == status
    assert "Traceback" not in found.stderr
    assert status == exit_codes.OK or "mine.toml" in found.stderr


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        (f"depths_m = [0.02, 0.06]\n{STANCE}", "depth 6 cm: must be from 0.5 to 5 cm, which is adaptation.max_depth_m"),
        (f"depths_m = [0.02]\n{100 * STANCE}", "must be at most 3000"),
    ],
)
@pytest.mark.parametrize("command", ["check", "simulate"])
def test_what_the_daemon_refuses_is_refused_by_the_check_too(
    tmp_path: Path, command: str, text: str, wrong: str
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text + SWING, encoding="utf-8")
    found = run("gait", command, str(path))
    assert found.returncode == exit_codes.CONFIGURATION
    assert wrong in found.stderr and (command == "simulate" or "mine.toml" in found.stderr)


def test_a_robot_that_cannot_be_armed_walks_no_gait_and_says_why(tmp_path: Path) -> None:
    robot = tmp_path / "robot.toml"
    assert run("init", str(robot), "--defaults").returncode == exit_codes.OK
    with robot.open("a", encoding="utf-8") as file:
        file.write("\n[faults]\nvoltage_min_v = 50.0\nvoltage_low_v = 50.0\n")  # the simulated supply has 24 V
    found = run("gait", "simulate", "walking", "--config", str(robot))
    assert found.returncode == exit_codes.UNHEALTHY
    assert "50" in found.stderr and "Traceback" not in found.stderr


def test_a_gait_is_simulated_for_a_robot_that_is_not_calibrated_yet(tmp_path: Path) -> None:
    robot = str(tmp_path / "robot.toml")
    assert run("init", robot, "--defaults", "--flippers", "right", "--drive", "mit").returncode == exit_codes.OK
    assert run("gait", "simulate", "walking", "--strides", "1", "--config", robot).returncode == exit_codes.OK


def test_a_robot_on_a_fixed_base_does_not_advance(tmp_path: Path) -> None:
    robot = str(tmp_path / "robot.toml")
    assert run("init", robot, "--defaults", "--base", "fixed").returncode == exit_codes.OK
    found = run("gait", "simulate", "walking", "--mud", "48.5", "--strides", "1", "--config", robot)
    assert found.returncode == exit_codes.OK and "0.0 cm in" in found.stdout


def test_a_path_without_depths_is_accepted_for_a_walk_that_gives_one(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(STANCE + SWING, encoding="utf-8")
    checked, walked = run("gait", "check", str(path)), run("gait", "simulate", str(path))
    assert checked.returncode == exit_codes.OK and "needs --depth" in checked.stdout
    assert walked.returncode == exit_codes.CONFIGURATION and "depths_m is missing" in walked.stderr
    simulated = run("gait", "simulate", str(path), "--depth", "2", "--strides", "1")
    assert simulated.returncode == exit_codes.OK
