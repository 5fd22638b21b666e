"""`mudskipper experiment loadcell` from its arguments to its report."""

import json
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from simulation.mud.clay import clay_of_water
from simulation.test_rig.emulated_instruments import AmplifierParameters, EmulatedAmplifier
from simulation.test_rig.load_cell import measure_shear
from simulation.test_rig.load_cell_bench import PAPER_PLATE
from tests.command_line.command_lines import failure, json_of, run
from tests.command_line.experiments.test_conduct import typed

pytestmark = pytest.mark.usefixtures("png_alone")

LOADCELL = ("experiment", "loadcell")
SHORT = ("--trials", "1", "--mud", "48.6")
FLIPPER = {
    "settings": {"depth_m": 0.04},
    "plate_m": {"width": 0.025, "height": 0.07, "thickness": 0.004},
    "muds": [{"mud": "48.60", "k_p": {"value": 1.1e6, "std_error": 4e4}, "k_s": {"value": None}, "k_e": 3}],
}


def found_mud(report: dict[str, Any]) -> dict[str, Any]:
    """Return the coefficients of the only mud, which are those of the simulator."""
    (found,) = report["muds"]
    for name in ("k_p", "k_s", "k_e"):
        assert found[name]["value"] == pytest.approx(report["truth"]["48.6"][name], rel=0.03)
        assert 0.0 < found[name]["std_error"] < 0.1 * found[name]["value"]
    return dict(found)


def test_a_simulated_experiment_finds_its_mud_and_compares_it_with_the_flipper_where_that_has_a_value(
    tmp_path: Path,
) -> None:
    (tmp_path / "flipper.json").write_text(json.dumps(FLIPPER))
    folder, compared = str(tmp_path / "out"), str(tmp_path / "flipper.json")
    report = json_of(*LOADCELL, "--simulated", *SHORT, "--out", folder, "--compare", compared)
    found = found_mud(report)
    shear_n = measure_shear(clay_of_water(48.6), PAPER_PLATE, 0.0, 0.0, 0.03, 0.1)
    assert report["truth"]["48.6"]["k_s"] == pytest.approx(shear_n / (0.03 * 0.03**2 / 2.0), rel=1e-3)
    ruler_error = 2.0 * 0.5 / 30.0  # of 0.5 mm in 3 cm, which the law of k_s squares
    assert found["k_s"]["shared_error"] == pytest.approx(ruler_error * found["k_s"]["value"], rel=0.01)
    (row,) = report["compared"]
    assert (row["mud"], row["coefficient"]) == ("48.6", "k_p")
    assert row["ratio"] == pytest.approx(1.1e6 / found["k_p"]["value"])
    names = {path.name for path in Path(folder).iterdir()}
    pictures = {"coefficients.png", "mud_48.6.png"}
    assert {"report.html", "summary.json", "notebook.jsonl", "calibration.json", "raw", *pictures} <= names
    assert all(Path(folder, trial["file"]).exists() for trial in report["trials"])
    page = Path(folder, "report.html").read_text()
    assert page.count("data:image/png") == 2 and "Compared with the flipper" in page


def test_a_simulated_manual_stage_with_an_encoder_finds_the_mud_as_well(tmp_path: Path) -> None:
    out = ("--seed", "3", "--out", str(tmp_path))
    report = json_of(*LOADCELL, "--simulated", *SHORT, "--position", *out)
    penetration = found_mud(report)["k_p"]
    assert all(trial["is_measured"] and trial["position"]["breaks"] == 0 for trial in report["trials"])
    assert penetration["shared_error"] < 0.015 * penetration["value"]  # no ruler measures its depth


def test_a_missing_port_of_an_encoder_is_reported(tmp_path: Path) -> None:
    cell = EmulatedAmplifier(lambda _: 0.0, AmplifierParameters(), tmp_path / "cell")
    ports = ["--port", str(tmp_path / "cell"), "--position", str(tmp_path / "none"), "--position-step", "10"]
    reported = failure(*LOADCELL, *ports, "--out", str(tmp_path / "out"), status=exit_codes.REFUSED)
    cell.close()
    assert "the stage's encoder: there is no serial port" in reported and "continue without --position" in reported


def test_a_person_practises_on_a_bench_that_obeys_the_prompts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two weights; a shear: ready, lowered, lifted; an insertion: skipped."""
    with typed(monkeypatch, "0\n500\n\n\n\ns\n"):
        ended = run(*LOADCELL, "--practise", *SHORT, "--json", "--out", str(tmp_path / "out"))
    assert ended.returncode == exit_codes.OK and "Lower the plate 3 cm" in ended.stderr and "Recording" in ended.stderr
    report = json.loads(ended.stdout)
    assert report["muds"][0]["k_s"]["value"] == pytest.approx(report["truth"]["48.6"]["k_s"], rel=0.03)
    assert list(report["left_out"]) == ["48.6/insertion/1"]
