"""`mudskipper init` writes files that the daemon accepts, and none that it would refuse."""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.init import init
from command_line.init.key_reference import configuration_keys, is_required
from command_line.init.new_file import NewRobot, new_file
from command_line.main import main
from control.geometry import FlipperGeometry
from control.parameters.joint_gains import GAINS_OF_ASKED_DRIVES, JointGains
from control.records import JOINTS
from drivers.drive_types import DRIVE_TYPES
from experiments.campaign.plate_file import read_corners
from firmware_host.configuration.loading import load_configuration, parse_configuration
from tests.command_line.command_lines import failure, output
from tests.folders import ROOT

PLATES = ROOT / "examples" / "plates"


def answered(lines: Sequence[str], *arguments: str) -> tuple[NewRobot, list[str]]:
    """Return the robot that these answers describe, and the questions that were asked."""
    asked: list[str] = []
    robots: list[NewRobot] = []
    replies: Iterator[str] = iter(lines)

    def read(prompt: str) -> str:
        asked.append(prompt)
        return next(replies, "")

    def write(robot: NewRobot) -> str:
        robots.append(robot)
        return new_file(robot)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys.stdin, "isatty", lambda: True)
        patch.setattr("builtins.input", read)
        patch.setattr(init, "new_file", write)
        assert main(["init", "-", *arguments]) == exit_codes.OK
    return robots[0], asked


@pytest.mark.parametrize("flippers", ["left", "right", "both"])
@pytest.mark.parametrize("drive", list(DRIVE_TYPES))
@pytest.mark.parametrize("base", ["fixed", "rail", "free"])
def test_every_rig_with_every_drive_is_accepted(tmp_path: Path, flippers: str, drive: str, base: str) -> None:
    path = tmp_path / "robot.toml"
    output("init", str(path), "--flippers", flippers, "--drive", drive, "--base", base)
    configuration = load_configuration(path)
    assert configuration.rig.flippers == (("left", "right") if flippers == "both" else (flippers,))
    assert tuple(configuration.drive) == configuration.rig.joints
    assert {each.type for each in configuration.drive.values()} == {drive}
    known = configuration.estimation
    assert (known.fixed_base, known.free_body) == (base == "fixed", base == "free")


@pytest.mark.parametrize("drive", list(DRIVE_TYPES))
def test_drives_that_are_asked_get_the_gains_for_answers_of_a_tick_ago(drive: str) -> None:
    gains = parse_configuration(new_file(NewRobot(drive_type=drive))).gains
    asked = DRIVE_TYPES[drive].parameters.answers_only
    assert gains == (GAINS_OF_ASKED_DRIVES if asked else JointGains())


def test_the_comment_of_a_drive_s_key_is_not_that_of_a_proof() -> None:
    text = new_file(NewRobot(drive_type="mit"))
    assert "# on that bus (id, 1 to 15)" in text and "that was tried" not in text


def test_without_a_terminal_nothing_is_asked() -> None:
    assert parse_configuration(output("init", "-", "--name", "mudcat")).robot.name == "mudcat"


def test_empty_answers_are_the_defaults() -> None:
    robot, asked = answered([])
    assert parse_configuration(new_file(robot)).geometry == FlipperGeometry()
    assert len(asked) == 6 + len(JOINTS) + 8
    assert robot == NewRobot(node_ids={joint: number for number, joint in enumerate(JOINTS)})


def test_a_wrong_answer_is_asked_again(capsys: pytest.CaptureFixture[str]) -> None:
    lines = "mudcat middle right fixed odrive socketcan can7 63 5 6 square rectangle long 0.001 0.115"
    robot, _ = answered(lines.split())
    written, printed = capsys.readouterr()
    assert parse_configuration(written).robot.name == "mudcat"
    assert (robot.name, robot.rig.flippers, robot.channels) == ("mudcat", ("right",), ("can7",))
    assert robot.node_ids == {"right_sweep": 5, "right_adduction": 6}
    assert robot.geometry == FlipperGeometry(flipper_length_m=0.115)
    refused = [line.partition(":")[0].strip() for line in printed.splitlines() if line.startswith(" ")]
    assert refused == ["middle", "63", "square", "long", "0.001"]


def test_an_option_answers_its_question() -> None:
    _, asked = answered([], "--flippers", "left", "--set", "drop_m=0.04", "--node", "left_sweep=7", "--channel", "can3")
    assert not [prompt for prompt in asked if prompt.startswith(("flippers", "drop_m", "node id of left_sweep", "its"))]


@pytest.mark.parametrize("name", ["trapezoid", "paddle"])
def test_a_plate_comes_from_a_file_of_its_corners(name: str) -> None:
    file = PLATES / f"{name}.csv"
    robot, asked = answered([], "--plate", str(file))
    written = parse_configuration(new_file(robot)).geometry
    assert written.plate_corners_m == robot.geometry.plate_corners_m == read_corners(file)
    assert not [prompt for prompt in asked if prompt.startswith(("plate:", "plate_width_m", "plate_height_m"))]
    shown = [line for line in new_file(robot).splitlines() if line.startswith("plate_")]
    assert [line.split(" = ")[0] for line in shown] == ["plate_thickness_m", "plate_corners_m", "plate_angle_deg"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0 0\n0.02; 0.06\n-0.02 0.06", "line 2: 0.02; 0.06: must be two numbers in m"),
        ("0 0\n20 60\n-20 60", "in m"),
        ("", "has 0 corners"),
    ],
)
def test_a_file_without_a_plate_is_refused(tmp_path: Path, text: str, words: str) -> None:
    plate = tmp_path / "plate.csv"
    plate.write_text(text)
    assert words in failure("init", "-", "--plate", str(plate), status=exit_codes.CONFIGURATION)


@pytest.mark.parametrize("length_m", [0.08, 0.5])
def test_depths_and_force_follow_the_geometry(length_m: float) -> None:
    robot = NewRobot(geometry=FlipperGeometry(flipper_length_m=length_m))
    assert parse_configuration(new_file(robot)).geometry.flipper_length_m == length_m


def test_the_file_has_a_default_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    output("init")
    assert [path.name for path in tmp_path.iterdir()] == ["mudskipper.toml"]


def test_every_key_has_a_meaning_and_every_number_bounds_and_a_unit() -> None:
    keys = list(configuration_keys())
    assert len(keys) > 130
    wrong = {
        f"{key.section}.{key.name}"
        for key in keys
        if not key.meaning or (key.kind in ("int", "float") and not (key.bounds and key.unit))
    }
    assert not wrong


def test_every_default_lies_within_its_bounds() -> None:
    bounded = [key for key in configuration_keys() if key.bounds and not is_required(key)]
    assert all(key.bounds and key.bounds.minimum <= key.default <= key.bounds.maximum for key in bounded)
