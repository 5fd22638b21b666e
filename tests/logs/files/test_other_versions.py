"""All contents of logs of other versions are read, and missing fields are marked as missing."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_line import main
from firmware_host.log.log_file import LogFile
from firmware_host.log.rows import ROW_KINDS, STRIDE, TICK
from firmware_host.log.schema import RowKind, read_definition
from logs.files.log_error import LogError
from logs.files.log_reader import Log, read_log, read_logs
from logs.files.log_summary import log_summary
from logs.recovery import recover_log
from tests.firmware_host.synthetic_rows import OPENING, encode_row
from tests.folders import ROOT

OLD_LOG = ROOT / "tests/fixtures/walk_0_1.mcap"
Change = Callable[[list[str]], list[str]]


def test_the_replay_of_a_log_of_version_0_1_gives_the_same_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.main(["replay", str(OLD_LOG), "--method", "paper", "--json"]) == 0
    replayed = json.loads(capsys.readouterr().out)
    expected = json.loads(OLD_LOG.with_name("walk_0_1_replay.json").read_text(encoding="utf-8"))
    assert without_new_keys(replayed, expected) == expected


def without_new_keys(replayed: Any, expected: Any) -> Any:
    """Return what was replayed without the keys that version 0.1 did not have."""
    if isinstance(expected, dict):
        return {name: without_new_keys(replayed[name], expected[name]) for name in expected}
    if isinstance(expected, list):
        return [without_new_keys(one, other) for one, other in zip(replayed, expected, strict=True)]
    return replayed


def test_a_log_of_version_0_1_has_all_present_fields_but_the_new_ones() -> None:
    log = read_log(OLD_LOG)
    assert log.complete and len(log.ticks) > 1000 and len(log.strides) == 6
    assert [stride["position_m"] for stride in log.strides][0] == pytest.approx(0.0001, abs=1e-4)
    assert set(log.missing_fields) <= {f"{kind.topic} {field.name}" for kind in ROW_KINDS for field in kind.fields}
    assert not log.unknown_fields


def with_extra(lines: list[str]) -> list[str]:
    return [lines[0], "float32[2] battery_v  # of a later version", *lines[1:]]


def without_some(lines: list[str]) -> list[str]:
    return [line for line in lines if not {"body_x_m", "temperature_c", "step_m"} & set(line.split())]


def in_reverse(lines: list[str]) -> list[str]:
    return lines[::-1] if "string text" not in lines[-1] else lines


def write_version(path: Path, change: Change, finish: bool = True, segment: int = 0) -> LogFile:
    """Write 300 ticks, a stride and an event with the changed fields of another version."""
    kinds = [
        RowKind(kind.topic, kind.schema_name, changed.fields, changed.definition)
        for kind in ROW_KINDS
        for changed in [read_definition(kind, "\n".join(change(kind.definition.splitlines())))]
    ]
    rows = [
        (0, encode_row(kinds[0], stamp_s=number / 380, tick=number, angle_rad=(1.0, 2.0, 3.0, 4.0)))
        for number in range(300)
    ]
    log = LogFile(path, OPENING | {"metadata": OPENING["metadata"] | {"segment": str(segment)}}, kinds)
    log.write([*rows, (1, encode_row(kinds[1], stamp_s=0.5, index=7)), (2, kinds[2].encode_named(text="walk"))])
    if finish:
        log.finish()
    else:
        log.flush()
        log._file.close()
    return log


def check_rows(log: Log) -> None:
    assert log.ticks["tick"].tolist() == list(range(300))
    assert log.ticks["angle_rad"][5].tolist() == [1.0, 2.0, 3.0, 4.0]
    assert log.ticks["stamp_s"][-1] == 299 / 380
    assert [stride["index"] for stride in log.strides] == [7] and log.events[0]["text"] == "walk"
    assert set(TICK.decode(encode_row(TICK))) <= set(log.ticks.dtype.names or ())
    assert set(STRIDE.decode(encode_row(STRIDE))) <= set(log.strides[0])


def test_an_unknown_field_is_kept_and_shown(tmp_path: Path) -> None:
    log = read_log(write_version(tmp_path / "run.mcap", with_extra).path)
    assert log.ticks["battery_v"].shape == (300, 2) and log.strides[0]["battery_v"] == (0.0, 0.0)
    assert log_summary(log)["unknown_fields"] == ["/tick battery_v", "/stride battery_v", "/event battery_v"]


def test_a_missing_field_is_nan_and_shown(tmp_path: Path) -> None:
    log = read_log(write_version(tmp_path / "run.mcap", without_some).path)
    assert np.isnan(log.ticks["body_x_m"]).all() and np.isnan(log.ticks["temperature_c"]).all()
    assert np.isnan(log.strides[0]["step_m"])
    assert log_summary(log)["missing_fields"] == ["/tick body_x_m", "/tick temperature_c", "/stride step_m"]


@pytest.mark.parametrize("change", [with_extra, without_some, in_reverse])
@pytest.mark.parametrize("damaged", [False, True])
def test_every_row_of_another_version_is_read_and_recovered_in_its_own_layout(
    tmp_path: Path, change: Change, damaged: bool
) -> None:
    path = write_version(tmp_path / "run.mcap", change, finish=damaged).path
    before = read_log(path)
    check_rows(before)
    if damaged:
        contents = bytearray(path.read_bytes())
        contents[contents.rfind(b"/tick") - 17] += 1  # makes a message of a record in the summary
        path.write_bytes(contents)
        with pytest.raises(LogError, match="damaged"):
            read_log(path)
    recovered = recover_log(path)
    log = read_log(recovered.path)
    assert (recovered.rows, recovered.lost, log.complete) == (302, 0, True)
    check_rows(log)
    assert log.unknown_fields == before.unknown_fields and log.missing_fields == before.missing_fields
    assert log.events[-1]["text"].startswith("recovered: 302 rows")


def test_segments_with_an_unknown_field_are_joined(tmp_path: Path) -> None:
    paths = [write_version(tmp_path / f"run-{n}.mcap", with_extra, segment=n).path for n in range(2)]
    assert read_logs(paths).ticks["battery_v"].shape == (600, 2)
