"""`mudskipper experiment actuator`, from the command to the report, with the prompts of its operator."""

import json
import os
import tomllib
from pathlib import Path

import pytest

from command_line import exit_codes
from experiments.actuator.configuration_change import apply_changes, find_target, fitted_changes
from experiments.actuator.fit import JointFit, fit_joint
from experiments.actuator.friction import QUICK, SLOW
from experiments.actuator.plan import WeighingPlan
from experiments.actuator.simulation import COULOMB_NM, TRUE_CONSTANT_NM_A
from experiments.robot.bench_errors import BenchError
from experiments.robot.lockstep_robot import LockstepRobot, simulated_configuration
from experiments.studies import actuator
from experiments.study.notebook import Notebook
from experiments.study.prompt import AutomaticOperator
from experiments.study.session import Ending, Session
from firmware_host.configuration.loading import load_configuration
from simulation.harness.file_recorder import FileRecorder
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track
from tests.command_line.command_lines import failure, json_of, run
from tests.command_line.experiments.test_conduct import typed
from tests.experiments.actuator.test_fit import make_entries

pytestmark = pytest.mark.usefixtures("png_alone")

ACTUATOR = ("experiment", "actuator", "--trials", "1")
SIMULATED = (*ACTUATOR, "--simulated", "--joint", "right_sweep")


def test_one_command_calibrates_a_motor_and_changes_a_copy_of_the_configuration(tmp_path: Path) -> None:
    command = (*SIMULATED, "--weights", "50,100,200,400,600", "--out", str(tmp_path))
    ended = run(*command, "--apply", "--json")
    assert ended.returncode == exit_codes.OK and "+torque_constant_nm_a" in ended.stderr
    report = json.loads(ended.stdout)
    (joint,) = report["joints"]
    assert joint["torque_constant_nm_a"] == pytest.approx(TRUE_CONSTANT_NM_A, rel=0.02)
    assert joint["torque_constant_error_nm_a"] > joint["torque_constant_tolerance_nm_a"] > 0.0
    assert joint["rmse_fitted_nm"] < joint["paper_rmse_nm"] < joint["rmse_configured_nm"]
    assert abs(joint["friction_nm"] - COULOMB_NM) < 3.0 * joint["friction_error_nm"]
    assert not report["left_out"] and not report["not_fitted"]
    written = load_configuration(tmp_path / "mudskipper.toml")
    assert written.drive["right_sweep"].torque_constant_nm_a == round(joint["torque_constant_nm_a"], 5)
    assert written.friction["right_sweep"].coulomb_nm > 0.0
    assert {path.name for path in tmp_path.iterdir()} >= {"report.html", "summary.json", "torques.png", "friction.png"}
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "true k_t (N·m/A)</th>" in page and "data:image/png;base64" in page

    # all readings exist, so only the fit runs again
    (uncertain,) = json_of(*command, "--lever-tolerance", "10")["joints"]
    assert uncertain["torque_constant_tolerance_nm_a"] == pytest.approx(0.048 * TRUE_CONSTANT_NM_A, rel=0.02)
    assert uncertain["friction_error_nm"] > joint["friction_error_nm"]
    assert "lever_m = 0.12" in failure(*command, "--lever", "10", status=exit_codes.REFUSED)


def test_weights_that_the_robot_cannot_hold_are_refused_before_anything_moves(tmp_path: Path) -> None:
    ended = run(*SIMULATED, "--weights", "100,1500", "--out", str(tmp_path))
    assert ended.returncode == exit_codes.REFUSED and "limits.torque_nm = 1.4: must be at least" in ended.stderr


def test_an_operator_at_a_terminal_is_prompted_and_may_skip_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The robot is simulated in lockstep and no weight is ever hung on it, so only the empty arm is read."""
    configuration = simulated_configuration()
    recorder = FileRecorder(tmp_path / "robot.mcap", configuration)
    robot = LockstepRobot(Lockstep(configuration, paper_track(), 1, recorder), recorder)
    monkeypatch.setattr(actuator, "DaemonRobot", lambda socket: robot)
    command = (*ACTUATOR, "--joint", "right_adduction", "--weights", "10,20")
    with typed(monkeypatch, "\n\n\ns\ns\ns\n\n"):
        ended = run(*command, "--out", str(tmp_path))
    assert ended.returncode == exit_codes.OK
    weights = ("take everything off", "hang 10 g at 12 cm", "hang 20 g", "everything", "off")
    expected, questions = ("Mount the robot", "Let go", *weights, ""), ended.stderr.split("[Enter")
    assert all(part in question for part, question in zip(expected, questions, strict=True))
    entries = Notebook(tmp_path / "right_adduction", read_plan(tmp_path / "right_adduction")).entries
    assert entries["trial 1, 10 g"] == {"skipped": "on request"}
    assert abs(entries["trial 0, 0 g"]["angle_rad"]) < 0.01
    assert [loop["quick"] for loop in entries["trial 0, 0 g"]["loops"]] == [False] * SLOW + [True] * QUICK
    assert robot.call("status")["mode"] == "idle"


def read_plan(folder: Path) -> dict[str, object]:
    first, *_ = (folder / "notebook.jsonl").read_text(encoding="utf-8").splitlines()
    plan: dict[str, object] = json.loads(first)["plan"]
    return plan


# the configuration


def apply_fit(path: Path, fit: JointFit, session: Session) -> tuple[str, Ending]:
    return apply_changes(path, fitted_changes([fit], session), session)


def make_session(folder: Path, messages: list[str]) -> Session:
    return Session(folder, AutomaticOperator(messages.append), lambda done, total: None)


def test_only_the_file_that_the_daemon_runs_with_is_changed(tmp_path: Path, example_text: str) -> None:
    path = tmp_path / "other.toml"
    path.write_text(example_text + "# edited\n", encoding="utf-8")
    with pytest.raises(BenchError, match=r"the daemon does not run with .*other.toml"):
        find_target(path, example_text, make_session(tmp_path, []))


def test_a_file_that_may_not_be_written_is_refused_before_the_work(
    tmp_path: Path, example_text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(example_text, encoding="utf-8")
    assert find_target(path, example_text, make_session(tmp_path, [])) == path
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(BenchError, match="you may not write"):
        find_target(path, example_text, make_session(tmp_path, []))


def test_an_uncertain_constant_is_not_written_and_a_good_one_is(tmp_path: Path, example_text: str) -> None:
    path, plan, reported = tmp_path / "mudskipper.toml", WeighingPlan(("right_sweep",), trials=4), list[str]()
    path.write_text(example_text, encoding="utf-8")
    uncertain, good = (
        fit_joint("right_sweep", plan, make_entries(plan, noise_a=noise), 0.083) for noise in (3.0, 0.02)
    )
    assert uncertain is not None and good is not None
    assert "needs no change" in apply_fit(path, uncertain, make_session(tmp_path, reported))[0]
    assert "is not written" in reported[0] and path.read_text(encoding="utf-8") == example_text
    sign_alone = apply_changes(path, {("drive", "left_sweep", "sign"): -1}, make_session(tmp_path, reported))[0]
    assert "is changed" in sign_alone and "own constants" not in sign_alone
    done = apply_fit(path, good, make_session(tmp_path, reported))[0]
    assert "is changed" in done and "set the drives' own constants" in done
    assert "+torque_constant_nm_a = 0.07" in reported[-1]
    written = load_configuration(path)
    assert written.drive["right_sweep"].torque_constant_nm_a == pytest.approx(0.0719, abs=0.001)
    assert written.friction["right_sweep"].coulomb_nm == pytest.approx(good.numbers["friction_nm"], abs=1e-4)
    assert written.friction["right_sweep"].viscous_nm_s == pytest.approx(good.numbers["viscous_nm_s"], abs=1e-4)


def test_a_fit_that_cannot_be_applied_is_still_reported(tmp_path: Path, example_text: str) -> None:
    """The lines fit the file; the same command would refuse to continue with another configuration."""
    plan, path = WeighingPlan(("right_sweep",), trials=4), tmp_path / "mudskipper.toml"
    path.write_text(example_text, encoding="utf-8")
    entries = {key: entry | {"current_a": 2.0 * entry["current_a"]} for key, entry in make_entries(plan).items()}
    fit = fit_joint("right_sweep", plan, entries, 0.083)
    assert fit is not None
    message, ending = apply_fit(path, fit, make_session(tmp_path, []))
    assert message.startswith("nothing was applied: the configuration stays as it is")
    assert "current_limit_a" in message and ending is Ending.REFUSED
    drive = tomllib.loads(message.partition("write by hand:\n")[2])["drive"]["right_sweep"]
    assert drive["torque_constant_nm_a"] == round(fit.numbers["torque_constant_nm_a"], 5)
