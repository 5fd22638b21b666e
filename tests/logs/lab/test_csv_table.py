"""The authors' CSV is read in all its forms: heads, line ends, compression, torn rows, empty cells."""

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from logs.files.log_error import LogError
from logs.lab.csv_table import read_table
from logs.lab.findings import FindingKind
from logs.lab.lab_csv import read_lab_csv
from tests.folders import SHARED_DATA

PUBLISHED = sorted(SHARED_DATA.glob("as_published/*.csv.gz"))
NAMES = "scenario,real_time_plot,lateral_angle_range,insertion_angle"
VALUES = "turtle,True,0.6,0.03"
COLUMNS = "time,turtle_state,first,second,remark"
ROWS = [f"{number / 10},2,{number},-{number}.5e-1,mud" for number in range(6)]
WANTED = ("first", "second", "third")


def write(path: Path, *lines: str, end: str = "\n") -> Path:
    path.write_bytes("".join(line + end for line in lines).encode())
    return path


def published(path: Path, *rows: str) -> Path:
    return write(path, NAMES, VALUES, COLUMNS, *rows)


HEADS = {
    "published": (NAMES, VALUES),
    "joined": (f"# gait header: {NAMES} | {VALUES}",),
    "with an empty line": (NAMES, VALUES, ""),
    "made as long as the rows by a spreadsheet": (f"{NAMES},", f"{VALUES},", ",,,,"),
    "joined and made as long": (f"# gait header: {NAMES} | {VALUES},,",),
}


@pytest.mark.parametrize("head", HEADS.values(), ids=HEADS)
def test_settings_and_rows_are_read_under_every_head(head: tuple[str, ...], tmp_path: Path) -> None:
    table = read_table(write(tmp_path / "run.csv", *head, COLUMNS, *ROWS), WANTED)
    assert table.gait == {"lateral_angle_range": 0.6, "insertion_angle": 0.03}
    assert table.missing_settings == () and table.findings == []
    assert table.column["time"].tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert table.column["second"].tolist() == pytest.approx([-0.05, -0.15, -0.25, -0.35, -0.45, -0.55])
    assert set(table.column) == {"time", "turtle_state", "first", "second"}
    assert table.line.tolist() == [len(head) + 2 + number for number in range(6)]


@pytest.mark.parametrize("added", ["", ",,"], ids=["as written", "by a spreadsheet"])
def test_more_names_than_values_leave_every_setting_unknown(added: str, tmp_path: Path) -> None:
    """Otherwise the value of one setting would be read under the name of another."""
    head = f"{NAMES},wiggle_amplitude{added}", f"{VALUES}{added}{added[:1]}"
    table = read_table(write(tmp_path / "run.csv", *head, COLUMNS, *ROWS), WANTED)
    assert table.gait == {}
    assert table.missing_settings == ("lateral_angle_range", "insertion_angle", "wiggle_amplitude")
    assert [finding.kind for finding in table.findings] == [FindingKind.MISSING_SETTING]
    assert "5 names and 4 values" in table.findings[0].text


def test_a_setting_without_a_number_is_missing(tmp_path: Path) -> None:
    table = read_table(write(tmp_path / "run.csv", NAMES, "turtle,True,0.6,", COLUMNS, *ROWS), WANTED)
    assert table.gait == {"lateral_angle_range": 0.6} and table.missing_settings == ("insertion_angle",)
    table = read_table(write(tmp_path / "run.csv", NAMES, "turtle,True,,nan", COLUMNS, *ROWS), WANTED)
    assert table.gait == {} and table.missing_settings == ("lateral_angle_range", "insertion_angle")


@pytest.mark.parametrize("head", [(), ("some remark",), ("one", "two", "three")])
def test_a_file_without_settings_is_read(head: tuple[str, ...], tmp_path: Path) -> None:
    table = read_table(write(tmp_path / "run.csv", *head, COLUMNS, *ROWS), WANTED)
    assert len(table.line) == 6 and table.gait == {}
    assert table.missing_settings == ("lateral_angle_range", "insertion_angle")


TORN = {
    "few cells": "0.6,2,1",
    "half a number": "0.6,2,1,-1e,mud",
    "zeros of a lost block": "\0\0\0\0",
}


@pytest.mark.parametrize("row", TORN.values(), ids=TORN)
def test_a_torn_last_row_alone_is_dropped(row: str, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("\n".join([NAMES, VALUES, COLUMNS, *ROWS, row]))
    table = read_table(path, WANTED)
    assert table.column["first"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    (finding,) = table.findings
    assert finding.kind is FindingKind.TORN_ROW and finding.line == 10


def test_an_empty_cell_is_unknown_and_its_row_stays(tmp_path: Path) -> None:
    rows = [*ROWS[:2], "0.2,2, ,-0.25,mud", "0.3,2,3,,mud", "0.4,2,inf,-0.45,mud", ROWS[5]]
    table = read_table(published(tmp_path / "run.csv", *rows), WANTED)
    np.testing.assert_array_equal(table.column["first"], [0.0, 1.0, np.nan, 3.0, np.nan, 5.0])
    np.testing.assert_allclose(table.column["second"], [-0.05, -0.15, -0.25, np.nan, -0.45, -0.55], atol=1e-12)
    first, second = table.findings
    assert first[:4] == (FindingKind.EMPTY_CELL, "first", 0.2, 6) and "2 rows" in first.text
    assert second[:4] == (FindingKind.EMPTY_CELL, "second", 0.3, 7)


@pytest.mark.parametrize(("row", "column"), [(",2,2,-0.25,mud", "time"), ("0.2,,2,-0.25,mud", "turtle_state")])
def test_a_row_without_time_or_state_is_dropped(row: str, column: str, tmp_path: Path) -> None:
    table = read_table(published(tmp_path / "run.csv", *ROWS[:2], row, *ROWS[3:]), WANTED)
    assert table.column["first"].tolist() == [0.0, 1.0, 3.0, 4.0, 5.0]
    (finding,) = table.findings
    assert (finding.kind, finding.column, finding.line) == (FindingKind.ROW_DROPPED, column, 6)


def test_a_file_that_is_mostly_without_times_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="4 of 6 rows have no time"):
        read_table(published(tmp_path / "run.csv", *ROWS[:2], *[row[3:] for row in ROWS[2:]]), WANTED)


FORMS: dict[str, Callable[[str], bytes]] = {
    "carriage returns": lambda text: text.replace("\n", "\r\n").encode(),
    "doubled line ends": lambda text: text.replace("\n", "\r\r\n").encode(),
    "byte order mark": lambda text: text.encode("utf-8-sig"),
    "no last line end": lambda text: text.rstrip("\n").encode(),
    "empty lines at the end": lambda text: (text + "\n\n").encode(),
    "gzip": lambda text: gzip.compress(text.encode()),
    "quoted cells": lambda text: text.replace(",", '","').replace("\n", '"\n"').encode(),
    "semicolons": lambda text: text.replace(",", ";").encode(),
    "semicolons and decimal commas": lambda text: text.replace(",", ";").replace(".", ",").encode(),
    "tabs": lambda text: text.replace(",", "\t").encode(),
}


def test_a_compressed_file_that_expands_without_bound_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.csv.gz"
    path.write_bytes(gzip.compress(bytes(64 * 1024 * 1024)))
    with pytest.raises(LogError, match="bytes expand to more than .* 32 times its size"):
        read_table(path, WANTED)


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("name", ["run.csv", "run.csv.gz"])
def test_the_form_of_the_file_changes_nothing(form: Callable[[str], bytes], name: str, tmp_path: Path) -> None:
    plain = published(tmp_path / "plain.csv", *ROWS)
    path = tmp_path / name
    path.write_bytes(form(plain.read_text()))
    table, expected = read_table(path, WANTED), read_table(plain, WANTED)
    assert table.gait == expected.gait and table.findings == expected.findings == []
    for column in expected.column:
        np.testing.assert_array_equal(table.column[column], expected.column[column])


@pytest.mark.skipif(not PUBLISHED, reason="the shared measurements are not here")
@pytest.mark.parametrize("path", PUBLISHED, ids=lambda path: path.name[:12])
def test_published_logs_are_read_as_they_are(path: Path) -> None:
    log = read_lab_csv(path)
    rows = len(gzip.decompress(path.read_bytes()).splitlines()) - 3
    assert len(log.stamp_s) == rows and np.all(log.commanded_depth_m > 0.0)
    complete = "lateral_angle_range" in log.gait
    assert complete or (log.gait == {} and "lateral_angle_range" in log.missing_settings)
    assert complete == (not any(finding.kind is FindingKind.MISSING_SETTING for finding in log.findings))
