"""The commands of the log catalogue: `log index`, `log list` and `log query`."""

from math import inf
from pathlib import Path

import duckdb
import pytest

from command_line import exit_codes
from command_line.logs import catalogue_commands
from firmware_host.log.log_folder import DONE
from logs.catalogue.catalogue import VERSION, VERSION_KEY, catalogue_path
from tests.command_line.command_lines import failure, json_of, output, run
from tests.folders import ROOT


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / DONE).mkdir()
    (tmp_path / DONE / "walk.mcap").write_bytes((ROOT / "tests/fixtures/walk_0_1.mcap").read_bytes())
    (tmp_path / DONE / "text.mcap").write_text("no log", encoding="utf-8")
    return tmp_path


def test_the_list_knows_strides_and_reasons(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue_commands, "LISTING_READS_S", inf)  # on a busy computer the first log takes longer
    logs = {log["name"]: log for log in json_of("log", "list", str(folder))["logs"]}
    assert logs["walk.mcap"]["strides"] == 6 and logs["walk.mcap"]["started"] == "2026-11-22T14:50:21+00:00"
    assert logs["text.mcap"]["state"] == "broken" and logs["text.mcap"]["reason"]


def test_a_query_is_answered_as_text_and_as_json(folder: Path) -> None:
    query = "select file, strides, started from logs where state = 'whole'"
    assert "done/walk.mcap" in output("log", "query", query, str(folder))
    assert json_of("log", "query", query, str(folder))["rows"][0]["strides"] == 6


def test_every_value_of_sql_has_its_json(folder: Path) -> None:
    values = "'nan'::double a, ['inf'::double, 1.5] b, {'c': [date '2026-11-29']} d, map {1: 0.5::decimal(4, 2)} e"
    (row,) = json_of("log", "query", f"select {values}", str(folder))["rows"]
    assert row == {"a": None, "b": [None, 1.5], "d": {"c": ["2026-11-29"]}, "e": {"1": "0.50"}}


def test_columns_of_one_name_are_all_answered(folder: Path) -> None:
    assert json_of("log", "query", "select 1 as a, 2 as a, 3 as b", str(folder))["rows"] == [{"a": 1, "a_1": 2, "b": 3}]


def test_a_newer_catalogue_stops_a_query_and_no_listing(folder: Path) -> None:
    path = catalogue_path(folder)
    duckdb.execute(f"COPY (SELECT 1 AS x) TO '{path}' (FORMAT parquet, KV_METADATA {{{VERSION_KEY}: '{VERSION + 1}'}})")
    assert "update mudskipper" in failure("log", "query", "select 1", str(folder))
    listed = run("log", "list", str(folder))
    assert listed.returncode == exit_codes.OK
    assert "walk.mcap" in listed.stdout and "update mudskipper" in listed.stderr
