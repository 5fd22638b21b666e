"""A Parquet export has every value of a log's rows, one number or word per cell, with units."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from pandas import DatetimeIndex, read_parquet

from control.modes import Mode
from control.records import FLIPPERS, JOINTS, Phase
from firmware_host.log.rows import EVENT, STRIDE, TICK
from firmware_host.log.schema import Field, RowKind
from logs import parquet
from logs.files import log_reader
from logs.files.log_reader import Log, read_log
from logs.flat_columns import flat_columns, stack_rows
from logs.parquet import write_parquet
from tests.folders import ROOT
from tests.full_disk import files_of_at_most


@pytest.fixture(scope="module")
def log() -> Log:
    return read_log(ROOT / "tests/fixtures/walk_0_1.mcap")


def test_every_value_of_the_log_is_in_a_table(log: Log, tmp_path: Path) -> None:
    ticks, strides, events = (pq.read_table(path) for path in write_parquet(log, tmp_path, "walk"))
    for number, joint in enumerate(JOINTS):
        assert np.array_equal(ticks[f"{joint}_angle_rad"], log.ticks["angle_rad"][:, number])
    for number, flipper in enumerate(FLIPPERS):
        assert np.array_equal(ticks[f"{flipper}_force_x_n"], log.ticks["force_x_n"][:, number])
    assert ticks["mode"].to_pylist() == [Mode(mode).name.lower() for mode in log.ticks["mode"]]
    assert ticks["phase"].to_pylist() == [Phase(phase).name.lower() for phase in log.ticks["phase"]]
    assert strides["flipper"].to_pylist() == [FLIPPERS[row["flipper"]] for row in log.strides]
    assert strides["k_s"].to_pylist() == [row["k_s"] for row in log.strides]
    assert events["text"].to_pylist() == [row["text"] for row in log.events]
    cells = [field.length or 1 for field in TICK.fields]
    assert (ticks.num_columns, strides.num_columns, events.num_columns) == (sum(cells) + 1, len(STRIDE.fields) + 1, 3)


def test_every_row_has_universal_time(log: Log, tmp_path: Path) -> None:
    offset_ns = int(log.metadata["wall_minus_monotonic_ns"])
    for path in write_parquet(log, tmp_path, "walk"):
        table = pq.read_table(path)
        assert str(table.schema.field("time").type) == "timestamp[ns, tz=UTC]"
        times_ns = table["time"].cast("int64").to_numpy()
        assert times_ns.tolist() == [offset_ns + round(stamp_s * 1e9) for stamp_s in table["stamp_s"].to_pylist()]
        index = read_parquet(path).index
        assert isinstance(index, DatetimeIndex) and index.name == "time" and str(index.tz) == "UTC"
    unknown = log._replace(metadata={"wall_minus_monotonic_ns": "-1e9"})
    path = write_parquet(unknown, tmp_path, "walk")[0]
    assert "time" not in pq.read_schema(path).names and read_parquet(path).index.name is None


def test_columns_say_their_units_and_the_file_its_origin(log: Log, tmp_path: Path) -> None:
    ticks, strides, _ = (pq.read_schema(path) for path in write_parquet(log, tmp_path, "walk"))
    units = {
        "left_sweep_angle_rad": "rad",
        "right_sweep_load_nm": "N·m",
        "right_force_z_n": "N",
        "tick": "",
        "mode": "",
    }
    assert {name: ticks.field(name).metadata[b"unit"].decode() for name in units} == units
    assert strides.field("k_s").metadata[b"unit"] == strides.field("k_p_std_error").metadata[b"unit"] == b"N/m^3"
    assert strides.field("surface_std_error_m").metadata[b"unit"] == b"m"
    assert ticks.metadata[b"robot"] == b"test" and b"[robot]" in ticks.metadata[b"configuration.toml"]


def test_a_field_of_a_later_version_becomes_a_column() -> None:
    kind = RowKind("/tick", "Tick", (*EVENT.fields[:1], Field("cell_v", "float64", array=2), Field("mode", "uint8")))
    rows = stack_rows([{"stamp_s": 1.0, "cell_v": (3.1, 3.2), "mode": 200}], kind)
    columns = {column.name: column for column in flat_columns(rows, TICK)}
    assert columns["cell_v_1"].values.tolist() == [3.2]
    assert columns["mode"].coded()[1] == ["200"]


def test_tables_that_are_written_in_groups_are_the_same(
    log: Log, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = pq.read_table(write_parquet(log, tmp_path, "whole")[0])
    monkeypatch.setattr(parquet, "ROWS_PER_GROUP", 500)
    monkeypatch.setattr(log_reader.Log, "blocks", lambda self, *_: np.array_split(self.ticks, 30))
    path = write_parquet(log, tmp_path, "groups")[0]
    groups = pq.read_table(path)
    assert pq.ParquetFile(path).num_row_groups > 3
    assert groups.schema.equals(whole.schema, check_metadata=True)
    assert groups.to_pandas().equals(whole.to_pandas())


def test_a_full_disk_leaves_the_files_before(log: Log, tmp_path: Path) -> None:
    paths = write_parquet(log._replace(ticks=log.ticks[:10]), tmp_path, "walk")
    before = [path.read_bytes() for path in paths]
    with files_of_at_most(100_000), pytest.raises(OSError, match=".+"):
        write_parquet(log, tmp_path, "walk")
    assert [path.read_bytes() for path in paths] == before
    assert sorted(tmp_path.iterdir()) == sorted(paths)


def test_a_log_without_rows_has_tables_with_all_columns(log: Log, tmp_path: Path) -> None:
    empty = log._replace(ticks=log.ticks[:0], strides=[], events=[])
    ticks, strides, events = (pq.read_table(path) for path in write_parquet(empty, tmp_path, "walk"))
    assert ticks.num_rows == strides.num_rows == events.num_rows == 0
    assert {"mode", "left_sweep_angle_rad"} <= set(ticks.column_names) and "flipper" in strides.column_names
