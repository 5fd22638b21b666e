"""`mudskipper experiment trackway`, `sweep` and `mud-fit`: what they refuse, plan, print and write."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.main import main
from experiments.mud_fit import mud_fit
from experiments.study.notebook import Notebook
from experiments.sweep import sweep
from experiments.trackway import simulation
from experiments.trackway.one_mud import constant_walks
from experiments.trackway.report import ADAPTIVE
from experiments.trackway.walk import Walk, WalkedStride
from experiments.trials.session import Show
from simulation.mud.clay import MUDS
from tests.command_line.command_lines import failure, refusal

MODULES = {"trackway": simulation, "sweep": sweep, "mud-fit": mud_fit}
NAMES = list(MODULES)


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Results without --out go to a folder of the test."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def no_walks(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*arguments: Any) -> None:
        raise AssertionError("it must be refused before any walk")

    for module in MODULES.values():
        monkeypatch.setattr(module, "run", run)


# refused options


def test_a_real_trackway_needs_a_daemon(capsys: pytest.CaptureFixture[str], tmp_path: Path, no_walks: None) -> None:
    status = main(["experiment", "trackway", "--socket", str(tmp_path / "none"), "--out", str(tmp_path)])
    assert status == exit_codes.NO_DAEMON
    assert "no daemon answers" in capsys.readouterr().err


REFUSED = {
    "trackway --method paper": "--method is for --simulated",
    "trackway --mud soft --mud soft": "--mud",
    "trackway --workers 2": "--workers and --cluster are for --simulated",
    "trackway --cluster tcp://127.0.0.1:8786": "--workers and --cluster are for --simulated",
    "sweep --simulated --workers 0": "--workers",
    "sweep --simulated --workers 2 --cluster tcp://127.0.0.1:8786": "--workers",
    "trackway --compartment 0.5": "--compartment is for --simulated",
    "trackway --simulated --mud 48.5": "--mud is for a real trackway",
    "trackway --mud 48.5=5": "its length from 20 to 10000 cm",
    "sweep": "--simulated",
    "mud-fit": "--simulated",
    "trackway --simulated --method paper --method fog": "'fog': must be one of default, paper",
    "sweep --simulated --method paper --method fog": "'fog': must be one of default, paper",
    "trackway --simulated --seeds 0": "--seeds",
    "trackway --simulated --compartment 0.1": "--compartment",
    "trackway --simulated --compartment nan": "--compartment",
    "sweep --simulated --strength 49": "--strength",
    "sweep --simulated --strength firm": "--strength",
    "mud-fit --simulated --seeds 1001": "--seeds",
}


def test_a_wrong_option_is_refused_by_name_or_range(capsys: pytest.CaptureFixture[str], no_walks: None) -> None:
    for options, message in REFUSED.items():
        assert message in refusal(capsys, "experiment", *options.split()), options


@pytest.mark.parametrize("name", NAMES)
def test_an_impossible_output_folder_is_refused_before_the_work(
    name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, no_walks: None
) -> None:
    (tmp_path / "file").write_text("")
    assert "must be a folder" in refusal(capsys, "experiment", name, "--simulated", "--out", str(tmp_path / "file"))
    below = str(tmp_path / "file" / "below")
    assert "file/below: Not a directory" in failure(capsys, "experiment", name, "--simulated", "--out", below)


# the plan


def planned(monkeypatch: pytest.MonkeyPatch, name: str, *options: str) -> Any:
    """Return the plan that the command would have run; Ctrl-C ends it before the first walk."""
    plans = list[Any]()

    def run(plan: Any, *arguments: Any) -> None:
        plans.append(plan)
        raise KeyboardInterrupt

    monkeypatch.setattr(MODULES[name], "run", run)
    assert main(["experiment", name, "--simulated", *options]) == exit_codes.INTERRUPTED
    return plans[0]


@pytest.mark.parametrize("name", NAMES)
def test_the_default_plan_is_the_experiments_own(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert planned(monkeypatch, name) == MODULES[name].Plan()


def test_trials_methods_and_compartments_can_be_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    options = ("--seeds", "2", "--compartment", "1.22", "--method", "paper", "--method", "default", "--method", "paper")
    plan = planned(monkeypatch, "trackway", *options)
    assert (plan.seeds, plan.compartment_m) == (2, 1.22)
    assert [rule.name for rule in plan.rules] == ["3 cm", "5 cm", ADAPTIVE, "adaptive, default"]


def test_strengths_of_a_sweep_can_be_chosen_and_come_in_their_order(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = planned(monkeypatch, "sweep", "--strength", "3000", "--strength", "500", "--strength", "500")
    assert plan.strengths_pa == (500.0, 3000.0)
    assert planned(monkeypatch, "sweep", "--method", "paper", "--seeds", "1").methods == ("paper",)
    assert planned(monkeypatch, "mud-fit", "--seeds", "1").seeds == 1


# output


def stride(mud: str, step_m: float = 0.12) -> WalkedStride:
    return WalkedStride(mud, 1.8, 0.03, step_m, 2.0, 0.0)


def run_trackway(plan: simulation.Plan, notebook: Notebook, show: Show, *_: object) -> simulation.SimulatedReport:
    """Report 6 cm/s everywhere; one trial slips in the second stride of the second mud and ends before the third."""
    whole = Walk([stride(mud) for mud in MUDS for _ in range(4)], "")
    short = Walk([stride("48.5")] * 4 + [stride("53.1"), stride("53.1", 0.02)], "")
    walks = {rule.name: [whole] * (plan.seeds - 1) + [short] for rule in plan.rules}
    return simulation.report_of(plan, walks, {mud: {0.0275: 8.0} for mud in MUDS})


def run_sweep(plan: sweep.Plan, show: Show, *_: object) -> sweep.SweepReport:
    plan = replace(plan, depths_m=(0.03,))
    orders = plan.method_walks() + constant_walks(plan.clays(), plan.depths_m, plan.seeds)
    return sweep.report_of(plan, [(order, Walk([stride("mud")] * 4, "")) for order in orders])


def run_fit(plan: mud_fit.Plan, show: Show) -> mud_fit.MudFitReport:
    today = mud_fit.present()
    grounds = [mud_fit.Ground(today.rail_damping_n_s_m, strength_pa) for strength_pa in today.strength_pa.values()]
    return mud_fit.report_of(plan, {ground: {0.03: 7.0, 0.05: 5.0} for ground in grounds}, today)


@pytest.fixture
def synthetic(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)  # results go to a folder here unless another is named
    for module, run in ((simulation, run_trackway), (sweep, run_sweep), (mud_fit, run_fit)):
        monkeypatch.setattr(module, "run", run)


@pytest.mark.parametrize("name", NAMES)
def test_json_is_one_object_and_is_written_too(
    name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, synthetic: None
) -> None:
    out = tmp_path / "made" / "here"
    assert main(["experiment", name, "--simulated", "--json", "--out", str(out)]) == exit_codes.OK
    printed = capsys.readouterr()
    report = json.loads(printed.out, parse_constant=pytest.fail)  # NaN is not valid JSON
    assert printed.out.count("\n") == 1
    assert json.loads((out / "summary.json").read_text(encoding="utf-8")) == report
    assert "summary.json" in printed.err


def test_a_folder_with_a_report_is_refused_to_other_options_and_other_experiments(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, synthetic: None
) -> None:
    def run(name: str, *options: str) -> int:
        return main(["experiment", name, "--simulated", "--out", str(tmp_path / "out"), *options])

    assert run("sweep", "--seeds", "2") == exit_codes.OK
    before = (tmp_path / "out" / "summary.json").read_bytes()
    capsys.readouterr()
    assert run("sweep", "--seeds", "3") == exit_codes.REFUSED
    assert "--restart" in capsys.readouterr().err
    for other in ("mud-fit", "trackway"):
        assert run(other) == exit_codes.REFUSED
        assert "has the results of experiment sweep" in capsys.readouterr().err
    assert (tmp_path / "out" / "summary.json").read_bytes() == before
    assert run("sweep", "--seeds", "3", "--restart") == exit_codes.OK
    assert (tmp_path / "out-old" / "summary.json").read_bytes() == before


@pytest.mark.parametrize("name", ["trackway", "sweep"])
def test_the_walks_are_drawn(name: str, tmp_path: Path, synthetic: None) -> None:
    assert main(["experiment", name, "--simulated", "--out", str(tmp_path)]) == exit_codes.OK
    assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_a_simulated_trackway_leaves_a_page_that_says_so_also_where_no_folder_is_named(synthetic: None) -> None:
    assert main(["experiment", "trackway", "--simulated"]) == exit_codes.OK
    assert "Table I of the paper (simulated)</h1>" in Path("mudskipper-trackway/report.html").read_text("utf-8")


def test_the_trackways_json_has_its_documented_keys(capsys: pytest.CaptureFixture[str], synthetic: None) -> None:
    main(["experiment", "trackway", "--simulated", "--json"])
    report = json.loads(capsys.readouterr().out)
    assert list(report["table"]) == ["3 cm", "5 cm", "adaptive"]
    for row in report["table"].values():
        assert list(row) == ["48.5", "53.1", "45.3"]
        assert all(set(cell) >= {"mean", "sd", "failures"} for cell in row.values())
    assert report["best_constant_depth"]["48.5"] == {"depth_cm": 2.75, "mean": 8.0}


def test_the_screen_shows_table_one_next_to_the_papers(capsys: pytest.CaptureFixture[str], synthetic: None) -> None:
    main(["experiment", "trackway", "--simulated", "--seeds", "3"])
    speeds, failed, best, short = capsys.readouterr().out.split("\n\n")
    lines = [" ".join(line.split()) for line in speeds.splitlines()]
    assert lines[2] == "3 cm 6.00 ± 0.00 5.17 ± 1.44 6.00 ± 0.00 5.72"  # 53.1: 6, 6 and 3.5 (mean of two strides)
    assert lines[4] == "paper 7.6 ± 0.5, ours outside 2.1 ± 0.8, ours outside 7.2 ± 0.5, ours outside 5.63"
    assert "none of 12" in failed and "1 (0) slippage of 10" in failed
    assert "2 past the end, 1 stuck in 53.1" in failed
    assert best.splitlines()[2].split()[:3] == ["depth", "2.75", "cm"]
    assert short.strip().endswith("all counted: 3 times.")
