"""`mudskipper experiment estimation`: what it refuses, and what it prints and writes of one short trial."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest

import command_line.experiments.estimation
from command_line import exit_codes
from command_line.main import main
from experiments.estimation.boundaries import BoundaryRow
from experiments.estimation.evaluation import Outcome, Plan, evaluate, report_of
from experiments.estimation.text import estimation_text
from experiments.reports.error_table import ErrorRow, PlateRow
from simulation.mud.clay import MUDS, Clay
from tests.command_line.command_lines import refusal
from tests.waiting import LONGEST_S

COMMAND = ("experiment", "estimation", "--simulated")
SHORT = (*COMMAND, "--seeds", "1", "--setup", "single", "--mud", "49.5", "--layers", "none")
DOCUMENTED = {"setup", "mud", "coefficient", "method", "median", "p95", "coverage", "strides"}


@cache
def evaluated(plan: Plan) -> Outcome:
    return evaluate(plan, lambda done, total: None)


@pytest.fixture(autouse=True)
def one_stride(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each trial has one stride instead of two (single flipper) or eight (walk); each plan is simulated only once."""
    monkeypatch.setattr(command_line.experiments.estimation, "evaluate", lambda plan, *_: evaluated(plan))
    monkeypatch.setattr(command_line.experiments.estimation, "Plan", partial(Plan, single_strides=1, walking_strides=1))


@pytest.fixture
def no_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    def evaluate(*arguments: Any) -> None:
        raise AssertionError("it must be refused before any trial")

    monkeypatch.setattr(command_line.experiments.estimation, "evaluate", evaluate)


# refused options


REFUSED = {
    "": "--simulated",
    "--simulated --layers fog": "'fog'",
    "--simulated --layers noise,fog": "'fog'",
    "--simulated --layers none,noise": "'none'",
    **{f"--simulated --mud={percent}": "44 to 56" for percent in ("43.9", "56.1", "-1", "nan", "inf")},
    **{f"--simulated --strength={pa}": "50 to 50000 Pa" for pa in ("49", "50001", "-1", "nan", "inf")},
    "--simulated --mud wet": "--mud",
    "--simulated --strength firm": "--strength",
    "--simulated --seeds 0": "--seeds",
    "--simulated --seeds 1001": "--seeds",
    "--simulated --setup flying": "--setup",
    "--simulated --mud 49.5 --strength 1500": "--mud",
}


def test_a_wrong_option_is_refused_by_name_or_range(capsys: pytest.CaptureFixture[str], no_trials: None) -> None:
    for options, message in REFUSED.items():
        assert message in refusal(capsys, "experiment", "estimation", *options.split()), options


def test_an_impossible_output_folder_is_refused_before_the_work(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, no_trials: None
) -> None:
    (tmp_path / "file").write_text("")
    assert main([*SHORT, "--out", str(tmp_path / "file" / "below")]) == exit_codes.UNHEALTHY
    assert "file/below: Not a directory" in capsys.readouterr().err
    assert "must be a folder" in refusal(capsys, *SHORT, "--out", str(tmp_path / "file"))


# the plan


def planned(monkeypatch: pytest.MonkeyPatch, *options: str) -> Plan:
    """Return the plan that the command would have run; Ctrl-C ends it before the first trial."""
    plans = list[Plan]()

    def evaluate(plan: Plan, *arguments: Any) -> None:
        plans.append(plan)
        raise KeyboardInterrupt

    monkeypatch.setattr(command_line.experiments.estimation, "evaluate", evaluate)
    assert main([*COMMAND, *options]) == exit_codes.INTERRUPTED
    return plans[0]


def test_the_default_plan_has_all_muds_setups_and_layers(monkeypatch: pytest.MonkeyPatch) -> None:
    assert planned(monkeypatch) == Plan(single_strides=1, walking_strides=1)


def test_muds_and_setup_can_be_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = planned(monkeypatch, "--setup", "single", "--mud", "48.5", "--mud", "50", "--seeds", "3")
    assert ([clay.name for clay in plan.single], plan.walking, plan.seeds) == (["48.5", "50"], (), 3)
    assert plan.single[0].strength_pa == pytest.approx(MUDS["48.5"].strength_pa)
    plan = planned(monkeypatch, "--setup", "walking", "--strength", "1500")
    assert (plan.single, plan.walking) == ((), (Clay("1500 Pa", 1500.0),))


@pytest.mark.parametrize("layers", ["none", ""])
def test_without_layers_nothing_is_disturbed(layers: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = planned(monkeypatch, "--layers", layers)
    assert (plan.disturbances.clinging_n, plan.repeats, plan.torque) == (0.0, False, False)


# output


def test_json_is_one_object_with_the_documented_keys_and_is_written_too(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "made" / "here"
    assert main([*SHORT, "--json", "--out", str(out)]) == exit_codes.OK
    printed = capsys.readouterr()
    report = json.loads(printed.out, parse_constant=pytest.fail)  # NaN is not valid JSON
    assert printed.out.count("\n") == 1
    assert set(report) >= {"errors", "plates", "boundaries", "settings"}
    assert len(report["errors"]) == 3 * 2  # 3 coefficients, 2 methods
    for row in report["errors"]:
        assert set(row) >= DOCUMENTED
        assert (row["setup"], row["mud"], row["strides"]) == ("single flipper", "49.5", 2)
        assert 0.0 <= row["median"] <= row["p95"]
        assert 0.0 <= row["coverage"] <= 1.0
    assert json.loads((out / "summary.json").read_text(encoding="utf-8")) == report
    assert (out / "estimation.png").read_bytes().startswith(b"\x89PNG")
    assert "summary.json" in printed.err and "report.html" in printed.err


def test_the_screen_shows_errors_plates_and_boundaries(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(SHORT) == exit_codes.OK
    errors, plates, boundaries = capsys.readouterr().out.split("\n\n")
    head, *rows = errors.splitlines()
    assert head.split()[:3] == ["setup", "mud", "method"]
    assert len(rows) == 6
    assert all(row.startswith("single flipper  49.5 %") and row.count("%") >= 5 for row in rows)
    assert plates.startswith("The paper's upright plate")
    assert boundaries.strip() == "Mud boundaries: no walk over any"


def test_unknown_values_are_printed_as_dashes() -> None:
    row = ErrorRow(
        "walking", "49.5", "k_s", "default", None, None, None, None,
        strides=0, bounds=4, bounds_hold=1.0, bound_over_truth=0.8, not_valid=0, truth_n_m3=1000000,
    )  # fmt: skip
    border = BoundaryRow("49.5", "51.2", transitions=2, within_two=0.5, most_strides="never")
    plate = PlateRow("walking", "49.5", "k_s", 0.9, None, None)
    report = replace(report_of(Plan(), Outcome([], [])), errors=[row], plates=[plate], boundaries=[border])
    errors, plates, boundaries = estimation_text(report).split("\n\n")
    assert errors.splitlines()[1].split()[5:] == ["-", "-", "-", "-", "0", "4", "100.0", "%", "0"]
    assert plates.splitlines()[2].split()[4:] == ["0.900", "-", "-"]
    assert boundaries.splitlines()[2].split() == ["49.5", "%", "51.2", "%", "2", "50.0", "%", "never"]


# Ctrl-C


@pytest.mark.parametrize("seeds", ["1", "100"])
def test_ctrl_c_ends_it_at_once_and_in_silence(seeds: str) -> None:
    """All processes of a terminal get the signal, in one trial (another worker waits) and in a hundred (minutes)."""
    command = [sys.executable, "-m", "command_line.main", *COMMAND, "--setup", "walking", "--mud", "49.5"]
    command += ["--seeds", seeds, "--layers", "none"]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        wait_for_workers(run.pid)
        os.killpg(run.pid, signal.SIGINT)
        printed, complaints = run.communicate(timeout=LONGEST_S)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(run.pid, signal.SIGKILL)
    assert run.returncode == exit_codes.INTERRUPTED
    assert (printed, complaints) == ("", "")


def wait_for_workers(pid: int) -> None:
    children, deadline_s = Path(f"/proc/{pid}/task/{pid}/children"), time.monotonic() + LONGEST_S
    while not children.read_text().split() and time.monotonic() < deadline_s:
        time.sleep(0.05)
    time.sleep(0.3)  # a trial has begun
