"""Invalid logs are refused, invalid parts are left out, and both are reported with position and reason."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from firmware_host.configuration.configuration import Configuration
from logs.files.log_error import LogError
from logs.lab.findings import FindingKind
from logs.lab.lab_csv import read_lab_csv
from logs.replay import replay_files
from tests.lab_logs import JOINTS, SETTINGS, Change, Columns, lab_columns, read_columns, write_lab_log


def scaled(factor: float, part: str = "") -> Change:
    def change(columns: Columns) -> None:
        for joint in JOINTS:
            if part in joint:
                columns[f"{joint}_pos"] *= factor

    return change


def swap_right_joints(columns: Columns) -> None:
    for signal in ("pos", "curr"):
        one, other = f"rightsweeping_{signal}", f"rightadduction_{signal}"
        columns[one], columns[other] = columns[other], columns[one]


def swap_positions_and_currents(columns: Columns) -> None:
    for joint in JOINTS:
        one, other = f"{joint}_pos", f"{joint}_curr"
        columns[one], columns[other] = columns[other], columns[one]


def shifted(turns: float) -> Change:
    def change(columns: Columns) -> None:
        columns["rightadduction_pos"] += turns

    return change


REFUSED: dict[str, tuple[Change, str, str]] = {
    "radians": (scaled(math.tau), "leftsweeping_pos", "radians or degrees"),
    "one joint in radians": (scaled(math.tau, "rightadduction"), "rightadduction_pos", "radians or degrees"),
    "positions and currents": (swap_positions_and_currents, "leftsweeping_pos", "swapped"),
    "two joints": (swap_right_joints, "rightsweeping_pos", "are they swapped"),
    "an edge below the surface": (shifted(-0.05), "rightadduction_pos", "below the surface in every swing"),
    "an edge above the surface": (shifted(0.05), "rightadduction_pos", "above the surface in swing"),
    "currents in mA": (lambda columns: columns.update(leftsweeping_curr=1e3 * columns["leftsweeping_curr"]),
                       "leftsweeping_curr", "beyond ±120 A"),
}  # fmt: skip


@pytest.mark.parametrize(("change", "column", "reason"), REFUSED.values(), ids=REFUSED)
def test_a_log_in_which_every_number_is_wrong_is_refused(
    change: Change, column: str, reason: str, tmp_path: Path
) -> None:
    columns = lab_columns()
    change(columns)
    with pytest.raises(LogError, match=rf"run\.csv: line \d+, column {column}, at \d+\.\d+ s: .*{reason}"):
        replay_files([write_lab_log(tmp_path / "run.csv", columns)])


def test_the_zero_is_that_of_the_configured_geometry(configuration: Configuration, tmp_path: Path) -> None:
    columns = lab_columns()
    for joint in ("left", "right"):
        columns[f"{joint}adduction_pos"] -= 0.05
    path = write_lab_log(tmp_path / "run.csv", columns)
    with pytest.raises(LogError, match="below the surface in every swing"):
        replay_files([path])
    higher = replace(configuration, geometry=replace(configuration.geometry, axis_height_m=0.1))
    assert len(replay_files([path], higher).strides) == 6


def test_a_single_wild_sample_is_left_out(tmp_path: Path) -> None:
    columns = lab_columns()
    columns["rightsweeping_pos"][500] = 7.0
    log = read_columns(tmp_path, columns)
    assert np.flatnonzero(np.isnan(log.angle_rad[:, 2])).tolist() == [500]
    (finding,) = log.findings
    assert finding[:4] == (FindingKind.RANGE, "rightsweeping_pos", 2.5, 504)


@pytest.mark.parametrize("column", ["rightsweeping_curr", "rightsweeping_pos"])
def test_a_signal_that_hangs_is_left_out_there_alone(column: str, tmp_path: Path) -> None:
    columns = lab_columns()
    columns[column][560:660] = columns[column][560]
    log = read_columns(tmp_path, columns)
    signal = log.current_a if column.endswith("curr") else log.angle_rad
    assert np.flatnonzero(np.isnan(signal[:, 2])).tolist() == list(range(560, 660))
    assert np.count_nonzero(np.isnan(log.current_a)) + np.count_nonzero(np.isnan(log.angle_rad)) == 100
    (finding,) = log.findings
    assert finding[:4] == (FindingKind.STUCK_SIGNAL, column, 2.8, 564) and "0.50 s" in finding.text


def test_a_joint_whose_both_signals_hang_is_left_out(tmp_path: Path) -> None:
    columns = lab_columns()
    for signal in ("pos", "curr"):
        columns[f"leftsweeping_{signal}"][520:660] = columns[f"leftsweeping_{signal}"][520]
    log = read_columns(tmp_path, columns)
    assert {finding.column for finding in log.findings} == {"leftsweeping_pos", "leftsweeping_curr"}
    assert np.count_nonzero(np.isnan(log.current_a)) == 140


def saturated(columns: Columns) -> None:
    """Clip the currents at the one limit of all drives."""
    for joint in JOINTS:
        columns[f"{joint}_curr"] = np.clip(columns[f"{joint}_curr"], -6.0, 6.0)


def repeated(columns: Columns) -> None:
    """Repeat rows, which are written five times as often as the drives sample."""
    for name in columns:
        if name != "time":
            columns[name] = np.repeat(columns[name][::5], 5)[: len(columns["time"])]


def missing(columns: Columns) -> None:
    kept = np.random.default_rng(5).random(len(columns["time"])) > 0.3
    for name in columns:
        columns[name] = columns[name][kept]


@pytest.mark.parametrize("change", [saturated, repeated, missing])
def test_a_good_log_has_no_findings(change: Change, tmp_path: Path) -> None:
    columns = lab_columns()
    change(columns)
    log = read_columns(tmp_path, columns)
    assert log.findings == () and not np.isnan(log.angle_rad).any()


def test_a_flipper_that_hangs_idle_is_absent_though_its_encoder_flickers(tmp_path: Path) -> None:
    columns = lab_columns()
    for joint in JOINTS[:2]:
        columns[f"{joint}_pos"] = 0.02 + np.resize([0.0, 3e-6], len(columns["time"]))
    log = read_columns(tmp_path, columns)
    assert log.flippers == ("right",) and np.isnan(log.angle_rad[:, :2]).all()


def test_a_flipper_without_one_of_its_columns_is_reported(tmp_path: Path) -> None:
    columns = lab_columns()
    del columns["rightadduction_pos"]
    findings = read_columns(tmp_path, columns).findings
    assert [str(f) for f in findings] == [
        "there is no column rightadduction_pos, so the right flipper has no coefficients"
    ]


@pytest.mark.parametrize("every", [1, 10])
def test_the_limit_and_the_zero_are_found_at_any_rate_of_rows(every: int, tmp_path: Path) -> None:
    columns = lab_columns()
    saturated(columns)
    columns = {name: values[::every] for name, values in columns.items()}
    assert read_columns(tmp_path, columns).current_limit_a == 6.0
    shifted(-0.05)(columns)
    with pytest.raises(LogError, match="below the surface in every swing"):
        read_columns(tmp_path, columns)


def test_a_depth_beyond_the_command_is_reported(tmp_path: Path) -> None:
    columns = lab_columns()
    columns["insertiondepth"] = np.full(len(columns["time"]), 0.005)
    findings = read_columns(tmp_path, columns).findings
    assert {finding.kind for finding in findings} == {FindingKind.DEPTH}
    assert [finding.column for finding in findings] == ["leftadduction_pos", "rightadduction_pos"]


@pytest.mark.parametrize(("shift_deg", "reported"), [(-4, True), (-2, False), (0, False), (2, False), (4, True)])
def test_a_swing_of_another_height_than_the_level_arms_is_reported(
    shift_deg: float, reported: bool, tmp_path: Path
) -> None:
    """The edge is 14.5 mm above the surface in swing; 4 degrees are 8 mm."""
    columns, settings = lab_columns(), SETTINGS | {"extraction_height": "0"}
    shifted(shift_deg / 360.0)(columns)
    log = read_lab_csv(write_lab_log(tmp_path / "run.csv", columns, settings))
    assert [f.column for f in log.findings] == ["rightadduction_pos"] * reported
    assert all("wrong by 4 degrees" in f.text for f in log.findings) and not np.isnan(log.angle_rad).any()


def test_a_swing_higher_than_the_set_height_leaves_the_joint_out(tmp_path: Path) -> None:
    columns = lab_columns()
    for joint in ("left", "right"):
        columns[f"{joint}adduction_pos"] = columns[f"{joint}adduction_pos"] * 1.6
    columns["rightadduction_pos"] += 0.05
    log = read_columns(tmp_path, columns)
    assert np.isnan(log.angle_rad[:, 3]).all() and not np.isnan(log.angle_rad[:, 1]).any()
    assert any(f.kind is FindingKind.DEPTH and f.column == "rightadduction_pos" for f in log.findings)
