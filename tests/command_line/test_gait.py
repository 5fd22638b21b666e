"""`mudskipper gait`: exit statuses, and the picture."""

from pathlib import Path

import pytest

from command_line import exit_codes
from control.geometry import FlipperGeometry
from control.parameters.gait_path import GaitPath, GaitPhase, WayPoint
from experiments.pictures.gait_picture import draw_gait
from tests.command_line.command_lines import failure, output

SWING = '[[phase]]\nname = "swing"\nduration_s = 0.8\nway_points = [{ sweep_deg = 20.0, depth_m = -0.01 }]\n'
STANCE = '[[phase]]\nname = "stance"\nspeed_m_s = 0.3\nway_points = [{ sweep_deg = -20.0, depth_m = -0.01 }]\n'


def write_gait(folder: Path, text: str) -> str:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def new_robot(folder: Path, *options: str) -> str:
    path = str(folder / "robot.toml")
    output("init", path, "--defaults", *options)
    return path


def test_a_gait_that_is_checked_is_drawn(tmp_path: Path) -> None:
    picture = tmp_path / "path.png"
    shown = output("gait", "check", "ellipse", "--out", str(picture))
    assert "-0.72 to 3.00 to -0.72" in shown  # cm, under the body
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
    ("text", "wrong"),
    [
        ("", "mine.toml: phase is missing"),
        ("[[phase", "mine.toml: not a TOML file"),
        ("phase = 1", "mine.toml: phase = 1: must be tables"),
        ("name = 3", "mine.toml: name = 3: must be a text"),
        (f"depths_m = [0.02, 0.06]\n{STANCE}{SWING}", "mine.toml: depths_m: depth 6 cm: must be from 0.5 to 5 cm"),
        (100 * STANCE + SWING, "must be at most 3000"),
    ],
)
@pytest.mark.parametrize("command", ["check", "simulate"])
def test_what_the_daemon_refuses_is_refused_without_one(tmp_path: Path, command: str, text: str, wrong: str) -> None:
    gait = write_gait(tmp_path, text if "depths_m" in text else f"depths_m = [0.02]\n{text}")
    assert wrong in failure("gait", command, gait, status=exit_codes.CONFIGURATION)


def test_a_gait_without_depths_takes_a_given_one_or_adapts(tmp_path: Path) -> None:
    gait = write_gait(tmp_path, STANCE + SWING)
    assert "adapts to the mud" in output("gait", "check", gait)
    output("gait", "simulate", gait, "--depth", "2", "--strides", "1")


def test_an_elliptic_gait_adapts_its_depth_also_where_its_file_has_one() -> None:
    """In this soft mud it goes deeper than the 3 cm of its file, with twice the step."""
    fixed, adapted = (
        output("gait", "simulate", "ellipse", "--mud", "53.1", "--strides", "4", *option)
        for option in ((), ("--adaptive",))
    )
    (fixed_cm, _), (adapted_cm, _) = (shown.splitlines()[-1].split(" cm in ") for shown in (fixed, adapted))
    assert float(adapted_cm) > 2.0 * float(fixed_cm) > 0.0


def test_a_robot_that_cannot_be_armed_walks_no_gait_and_says_why(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    with open(robot, "a", encoding="utf-8") as file:
        file.write("\n[faults]\nvoltage_min_v = 50.0\nvoltage_low_v = 50.0\n")  # the simulated supply has 24 V
    assert "50" in failure("gait", "simulate", "walking", "--config", robot)


def test_a_gait_is_simulated_for_a_robot_that_is_not_calibrated_yet(tmp_path: Path) -> None:
    robot = new_robot(tmp_path, "--flippers", "right", "--drive", "mit")
    output("gait", "simulate", "walking", "--strides", "1", "--config", robot)


def test_a_robot_on_a_fixed_base_does_not_advance(tmp_path: Path) -> None:
    robot = new_robot(tmp_path, "--base", "fixed")
    shown = output("gait", "simulate", "walking", "--mud", "48.5", "--strides", "1", "--config", robot)
    assert "0.0 cm in" in shown
