"""A known advance, sinking and pitch are recovered from a capture at any heading."""

import math
from pathlib import Path

import numpy as np
import pytest

from control.records import Phase
from logs.files.log_error import LogError
from logs.lab.findings import FindingKind
from logs.lab.lab_csv import LabLog
from tests.lab_logs import Columns, lab_columns, read_columns

STEP_M, HEIGHT_M = 0.011, -0.07
HEADINGS_DEG = (0.0, 35.0, 90.0, 200.0)


def posed_columns(
    sinking_m: float = 0.0, pitch_rad: float = 0.0, heading_deg: float = 0.0, strides: int = 3
) -> Columns:
    """Return a walk in which the body advances, sinks and pitches in stance; y is up, the heading is a turn about y."""
    columns = lab_columns(strides)
    stance = columns["turtle_state"] == 3
    done = np.cumsum(stance) / max(np.count_nonzero(stance), 1)
    forward_m = 3 * STEP_M * done
    heading = math.radians(heading_deg)
    columns["OptitrackPosition_x"] = 0.3 + forward_m * math.cos(heading)
    columns["OptitrackPosition_y"] = HEIGHT_M - sinking_m * done
    columns["OptitrackPosition_z"] = 0.1 - forward_m * math.sin(heading)
    pitch, yaw = pitch_rad * done / 2.0, heading / 2.0  # about the capture's z, nose up, then about y
    columns["OptitrackOrientation_x"] = math.sin(yaw) * np.sin(pitch)
    columns["OptitrackOrientation_y"] = math.sin(yaw) * np.cos(pitch)
    columns["OptitrackOrientation_z"] = math.cos(yaw) * np.sin(pitch)
    columns["OptitrackOrientation_w"] = math.cos(yaw) * np.cos(pitch)
    return columns


def advance_m(log: LabLog) -> float:
    return float(log.body_x_m[-1] - log.body_x_m[0])


@pytest.mark.parametrize("heading_deg", HEADINGS_DEG)
@pytest.mark.parametrize("sinking_m", [0.0, 0.061, -0.02])
def test_advance_height_and_pitch_are_those_of_the_body(sinking_m: float, heading_deg: float, tmp_path: Path) -> None:
    """A motion of 62 mm that consists of 11 mm of advance and 61 mm of sinking is a step of 11 mm."""
    log = read_columns(tmp_path, posed_columns(sinking_m, 0.3, heading_deg))
    assert advance_m(log) == pytest.approx(3 * STEP_M, abs=1e-6)
    assert log.body_height_m[0] == pytest.approx(HEIGHT_M)
    assert log.body_height_m[-1] - log.body_height_m[0] == pytest.approx(-sinking_m, abs=1e-6)
    assert log.body_pitch_rad[0] == pytest.approx(0.0, abs=1e-6)
    assert log.body_pitch_rad[-1] == pytest.approx(0.3, abs=1e-6)
    moved = np.abs(np.diff(log.body_x_m)) > 1e-7
    assert np.all(log.phase[1:][moved] == Phase.STANCE)


def test_a_capture_whose_z_is_up_is_read_with_its_axis(tmp_path: Path) -> None:
    columns = posed_columns(0.061)
    y, z = "OptitrackPosition_y", "OptitrackPosition_z"
    columns[y], columns[z] = -columns[z], columns[y]
    log = read_columns(tmp_path, columns, vertical="z")
    assert advance_m(log) == pytest.approx(3 * STEP_M, abs=1e-6)
    assert log.body_height_m[-1] - log.body_height_m[0] == pytest.approx(-0.061, abs=1e-6)


def test_much_sinking_and_pitch_are_reported_with_their_size(tmp_path: Path) -> None:
    log = read_columns(tmp_path, posed_columns(0.061, 0.3, 35.0))
    height, pitch = (finding for finding in log.findings if finding.kind is FindingKind.POSE)
    assert height.column == "OptitrackPosition_y" and "sinks by 61 mm" in height.text
    assert pitch.column == "OptitrackOrientation_x" and "tilts by 17°" in pitch.text and "+17°" in pitch.text


def test_stances_that_move_the_body_to_all_sides_are_reported(tmp_path: Path) -> None:
    columns = posed_columns(strides=4)
    stances = np.flatnonzero(np.diff((columns["turtle_state"] == 3).astype(int)) == 1) + 1
    forward_m = columns["OptitrackPosition_x"].copy()
    columns["OptitrackPosition_x"][stances[1] :] = 2.0 * forward_m[stances[1]] - forward_m[stances[1] :]
    (finding,) = read_columns(tmp_path, columns).findings
    assert finding.kind is FindingKind.POSE and "different horizontal directions" in finding.text


def test_a_log_with_one_coordinate_has_the_advance_alone(tmp_path: Path) -> None:
    """An export of this project contains only the position along the track."""
    columns = posed_columns()
    kept = {name: values for name, values in columns.items() if name[:9] != "Optitrack" or name.endswith("Position_x")}
    log = read_columns(tmp_path, kept)
    assert advance_m(log) == pytest.approx(3 * STEP_M, abs=1e-6)
    assert np.isnan(log.body_height_m).all() and np.isnan(log.body_pitch_rad).all()


@pytest.mark.parametrize("moved", [0.0, 1.0])
def test_one_flipper_is_on_a_fixed_base_unless_its_body_moves(moved: float, tmp_path: Path) -> None:
    columns = posed_columns()
    columns["OptitrackPosition_x"] = 0.3 + moved * (columns["OptitrackPosition_x"] - 0.3)
    assert not read_columns(tmp_path, columns).fixed_base
    for joint in ("leftsweeping", "leftadduction"):
        columns[f"{joint}_pos"] = columns[f"{joint}_curr"] = 0.0 * columns["time"]
    log = read_columns(tmp_path, columns)
    assert log.flippers == ("right",) and log.fixed_base == (not moved)


def test_positions_in_mm_are_refused(tmp_path: Path) -> None:
    columns = posed_columns()
    for axis in "xyz":
        columns[f"OptitrackPosition_{axis}"] *= 1e3
    with pytest.raises(LogError, match=r"line \d+, column OptitrackPosition_x, at .*: the body is 324 m from"):
        read_columns(tmp_path, columns)


def test_a_log_without_a_capture_has_no_pose(tmp_path: Path) -> None:
    log = read_columns(tmp_path, lab_columns())
    assert all(np.isnan(values).all() for values in (log.body_x_m, log.body_height_m, log.body_pitch_rad))
    assert log.findings == ()


def test_a_capture_that_was_lost_is_reported_once(tmp_path: Path) -> None:
    columns = posed_columns()
    for axis in "xyz":
        columns[f"OptitrackPosition_{axis}"][300:340] = 0.0
        columns[f"OptitrackPosition_{axis}"][400:420] = 0.0
    log = read_columns(tmp_path, columns)
    assert np.flatnonzero(np.isnan(log.body_x_m)).tolist() == [*range(300, 340), *range(400, 420)]
    (finding,) = log.findings
    assert finding.kind is FindingKind.POSE and finding.time_s == 1.5
    assert "lost the body for 0.29 s, in 2 periods" in finding.text
