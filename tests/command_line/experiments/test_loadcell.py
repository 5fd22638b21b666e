"""`mudskipper experiment loadcell` from its arguments to its report."""

import json
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.main import main
from simulation.mud.clay import clay_of_water
from simulation.test_rig.emulated_instruments import AmplifierParameters, EmulatedAmplifier
from simulation.test_rig.load_cell import measure_shear
from simulation.test_rig.load_cell_bench import PAPER_PLATE
from tests.command_line.experiments.test_conduct import typed

pytestmark = pytest.mark.usefixtures("png_alone")

SHORT = ["experiment", "loadcell", "--simulated", "--json", "--trials", "1", "--mud", "48.6"]
PLATE = {"width": 0.025, "height": 0.07, "thickness": 0.004}
FLIPPER = {
    "settings": {"depth_m": 0.04},
    "plate_m": PLATE,
    "muds": [{"mud": "48.60", "k_p": {"value": 1.1e6, "std_error": 4e4}, "k_s": {"value": None}, "k_e": 3}],
}


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    status = main(arguments)
    reported = capsys.readouterr()
    return status, reported.out, reported.err


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("loadcell")


@pytest.fixture(scope="module")
def report(folder: Path) -> dict[str, Any]:
    (folder / "flipper.json").write_text(json.dumps(FLIPPER))
    printed = StringIO()
    with redirect_stdout(printed):
        status = main([*SHORT, "--out", str(folder / "out"), "--compare", str(folder / "flipper.json")])
    assert status == exit_codes.OK
    reported: dict[str, Any] = json.loads(printed.getvalue())
    return reported


def test_the_measured_coefficients_of_a_simulated_mud_are_the_true_ones(report: dict[str, Any]) -> None:
    (reported,) = report["muds"]
    truth = report["truth"]["48.6"]
    for name in ("k_p", "k_s", "k_e"):
        assert reported[name]["value"] == pytest.approx(truth[name], rel=0.03)
        assert 0.0 < reported[name]["std_error"] < 0.1 * reported[name]["value"]
    shear_n = measure_shear(clay_of_water(48.6), PAPER_PLATE, 0.0, 0.0, 0.03, 0.1)
    assert truth["k_s"] == pytest.approx(shear_n / (0.03 * 0.03**2 / 2.0), rel=1e-3)


def test_a_simulated_experiment_needs_no_questions_and_leaves_a_report(report: dict[str, Any], folder: Path) -> None:
    assert report["experiment"] == "loadcell"
    names = {path.name for path in (folder / "out").iterdir()}
    pictures = {"coefficients.png", "mud_48.6.png"}
    assert {"report.html", "summary.json", "notebook.jsonl", "calibration.json", "raw", *pictures} <= names
    assert all((folder / "out" / trial["file"]).exists() for trial in report["trials"])
    page = (folder / "out" / "report.html").read_text()
    assert page.count("data:image/png") == 2 and "Compared with the flipper" in page


def test_the_flipper_is_compared_where_it_has_a_value(report: dict[str, Any]) -> None:
    (row,) = report["compared"]
    (mud,) = report["muds"]
    assert (row["mud"], row["coefficient"]) == ("48.6", "k_p")
    assert row["ratio"] == pytest.approx(1.1e6 / mud["k_p"]["value"])


def test_the_error_contains_the_part_that_all_trials_share(report: dict[str, Any]) -> None:
    (mud,) = report["muds"]
    reported = mud["k_s"]
    assert reported["shared_error"] == pytest.approx(2.0 * 0.5 / 30.0 * reported["value"], rel=0.01)
    assert reported["std_error"] == pytest.approx(
        (reported["trials_error"] ** 2 + reported["shared_error"] ** 2) ** 0.5
    )


def test_a_simulated_manual_stage_with_an_encoder_finds_the_mud_as_well(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, data, _ = run(capsys, *SHORT, "--position", "--seed", "3", "--out", str(tmp_path / "out"))
    assert status == exit_codes.OK
    report = json.loads(data)
    (reported,), truth = report["muds"], report["truth"]["48.6"]
    for name in ("k_p", "k_s", "k_e"):
        assert reported[name]["value"] == pytest.approx(truth[name], rel=0.03)
    assert all(trial["is_measured"] and trial["position"]["breaks"] == 0 for trial in report["trials"])
    assert reported["k_p"]["shared_error"] < 0.015 * reported["k_p"]["value"]  # no ruler measures its depth


def test_a_missing_port_of_an_encoder_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = EmulatedAmplifier(lambda _: 0.0, AmplifierParameters(), tmp_path / "cell")
    ports = ["--port", str(tmp_path / "cell"), "--position", str(tmp_path / "none"), "--position-step", "10"]
    status, _, reported = run(capsys, "experiment", "loadcell", *ports, "--out", str(tmp_path / "out"))
    cell.close()
    assert status == exit_codes.REFUSED
    assert "the stage's encoder: there is no serial port" in reported and "continue without --position" in reported


def test_a_person_practises_on_a_bench_that_obeys_the_prompts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two weights; a shear: ready, lowered, lifted; an insertion: skipped."""
    with typed(monkeypatch, "0\n500\n\n\n\ns\n"):
        status, data, asked = run(capsys, *SHORT[:2], "--practise", *SHORT[3:], "--out", str(tmp_path / "out"))
    report = json.loads(data)
    assert status == exit_codes.OK and "Lower the plate 3 cm" in asked and "Recording" in asked
    assert report["muds"][0]["k_s"]["value"] == pytest.approx(report["truth"]["48.6"]["k_s"], rel=0.03)
    assert list(report["left_out"]) == ["48.6/insertion/1"]
