"""The authors' logs are read in this project's conventions, its own logs are exported in theirs, and errors are named.

The measurements are no part of this project; they are searched next to it or in MUDSKIPPER_SHARED_DATA.
"""

import gzip
import io
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from control.records import JOINTS, Phase
from logs.files.log_error import LogError
from logs.files.log_reader import Log, read_log
from logs.lab.export import write_lab_csv
from logs.lab.findings import FindingKind
from logs.lab.lab_csv import LabLog, read_lab_csv
from logs.replay import replay_files
from tests.folders import ROOT, SHARED_DATA
from tests.lab_logs import JOINTS as LAB_JOINTS
from tests.lab_logs import lab_columns, write_lab_log

MEASURED = sorted(SHARED_DATA.glob("flipper_in_mud/*.csv.gz"))
needs_measurements = pytest.mark.skipif(not MEASURED, reason="the shared measurements are not here")
absent = [pytest.param(SHARED_DATA, marks=needs_measurements)]
measured = pytest.mark.parametrize("path", MEASURED or absent, ids=lambda path: path.name.split(".csv")[0])

SWEEPS, ADDUCTIONS = (0, 2), (1, 3)
HEAD = (
    "# gait header: scenario,insertion_angle,drag_speed | turtle,0.03,0.1\n"
    "time,turtle_state,leftadduction_pos,leftsweeping_pos,rightadduction_pos,rightsweeping_pos,"
    "leftadduction_curr,leftsweeping_curr,rightadduction_curr,rightsweeping_curr"
)
ROW = "{},2,0,0,{},0,0,0,1,0"

Numbers = NDArray[Any]


def inside(log: LabLog, phase: Phase) -> Numbers:
    """Return which steps from row to row lie within a phase."""
    steps: Numbers = (log.phase[1:] == phase) & (log.phase[:-1] == phase)
    return steps


def travel(log: LabLog, joint: int, phase: Phase) -> float:
    return float(np.sum(np.diff(log.angle_rad[:, joint])[inside(log, phase)]))


def work(log: LabLog, joint: int, phase: Phase) -> float:
    """Return the work in A·rad, positive if the motor drives the joint."""
    steps = np.diff(log.angle_rad[:, joint]) * log.current_a[1:, joint]
    return float(np.sum(steps[inside(log, phase)]))


def joints_of(log: LabLog, joints: tuple[int, int]) -> list[int]:
    return [joint for joint in joints if JOINTS[joint].split("_")[0] in log.flippers]


def write(path: Path, *lines: str) -> Path:
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def walk() -> Log:
    """Return a log of this project, in which both flippers walk after a rest and a pause."""
    log = read_log(ROOT / "tests/fixtures/walk_0_1.mcap")
    assert set(log.ticks["phase"][:100]) == {Phase.REST}
    log.ticks["phase"][50:100] = Phase.PAUSE
    return log


def export(log: Log) -> str:
    out = io.StringIO()
    write_lab_csv(log, out)
    return out.getvalue()


@measured
def test_measured_motion_has_the_signs_of_a_walk(path: Path) -> None:
    """The signs are found without the extraction, so its work confirms them."""
    log = read_lab_csv(path)
    single = path.name.startswith("single")
    present = ("right",) if single else ("left", "right")
    assert log.flippers == present and 0.03 <= log.gait["insertion_angle"] <= 0.07
    assert np.isnan(log.angle_rad).any(axis=0).tolist() == [name.split("_")[0] not in present for name in JOINTS]
    for joint in joints_of(log, ADDUCTIONS):
        assert travel(log, joint, Phase.INSERTION) < 0.0 < travel(log, joint, Phase.EXTRACTION)
        assert work(log, joint, Phase.INSERTION) > 0.0 and work(log, joint, Phase.EXTRACTION) > 0.0
    for joint in joints_of(log, SWEEPS):
        assert travel(log, joint, Phase.STANCE) < 0.0 < travel(log, joint, Phase.SWING)
        assert work(log, joint, Phase.STANCE) > 0.0
    advance_m = np.nansum(np.diff(log.body_x_m)[inside(log, Phase.STANCE)])
    assert np.isnan(log.body_x_m).all() if single else 0.005 < advance_m < 0.1


@needs_measurements
def test_most_measured_walks_of_january_sink_further_than_they_advance() -> None:
    """The capture's y is vertical, so the largest motion of these bodies is not their advance."""
    logs = [read_lab_csv(path) for path in MEASURED if path.name.startswith("walk")]
    sinking_m = [float(np.nanmax(log.body_height_m) - np.nanmin(log.body_height_m)) for log in logs]
    advance_m = [float(np.nansum(np.diff(log.body_x_m)[inside(log, Phase.STANCE)])) for log in logs]
    assert sum(down > forward for down, forward in zip(sinking_m, advance_m, strict=True)) >= 3
    assert all(any(finding.kind is FindingKind.POSE for finding in log.findings) for log in logs)


def test_an_exported_log_is_read_back(walk: Log, tmp_path: Path) -> None:
    log, ticks = read_lab_csv(write(tmp_path / "walk.csv", export(walk))), walk.ticks
    assert log.gait == {"insertion_angle": 0.03, "sweep_angle_deg": 30.0, "swing_duration_s": 0.8}  # that are numbers
    assert log.phase.tolist() == ticks["phase"].tolist()
    assert log.flippers == ("left", "right") and log.commanded_depth_m.tolist() == ticks["stride_depth_m"].tolist()
    np.testing.assert_allclose(log.stamp_s, ticks["stamp_s"] - ticks["stamp_s"][0], atol=1e-8)
    np.testing.assert_allclose(log.angle_rad, ticks["angle_rad"], rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(log.current_a, ticks["current_a"], rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(log.body_x_m, ticks["body_x_m"], rtol=1e-8, atol=1e-12)


def test_writing_keeps_the_authors_columns_and_units(walk: Log) -> None:
    settings, values, names, first, *_ = export(walk).splitlines()
    assert settings == "scenario,insertion_angle,sweep_angle_deg,swing_duration_s"
    assert values == "mudskipper,0.03,30.0,0.8"
    assert names == HEAD.splitlines()[1] + ",insertiondepth,OptitrackPosition_x"
    turns = [float(field) for field in first.split(",")[2:6]]
    assert turns == pytest.approx([-0.1246 / math.tau, 0.0, -0.1246 / math.tau, 0.0], abs=1e-5)


def test_a_log_without_a_pose_has_no_column_for_it(walk: Log) -> None:
    walk.ticks["body_x_m"] = math.nan
    assert "Optitrack" not in export(walk)


def test_an_empty_log_is_written_as_a_head(walk: Log) -> None:
    assert export(walk._replace(ticks=walk.ticks[:0])).count("\n") == 3


def test_a_configuration_that_is_not_toml_is_refused(walk: Log) -> None:
    with pytest.raises(LogError, match="the configuration in the log is not TOML"):
        export(walk._replace(configuration_text="[gait"))


def test_states_become_phases(tmp_path: Path) -> None:
    states = (-1, 0, 1, 2, 3, 4, 5, 6, 7, 8)
    rows = [f"{number / 10},{state},0,0,0,0,0,0,0,0" for number, state in enumerate(states)]
    log = read_lab_csv(write(tmp_path / "states.csv", HEAD, *rows))
    still = [Phase.PAUSE] * 4
    moving = [Phase.SWING, Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION]
    assert log.phase.tolist() == [Phase.REST, Phase.REST, *moving, *still]
    assert log.flippers == ()


@pytest.mark.parametrize(
    ("body_m", "known_m"),
    [
        ([0.8] * 10 + [0.1, 0.11, 0.12, 0.0, 0.13], [math.nan] * 10 + [0.1, 0.11, 0.12, math.nan, 0.13]),
        ([0.1] * 10 + [0.101, 0.102], [0.1] * 10 + [0.101, 0.102]),  # at rest
    ],
)
def test_a_pose_that_is_held_until_tracking_returns_and_zero_are_no_positions(
    body_m: list[float], known_m: list[float], tmp_path: Path
) -> None:
    rows = [f"{number / 10},3,0,0,0,0,0,0,0,0,{x_m},0,0" for number, x_m in enumerate(body_m)]
    head = HEAD + ",OptitrackPosition_x,OptitrackPosition_y,OptitrackPosition_z"
    log = read_lab_csv(write(tmp_path / "pose.csv", head, *rows))
    np.testing.assert_allclose(log.body_x_m, known_m)


GOOD = [ROW.format(number / 10, number / 100) for number in range(5)]
MALFORMED = {
    "nothing": ([], "none of the first 11 lines names the columns time and turtle_state"),
    "only a head": ([HEAD], "ends at line 2, which names the columns"),
    "a missing column": ([HEAD.replace("_curr", ""), *GOOD], "there is no column leftsweeping_curr"),
    "a column twice": ([f"{HEAD},time", *[f"{row},0" for row in GOOD]], "line 2 names the column time twice"),
    "a short row": ([HEAD, *GOOD, "1,2,3", *GOOD], "line 8 has 3 fields, the columns are 10"),
    "a long first row": ([HEAD, GOOD[0] + ",1", *GOOD], "line 3 has 11 fields, the columns are 10"),
    "a word": ([HEAD, *GOOD, ROW.format("mud", 0), *GOOD], "line 8: 'mud' is not a number"),
    "python's own number": ([HEAD, *GOOD, ROW.format("1_0", 0), *GOOD], "line 8: '1_0' is not a number"),
    "time backwards": ([HEAD, *GOOD[::-1]], "line 4, column time, at 0.300 s: the time runs backward by 0.100 s"),
    "times in ms": ([HEAD, *[ROW.format(10 * number, 0) for number in range(5)]], "rows are 10 s apart"),
    "unknown states": (
        [HEAD, *[row.replace(",2,", ",9,") for row in GOOD]],
        "turtle_state, at 0.000 s: the state 9 is",
    ),
}


@pytest.mark.parametrize(("lines", "reason"), MALFORMED.values(), ids=MALFORMED)
def test_a_malformed_file_is_refused_by_line(lines: list[str], reason: str, tmp_path: Path) -> None:
    path = write(tmp_path / "100%.csv", *lines)
    with pytest.raises(LogError, match=re.escape(str(path)) + ": .*" + re.escape(reason)):
        read_lab_csv(path)


def test_rows_whose_time_runs_backward_are_dropped_and_named(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", HEAD, *(ROW.format(stamp_s, 0) for stamp_s in (0.0, 0.3, 0.2, 0.3, 0.4)))
    log = read_lab_csv(path)
    assert log.stamp_s.tolist() in ([0.0, 0.2, 0.3, 0.4], [0.0, 0.3, 0.3, 0.4])
    (found,) = [finding for finding in log.findings if finding.kind is FindingKind.TIME]
    assert (found.column, found.time_s, found.line) == ("time", 0.2, 5)


def test_messages_that_each_have_a_row_of_their_own_give_the_same_estimates(tmp_path: Path) -> None:
    """A table joined from several messages has in each row the values of one of them."""
    columns = lab_columns()
    expected = replay_files([write_lab_log(tmp_path / "run.csv", columns)])
    for number, joint in enumerate(LAB_JOINTS):
        columns[f"{joint}_pos"][number // 2 :: 2] = columns[f"{joint}_curr"][number // 2 :: 2] = math.nan
    joined = replay_files([write_lab_log(tmp_path / "run.csv", columns)])
    assert joined.flippers == ("left", "right")
    assert {finding.kind for finding in joined.findings} == {FindingKind.EMPTY_CELL}
    for stride, same in zip(expected.strides, joined.strides, strict=True):
        assert (stride.k_s.valid, stride.stance) == (same.k_s.valid, same.stance)
        assert same.k_s.value == pytest.approx(stride.k_s.value, abs=stride.k_s.repeatability)


def test_an_empty_cell_has_the_value_before_for_50_ms(tmp_path: Path) -> None:
    cells = {0.0: "", 0.01: "0.1", 0.02: "", 0.05: "", 0.0601: "", 0.07: "0.2"}
    log = read_lab_csv(write(tmp_path / "run.csv", HEAD, *(ROW.format(*cell) for cell in cells.items())))
    turns = [math.nan, 0.1, 0.1, 0.1, math.nan, 0.2]
    np.testing.assert_allclose(log.angle_rad[:, 3] / math.tau, turns)


@pytest.mark.parametrize("state", ["9", "2.5"])
def test_a_state_that_is_not_known_is_a_pause(state: str, tmp_path: Path) -> None:
    log = read_lab_csv(write(tmp_path / "run.csv", HEAD, *GOOD, GOOD[-1].replace(",2,", f",{state},")))
    assert log.phase.tolist() == [Phase.INSERTION] * 5 + [Phase.PAUSE]
    assert [(f.column, f.line) for f in log.findings if f.kind is FindingKind.UNKNOWN_STATE] == [("turtle_state", 8)]


def test_bytes_that_are_no_text_are_named_by_line(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes("\n".join([HEAD, GOOD[0]]).encode() + b"\n0.1,\xff\n")
    with pytest.raises(LogError, match="line 4 is not text"):
        read_lab_csv(path)


def test_a_broken_off_archive_names_the_last_good_line(tmp_path: Path) -> None:
    chance = np.random.default_rng(4)
    rows = [ROW.format(number / 10, noise / 10) for number, noise in enumerate(chance.random(5000))]
    packed = gzip.compress("\n".join([HEAD, *rows]).encode())
    path = tmp_path / "run.csv.gz"
    path.write_bytes(packed)
    assert len(read_lab_csv(path).stamp_s) == 5000
    path.write_bytes(packed[: len(packed) // 2])
    with pytest.raises(LogError, match=r"run\.csv\.gz: .* is damaged after line \d+$") as refusal:
        read_lab_csv(path)
    assert 2000 < int(str(refusal.value).split()[-1]) < 3000
