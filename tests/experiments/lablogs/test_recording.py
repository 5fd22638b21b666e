"""Each disturbance changes the columns as it claims, and mud is distinguished from air by torque."""

from pathlib import Path

import numpy as np
import pytest

from control.records import Phase, Rig
from experiments.lablogs import recording as recording_module
from experiments.lablogs.estimates import DISTURBED, RECORDED, EvaluatedLog, read_log
from experiments.lablogs.recording import read_recording, recording_of_lab
from experiments.robot.lockstep_robot import simulated_configuration
from logs.lab.columns import PAPER_CONSTANT_NM_A
from logs.lab.lab_csv import LabLog
from logs.replay import Replay, replay_files
from tests.recorded_walks import record_walks

ROW_S = 0.001


def make_lab(stance_nm: float = 0.4, swing_nm: float = 0.06, rows: int = 1000, sign: float = 1.0) -> LabLog:
    """Return two strides of the right flipper; both currents also encode the row number."""
    phase = np.resize(np.repeat([Phase.SWING, Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION], rows // 8), rows)
    torque_nm = np.select([phase == Phase.STANCE, phase == Phase.SWING], [-sign * stance_nm, swing_nm], 0.0)
    current_a = np.full((rows, 4), np.nan)
    current_a[:, 2] = torque_nm / PAPER_CONSTANT_NM_A + 1e-6 * np.arange(rows)
    current_a[:, 3] = np.arange(rows)
    angle_rad = np.full((rows, 4), np.nan)
    angle_rad[:, 2:] = 0.001 * np.arange(rows)[:, None]
    unknown = np.full(rows, np.nan)
    return LabLog(
        stamp_s=ROW_S * np.arange(rows, dtype=np.float64),
        phase=phase,
        angle_rad=angle_rad,
        current_a=current_a,
        body_x_m=unknown,
        gait={},
        flippers=("right",),
        current_limit_a=np.inf,
        commanded_depth_m=np.full(rows, 0.03),
        body_height_m=unknown,
        body_pitch_rad=unknown,
    )


@pytest.mark.parametrize("delay_s", [0.005, -0.005])
def test_a_delay_moves_the_currents_against_the_positions(delay_s: float) -> None:
    lab = make_lab()
    delayed = recording_of_lab(lab).delay_current(delay_s)
    rows = round(delay_s / ROW_S)
    inside = np.arange(10, 990)
    assert np.abs(delayed.current_a[inside, 3] - (inside - rows)).max() <= 1.0  # the stamps are rounded
    assert np.array_equal(delayed.stamp_s, lab.stamp_s)
    assert delayed.current_a[0, 3] == (0.0 if delay_s > 0.0 else 5.0)  # before it arrives the first current is held


def test_missing_rows_are_missing_in_every_column(monkeypatch: pytest.MonkeyPatch) -> None:
    lab = make_lab(rows=8000)
    thinned = recording_of_lab(lab).remove_rows(0.3, np.random.default_rng(1))
    assert thinned.rows.sum() == pytest.approx(0.7 * 8000, rel=0.03)
    replayed: list[LabLog] = []

    def replay(log: LabLog, method: str, surface_error_m: float | None) -> Replay:
        replayed.append(log)
        return Replay([], ())

    monkeypatch.setattr(recording_module, "replay_lab", replay)
    thinned.estimate_strides("default")
    kept = np.flatnonzero(thinned.rows)
    for name in ("stamp_s", "current_a", "phase", "body_x_m"):
        assert np.array_equal(getattr(replayed[0], name), getattr(lab, name)[kept], equal_nan=True)


@pytest.mark.parametrize(
    ("lab", "in_mud"),
    [
        (make_lab(stance_nm=0.4), True),
        (make_lab(stance_nm=0.4, sign=-1.0), True),  # the signs may be wrong
        (make_lab(stance_nm=0.07), False),
        (make_lab(stance_nm=0.04, swing_nm=0.0), False),  # a swing at rest
        (make_lab()._replace(phase=np.full(1000, Phase.SWING)), True),  # a log without stance is not declared air
    ],
)
def test_a_stance_that_needs_more_than_friction_is_evidence_of_mud(lab: LabLog, in_mud: bool) -> None:
    assert recording_of_lab(lab).has_evidence_of_mud() is in_mud


def test_a_log_of_a_robot_with_one_flipper_shows_its_mud(tmp_path: Path) -> None:
    record_walks(tmp_path / "one.mcap", simulated_configuration(rig=Rig(("right",))), 1)
    assert read_recording([tmp_path / "one.mcap"]).has_evidence_of_mud()


def test_a_log_without_its_end_is_a_finding(two_walks: Path, tmp_path: Path) -> None:
    (tmp_path / "cut.mcap").write_bytes(two_walks.read_bytes()[:-1000])
    assert read_recording([two_walks]).findings == ()
    (finding,) = read_recording([tmp_path / "cut.mcap"]).findings
    assert "its end is missing" in finding


def test_a_log_of_this_project_is_replayed_and_can_be_disturbed(two_walks: Path) -> None:
    recording, strides = read_recording([two_walks]), replay_files([two_walks]).strides
    assert recording.has_evidence_of_mud() and not recording.fixed_base
    assert repr(recording.estimate_strides("default")) == repr(strides)
    log = read_log([two_walks])
    assert isinstance(log, EvaluatedLog)
    starts_s = {
        run: rows["t_start_s"].tolist()
        for run, rows in log.estimates[log.estimates["method"] == "default"].groupby(["disturbance", "seed"])
    }
    assert set(starts_s) == {(RECORDED, 0), *DISTURBED}
    assert {len(each) for each in starts_s.values()} == {3 * len(strides)}
    values = log.estimates.groupby("disturbance")["value"].sum()
    assert len(set(values)) == 4  # each disturbance moves some


@pytest.mark.parametrize(("air", "in_mud"), [("two*", False), ("other*", True)])
def test_a_log_that_is_not_named_as_air_is_disturbed_whatever_its_torques(
    air: str, in_mud: bool, two_walks: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording_module.Recording, "has_evidence_of_mud", lambda recording: not in_mud)
    log = read_log([two_walks], air=[air])
    assert isinstance(log, EvaluatedLog)
    assert (log.in_mud, log.estimates["disturbance"].nunique()) == (in_mud, 4 if in_mud else 1)
