"""`mudskipper calibrate`, from the command to the page."""

import json
from collections.abc import Mapping
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.main import main
from experiments.studies import calibrate
from experiments.study.prompt import AutomaticOperator
from firmware_host.configuration.loading import load_configuration
from tests.command_line.command_lines import failure
from tests.experiments.calibration.test_calibration import TRUE_NM_A, WeighedRobot

pytestmark = pytest.mark.usefixtures("png_alone")

COMMAND = ("calibrate", "--simulated", "--joint", "right_adduction")


def leave_the_file(_: AutomaticOperator, question: str, answers: Mapping[str, str], meanwhile: object) -> str:
    return "" if question.startswith("Write this") else next(iter(answers))


def test_one_command_finds_what_a_simulated_robot_was_built_with(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calibrate, "CalibratedRobot", WeighedRobot)  # without the minutes of the weights
    command = [*COMMAND, "--operator", "Ada", "--out", str(tmp_path)]
    with monkeypatch.context() as patch:
        patch.setattr(AutomaticOperator, "ask", leave_the_file)
        assert main(command) == exit_codes.REFUSED
    said = capsys.readouterr().out
    assert f"left as it is; the same command with --out {tmp_path} asks again. To write by hand:\ndrive." in said
    assert load_configuration(tmp_path / "mudskipper.toml").drive["right_adduction"].sign == 1
    assert main([*command, "--json"]) == exit_codes.OK
    report = json.loads(capsys.readouterr().out)
    assert report == json.loads((tmp_path / "calibration.json").read_text(encoding="utf-8"))
    (joint,), (hands,) = report["joints"], report["hands"]
    assert joint["torque_constant_nm_a"] == pytest.approx(TRUE_NM_A, rel=0.02)
    assert (report["operator"], hands["sign"]) == ("Ada", -1)  # by the robot of the default seed
    drive = load_configuration(tmp_path / "mudskipper.toml").drive["right_adduction"]
    assert drive.sign == -1 and drive.torque_constant_nm_a == round(joint["torque_constant_nm_a"], 5)
    page = (tmp_path / "calibration.html").read_text(encoding="utf-8")
    assert "by Ada" in page and "drive.right_adduction.torque_constant_nm_a" in page
    assert main(command) == exit_codes.REFUSED  # it is finished


def test_the_file_of_the_service_is_the_one_to_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "unit").write_text("ExecStart=/x --config /none/dropped_in.toml\n", encoding="utf-8")
    monkeypatch.setattr("firmware_host.configuration.service_file.UNIT", str(tmp_path / "unit"))
    assert "/none/dropped_in.toml" in failure("calibrate", "--out", str(tmp_path / "out"))


@pytest.mark.parametrize("own", [False, True])
def test_a_person_must_answer(own: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", (tmp_path / "empty").open("w+"))
    command = ["calibrate", "--practise", "--joint", "left_sweep", "--out", str(tmp_path / "out")]
    if own:  # a new file knows no watchdog of the simulated drives
        assert main(["init", "--defaults", "--drive", "odrive", str(tmp_path / "own.toml")]) == exit_codes.OK
        command += ["--config", str(tmp_path / "own.toml")]
    assert main(command) == exit_codes.REFUSED
    assert (tmp_path / "out" / "notebook.jsonl").exists()
