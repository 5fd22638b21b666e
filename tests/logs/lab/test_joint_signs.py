"""The signs of joints are found in mud and in air, and a stroke that contradicts them is named and left out."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from control.records import Phase
from logs.lab.findings import FindingKind
from logs.lab.lab_csv import LabLog, read_lab_csv
from tests.folders import SHARED_DATA
from tests.lab_logs import JOINTS, lab_columns, read_columns

AIR = sorted([*SHARED_DATA.glob("as_published/Test_Mon_*"), *SHARED_DATA.glob("as_published/_Mon_Aug_*")])


def kinds(log: LabLog) -> list[FindingKind]:
    return [finding.kind for finding in log.findings]


@cache
def straight_log(folder: Path, mud: bool) -> LabLog:
    return read_columns(folder, lab_columns(mud=mud))


@pytest.mark.parametrize("mud", [True, False], ids=["mud", "air"])
@pytest.mark.parametrize("inverted", [(1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)], ids=str)
@pytest.mark.parametrize("joint", range(4), ids=JOINTS)
def test_inverted_signals_are_inverted_back(
    joint: int, inverted: tuple[float, float], mud: bool, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """In air the arm's weight does the work of the insertion, so this work does not show the sign."""
    straight = straight_log(tmp_path_factory.getbasetemp(), mud)
    columns = lab_columns(mud=mud)
    for signal, sign in zip(("pos", "curr"), inverted, strict=True):
        columns[f"{JOINTS[joint]}_{signal}"] *= sign
    log = read_columns(tmp_path, columns)
    np.testing.assert_allclose(log.angle_rad, straight.angle_rad)
    np.testing.assert_allclose(log.current_a, straight.current_a)
    swing = straight.current_a[straight.phase == Phase.SWING]
    stance = straight.current_a[straight.phase == Phase.STANCE]
    assert np.all(np.median(swing[:, [1, 3]], axis=0) > 0.0)  # the weight of the arm
    assert np.all(np.median(stance[:, [0, 2]], axis=0) < 0.0)  # backward
    assert (FindingKind.NO_MUD in kinds(log)) is not mud
    assert FindingKind.SIGN not in kinds(log)


def test_a_stroke_with_the_wrong_sign_is_left_out_and_named(tmp_path: Path) -> None:
    columns = lab_columns(strides=4)
    stances = np.flatnonzero(np.diff((columns["turtle_state"] == 3).astype(int)) == 1) + 1
    second = slice(stances[1], stances[1] + 200)
    columns["rightsweeping_curr"][second] *= -1.0
    log = read_columns(tmp_path, columns)
    (finding,) = log.findings
    assert (finding.kind, finding.column) == (FindingKind.SIGN, "rightsweeping_curr")
    assert finding.time_s == columns["time"][second][0] and finding.line == second.start + 4
    lost = np.isnan(log.current_a)
    insertions = np.flatnonzero(np.diff((columns["turtle_state"] == 2).astype(int)) == 1) + 1
    assert np.flatnonzero(lost[:, 2]).tolist() == list(range(insertions[1], insertions[2]))
    assert not lost[:, [0, 1, 3]].any()


def test_an_arm_of_negative_weight_is_reported(tmp_path: Path) -> None:
    columns = lab_columns()
    raised = np.isin(columns["turtle_state"], (0, 1))
    columns["leftadduction_curr"][raised] *= -1.0
    log = read_columns(tmp_path, columns)
    (finding,) = log.findings
    assert (finding.kind, finding.column) == (FindingKind.SIGN, "leftadduction_curr")
    assert "negative weight" in finding.text


def test_a_flipper_held_by_mud_in_most_swings_is_in_mud(tmp_path: Path) -> None:
    columns = lab_columns(strides=4)
    swings = np.flatnonzero(columns["turtle_state"] == 1)
    columns["leftsweeping_curr"][swings[swings > 500]] += 8.0
    assert FindingKind.NO_MUD not in kinds(read_columns(tmp_path, columns))


@pytest.mark.skipif(not AIR, reason="the shared measurements are not here")
@pytest.mark.parametrize("path", AIR, ids=lambda path: path.name[:12])
def test_logs_in_air_are_known_and_their_arms_have_weight(path: Path) -> None:
    log = read_lab_csv(path)
    assert FindingKind.NO_MUD in kinds(log)
    for number in (1, 3) if len(log.flippers) == 2 else (3,):
        assert 0.3 < np.nanmedian(log.current_a[log.phase == Phase.SWING, number]) < 1.5
