"""Two weights on a cell: the calibration that they determine, and weights that determine none."""

import json
from pathlib import Path
from random import Random

import pytest

from drivers.load_cell.calibration import (
    CalibrationError,
    LoadCellCalibration,
    calibrate,
    calibration_of_unit,
    read_calibration,
    remarks_about,
    weigh,
    write_calibration,
)


def readings(force_n: float, seed: int, drift: float = 0.0, per_newton: float = 42000.0) -> list[float]:
    random = Random(seed)
    return [81000.0 + per_newton * force_n + random.gauss(0.0, 400.0) + drift * i for i in range(160)]


def test_two_weights_determine_span_and_zero_within_their_standard_errors() -> None:
    for seed in range(20):
        light, heavy = weigh(0.5, readings(0.5, seed)), weigh(4.9, readings(4.9, seed + 100))
        reported = calibrate("counts", light, heavy)
        assert abs(reported.per_newton - 42000.0) < 4.0 * reported.per_newton_std_error
        assert abs(reported.zero - 81000.0) < 4.0 * reported.zero_std_error
        assert reported.relative_error < 0.001
        assert remarks_about(reported, light, heavy) == []


def test_a_force_is_what_was_loaded() -> None:
    reported = LoadCellCalibration("counts", -42000.0, 81000.0)
    assert reported.force_n(81000.0 - 42000.0 * 2.5) == pytest.approx(2.5)


@pytest.mark.parametrize(
    ("light", "heavy", "refused"),
    [
        ((2.0, readings(2.0, 1)), (2.0, readings(2.0, 2)), "must differ"),
        ((0.0, readings(0.0, 1)), (4.9, readings(0.0, 2)), "hardly changed"),
        ((0.0, readings(0.0, 1)), (4.9, [1.0, 2.0, 3.0]), "only 3"),
    ],
)
def test_weights_that_determine_no_span_are_refused(
    light: tuple[float, list[float]], heavy: tuple[float, list[float]], refused: str
) -> None:
    with pytest.raises(CalibrationError, match=refused):
        calibrate("counts", weigh(*light), weigh(*heavy))


def test_a_drift_is_reported() -> None:
    light, heavy = weigh(0.0, readings(0.0, 1, drift=60.0)), weigh(4.9, readings(4.9, 2, per_newton=-42000.0))
    reported = remarks_about(calibrate("counts", light, heavy), light, heavy)
    assert ["drifted by -0.112 N" in each for each in reported] == [True]


def test_a_calibration_reads_back(tmp_path: Path) -> None:
    reported = LoadCellCalibration("counts", 42000.0, 81000.0, 8.0, 30.0)
    write_calibration(tmp_path / "cell.json", reported)
    assert read_calibration(tmp_path / "cell.json") == reported


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '{"unit": "g"}',
        json.dumps(LoadCellCalibration("g", 0.0)._asdict()),
        json.dumps(LoadCellCalibration("g", 1.0)._asdict() | {"zero": "much"}),
        json.dumps(LoadCellCalibration("g", 1.0)._asdict() | {"zero": float("nan")}),
    ],
)
def test_a_file_that_is_no_calibration_is_refused_by_its_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "cell.json"
    path.write_text(text)
    with pytest.raises(CalibrationError, match="cell.json"):
        read_calibration(path)


@pytest.mark.parametrize(
    ("unit", "newtons"),
    [("N", 1.0), ("mN", 1e-3), ("kN", 1e3), ("mg", 9.80665e-6), ("g", 9.80665e-3), ("kg", 9.80665), ("lb", 4.448222)],
)
def test_an_amplifier_that_prints_a_weight_or_a_force_needs_no_weights(unit: str, newtons: float) -> None:
    reported = calibration_of_unit(unit, None)
    assert reported is not None and reported.force_n(1.0) == pytest.approx(newtons, rel=1e-6)


def test_counts_need_a_scale() -> None:
    scaled = calibration_of_unit("counts", 2.5e-5)
    assert scaled is not None and scaled.force_n(40000.0) == pytest.approx(1.0)
    assert calibration_of_unit("counts", None) is None
