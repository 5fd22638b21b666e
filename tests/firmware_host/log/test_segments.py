"""The files of one run: each is complete, no row is lost or doubled between them, and a full disk is handled."""

import errno
import os
import shutil
import subprocess
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace

import pytest

from control.modes import Mode
from firmware_host.configuration.log_parameters import ONE_FILE, LogParameters
from firmware_host.log import log_file, log_folder
from firmware_host.log import segments as log_segments
from firmware_host.log.log_folder import ACTIVE, DONE, first_path, log_files, unfinished_files
from firmware_host.log.segments import LogSegments
from firmware_host.trial import BEGUN, SET, OperatorReport, from_json, load_defaults, to_json
from logs.files.log_error import LogError
from logs.files.log_reader import read_log, read_logs
from logs.files.log_summary import operator_reports
from logs.files.stored_logs import run_files
from tests.firmware_host.synthetic_rows import OPENING, make_event, make_ticks

BY_TIME = replace(ONE_FILE, segment_s=1.0)


def make_segments(folder: Path, parameters: LogParameters = BY_TIME) -> LogSegments:
    return LogSegments(first_path(folder, "run"), OPENING, parameters)


def write_ticks(log: LogSegments, first: int, end: int, rows_at_once: int = 19, mode: Mode = Mode.WALKING) -> None:
    for number in range(first, end, rows_at_once):
        log.write(make_ticks(number, min(number + rows_at_once, end), mode))


@pytest.mark.parametrize(("rows_at_once", "files"), [(19, 4), (100, 5)])
def test_segments_are_as_long_as_configured_and_no_row_is_lost_or_doubled_at_a_border(
    tmp_path: Path, rows_at_once: int, files: int
) -> None:
    log = make_segments(tmp_path)
    write_ticks(log, 0, 1500, rows_at_once)
    assert log.close()
    paths = log_files(tmp_path, DONE)
    assert [path.name for path in paths] == [f"run-{number:04d}.mcap" for number in range(files)]
    assert read_logs(paths).ticks["tick"].tolist() == list(range(1500))
    assert unfinished_files(tmp_path) == []
    stamps_s = [read_log(path).ticks["stamp_s"] for path in paths]
    assert max(each[-1] - each[0] for each in stamps_s) < BY_TIME.segment_s


def test_a_segment_ends_by_its_size(tmp_path: Path) -> None:
    log = make_segments(tmp_path, replace(ONE_FILE, segment_bytes=100_000))
    for _ in range(5):
        log.write([make_event(os.urandom(500).hex()) for _ in range(100)])
    assert log.close()
    assert len(log_files(tmp_path, DONE)) == 5
    assert all(path.stat().st_size < 200_000 for path in log_files(tmp_path, DONE))


def make_report(kind: str, trial: dict[str, str], tick: int = 0) -> tuple[int, bytes]:
    return make_event(OperatorReport(kind, datetime.now(UTC), "uid 0", to_json(trial)).event, tick / 380)


@pytest.mark.parametrize("rest_hz", [10.0, 0.0])
def test_a_trial_begins_a_file_with_its_name_and_ends_with_the_next_one_or_in_rest(
    tmp_path: Path, rest_hz: float
) -> None:
    log = make_segments(tmp_path, replace(BY_TIME, rest_hz=rest_hz, rest_full_s=0.5))
    trials = [{"mud": "../A", "trial": "3", "note": "rain"}, {"mud": "грязь"}, {}, {"mud": "B"}]
    first = 0
    for trial, ticks in zip(trials, (500, 100, 100, 100), strict=True):
        log.write([*make_ticks(first, first + 10, Mode.HOLD), make_report(BEGUN, trial, first + 10)])
        write_ticks(log, first + 10, first + ticks)
        first += ticks
    write_ticks(log, first, first + 600, mode=Mode.IDLE)
    assert log.close()
    logs = [(path.stem, from_json(read_log(path).metadata.get("trial", ""))) for path in log_files(tmp_path, DONE)]
    named, letters, nothing, last = trials
    assert logs == [
        ("run-0000", {}),
        ("run-0001_A_3", named),
        ("run-0002_A_3", named),  # it was long
        ("run-0003", letters),
        ("run-0004", nothing),
        ("run-0005_B", last),
        ("run-0006", {}),
    ]
    events = [read_log(path).events for path in log_files(tmp_path, DONE)]
    begun = [[report.text for _, report in operator_reports(each)] for each in events]
    assert begun == [[], [to_json(named)], [], [to_json(letters)], [to_json(nothing)], [to_json(last)], []]
    assert run_files(tmp_path / DONE / "run-0003.mcap") == log_files(tmp_path, DONE)
    assert read_logs(log_files(tmp_path, DONE)).metadata.get("trial") is None
    assert read_logs(log_files(tmp_path, DONE)[1:3]).metadata["trial"] == to_json(named)


def test_the_last_seconds_of_a_rest_are_complete(tmp_path: Path) -> None:
    log = make_segments(tmp_path, replace(ONE_FILE, rest_hz=10.0, rest_full_s=0.5))
    log.write(make_ticks(0, 1000, Mode.IDLE))
    assert log.close()
    assert read_log(tmp_path / DONE / "run-0000.mcap").ticks["tick"][-190:].tolist() == list(range(810, 1000))


def test_a_finished_log_is_not_written_over(tmp_path: Path) -> None:
    (tmp_path / DONE).mkdir()
    (tmp_path / DONE / "run-0000.mcap").write_text("precious")
    log = make_segments(tmp_path, ONE_FILE)
    log.write(make_ticks(0, 10))
    assert log.close() and log.path.name == "run-0001.mcap"
    assert (tmp_path / DONE / "run-0000.mcap").read_text() == "precious"


def test_the_defaults_of_trials_are_stored_and_damaged_ones_are_no_defaults(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, durable = make_segments(tmp_path), list[Path]()
    monkeypatch.setattr(os, "fsync", lambda number: durable.append(Path(f"/proc/self/fd/{number}").readlink()))
    log.write([make_report(SET, {"mud": "A"}), make_report(SET, {"mud": "B", "plate": "flat"})])
    assert durable == [tmp_path / ".trial.json", tmp_path] * 2  # the contents, then the name
    assert load_defaults(tmp_path) == {"mud": "B", "plate": "flat"}
    for text in ("", "[1]", '{"mud": 1}', '{"Mud": "A"}', "\0", '{"mud": "a\\nb"}'):
        (tmp_path / "trial.json").write_text(text)
        assert load_defaults(tmp_path) == {}
    assert log.close() and len(log_files(tmp_path, DONE)) == 1


def test_every_segment_says_what_it_belongs_to_and_reads_alone(tmp_path: Path) -> None:
    log = make_segments(tmp_path)
    write_ticks(log, 0, 500)
    assert log.close()
    for number, path in enumerate(log_files(tmp_path, DONE)):
        alone = read_log(path)
        assert alone.complete and alone.configuration_text == "[robot]\n"
        assert alone.metadata["segment"] == str(number)
        assert (alone.metadata["robot"], alone.metadata["run_id"]) == ("mudskipper-1", "run")
        assert alone.metadata["configuration_sha256"] == sha256(b"[robot]\n").hexdigest()
        assert set(alone.metadata) >= {"host", "kernel", "started", "wall_minus_monotonic_ns", "rest_hz"}


def test_segments_of_a_run_are_joined_only_if_they_are_all_there(tmp_path: Path) -> None:
    log = make_segments(tmp_path)
    write_ticks(log, 0, 1500)
    assert log.close()
    first, second, third, fourth = log_files(tmp_path, DONE)
    assert len(read_logs([third, second]).ticks) == len(read_log(second).ticks) + len(read_log(third).ticks)
    with pytest.raises(LogError, match="segments 0 to 3 of its run are not all here, each once: 1, 2 missing"):
        read_logs([first, fourth])
    with pytest.raises(LogError, match="3 given twice"):
        read_logs([fourth, fourth])


def make_old_logs(folder: Path, count: int = 2) -> list[Path]:
    paths = [folder / DONE / f"{number}.mcap" for number in range(1, count + 1)]
    paths[0].parent.mkdir()
    for path in paths:
        path.write_bytes(bytes(5000))
    return paths


def full(descriptor: int, piece: bytes) -> int:
    """Replaces os.write by that of a full disk."""
    raise OSError(errno.ENOSPC, "No space left on device")


def broken(descriptor: int, piece: bytes) -> int:
    raise OSError(errno.EIO, "Input/output error")


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the writer flush, synchronise and try again at every call."""
    monkeypatch.setattr(log_segments, "RETRY_S", 0.0)
    monkeypatch.setattr(log_file, "SYNC_INTERVAL_S", 0.0)
    monkeypatch.setattr(log_file, "FLUSH_INTERVAL_S", 0.0)


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize(("write", "quota_bytes", "deleted"), [(full, 0, 0), (full, 10**9, 1), (broken, 10**9, 0)])
def test_a_full_disk_frees_nothing_where_nothing_may_be_freed_and_stops_where_it_does_not_help(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    write: Callable[[int, bytes], int],
    quota_bytes: int,
    deleted: int,
) -> None:
    """Another program uses the freed space, or a second link keeps the deleted file."""
    old = make_old_logs(tmp_path, 5)
    (old[0].parent / "0.mcap").mkdir()  # the oldest, which cannot be deleted
    log = make_segments(tmp_path, replace(ONE_FILE, quota_bytes=quota_bytes))
    monkeypatch.setattr(log_segments, "free_space", lambda folder: log_folder.FreeSpace(0.0, 0))
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", write)
        for number in range(5):
            log.write(make_ticks(100 * number, 100 * number + 190))
    assert log.problem and [path.exists() for path in old] == [False] * deleted + [True] * (5 - deleted)


@pytest.mark.parametrize("disk_s", [0.0, 0.7, 4.0])
def test_a_power_cut_costs_a_second_and_what_the_disk_needs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, disk_s: float
) -> None:
    """Each synchronisation takes `disk_s`, and a cut before its end leaves what the one before has synchronised."""
    now_s, lengths, ages_s = 0.0, [0], list[float]()

    def synchronise(descriptor: int) -> None:
        nonlocal now_s
        now_s += disk_s
        if written:
            ages_s.append(now_s - log.durable_stamp_s)
            lengths.append(os.fstat(descriptor).st_size)

    written = 0
    monkeypatch.setattr(log_file, "time", SimpleNamespace(monotonic=lambda: now_s, time_ns=time.time_ns))
    monkeypatch.setattr(os, "fsync", synchronise)
    log = make_segments(tmp_path, ONE_FILE)
    log.write(make_ticks(0, 1))
    while now_s < 30.0:
        now_s += 0.05
        come = int(380 * now_s)
        log.write(make_ticks(written, come, Mode.WALKING))
        written = come
    assert max(ages_s[1:]) < max(1.0, disk_s) + disk_s + 0.1  # rows are gathered for 0.05 s
    left = tmp_path / "left.mcap"
    left.write_bytes(log.path.read_bytes()[: lengths[-1]])
    assert read_log(left).ticks["stamp_s"][-1] == log.durable_stamp_s


def test_a_log_is_whole_on_the_disk_before_it_is_in_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synchronised, moved, rename = {}, [], Path.rename

    def synchronise(descriptor: int) -> None:
        status = os.fstat(descriptor)
        synchronised[status.st_ino] = status.st_size

    def move(path: Path, target: Path) -> Path:
        moved.append(synchronised[path.stat().st_ino] == path.stat().st_size)
        return rename(path, target)

    monkeypatch.setattr(os, "fsync", synchronise)
    monkeypatch.setattr(Path, "rename", move)
    log = make_segments(tmp_path, ONE_FILE)
    write_ticks(log, 0, 100)
    assert log.close() and moved == [True]


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("removed", [ACTIVE, "."])
def test_a_log_removed_under_the_writer_is_noticed(tmp_path: Path, removed: str) -> None:
    folder = tmp_path / "logs"
    log = make_segments(folder, ONE_FILE)
    log.write(make_ticks(0, 100))
    shutil.rmtree(folder / removed)
    log.write(make_ticks(100, 200))
    assert log.problem.endswith("run-0000.mcap: it was removed or moved away.")
    assert log.dropped == 200
    log.write(make_ticks(200, 300))
    assert log.close()
    (path,) = log_files(folder, DONE)
    read = read_log(path)
    assert read.ticks["tick"].tolist() == list(range(200, 300))
    assert read.events[0]["text"].startswith("rows missing here: 200, ")


@pytest.mark.usefixtures("at_once")
def test_a_log_moved_away_keeps_its_rows_and_a_file_at_its_path_is_left_alone(tmp_path: Path) -> None:
    log = make_segments(tmp_path, ONE_FILE)
    log.write(make_ticks(0, 100))
    (tmp_path / ACTIVE / "run-0000.mcap").rename(tmp_path / "elsewhere")
    (tmp_path / ACTIVE / "run-0000.mcap").write_text("somebody's")
    log.write(make_ticks(100, 200))
    assert log.problem and log.dropped == 0
    log.write(make_ticks(200, 300))
    assert (tmp_path / ACTIVE / "run-0000.mcap").read_text() == "somebody's"
    assert len(read_log(tmp_path / "elsewhere").ticks) == 200
    log.close()


def test_what_resists_recovery_is_tried_once_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / ACTIVE).mkdir()
    (tmp_path / ACTIVE / "junk.mcap").write_text("junk")
    started: list[list[str]] = []

    class Ended:
        def __init__(self, command: list[str], **_: object) -> None:
            started.append(command)

        def poll(self) -> int:
            return 0

    monkeypatch.setattr(subprocess, "Popen", Ended)
    log = make_segments(tmp_path)
    write_ticks(log, 0, 1500)
    assert log.close()
    assert len(log_files(tmp_path, DONE)) == 4 and len(started) == 1


def test_a_full_disk_frees_the_oldest_log_and_counts_what_it_cost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    old, newest = make_old_logs(tmp_path)
    monkeypatch.setattr(log_segments, "RETRY_S", 0.0)
    log = make_segments(tmp_path, replace(ONE_FILE, quota_bytes=10**9))
    log.write(make_ticks(0, 10))
    assert log._file is not None
    log._file.flush()

    write = os.write
    monkeypatch.setattr(os, "write", full)
    log.write(make_ticks(10, 200))
    assert log.problem.endswith("run-0000.mcap: No space left on device.")
    assert log.dropped == 190
    monkeypatch.setattr(os, "write", write)
    log.write(make_ticks(200, 210))
    assert (log.problem, old.exists(), newest.exists()) == ("", False, True)
    log.write([make_report(BEGUN, {})])
    assert log.close()
    capsys.readouterr()
    assert len(read_log(tmp_path / DONE / "run-0002.mcap").events) == 1  # which misses nothing
    ours = read_log(tmp_path / DONE / "run-0001.mcap")
    assert ours.ticks["tick"].tolist() == list(range(200, 210))
    assert [event["text"] for event in ours.events] == [
        "room for logs: 1.mcap was deleted, 5000 bytes, not copied",
        "rows missing here: 190, the log could not be written: No space left on device",
    ]
    left = read_log(log_folder.present_path(tmp_path / ACTIVE / "run-0000.mcap"))
    assert left.ticks["tick"].tolist() == list(range(10))  # complete to the last row, not only to the last chunk


def test_a_log_deleted_while_the_disk_refuses_is_reported_and_is_no_missing_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_old_logs(tmp_path)
    monkeypatch.setattr(log_segments, "RETRY_S", 0.0)
    monkeypatch.setattr(log_segments, "QUOTA_INTERVAL_S", 0.0)
    log = make_segments(tmp_path, replace(ONE_FILE, quota_bytes=9000))
    with monkeypatch.context() as patch:
        patch.setattr(log_file, "FLUSH_INTERVAL_S", 0.0)
        patch.setattr(os, "write", full)
        log.write(make_ticks(0, 10))
    assert log.dropped == 10
    assert log.close()
    events = [event["text"] for event in read_log(tmp_path / DONE / "run-0000.mcap").events]
    assert events == [
        "room for logs: 1.mcap was deleted, 5000 bytes, not copied",
        "rows missing here: 10, the log could not be written: No space left on device",
    ]


def test_the_quota_frees_the_oldest_and_says_so(tmp_path: Path) -> None:
    make_old_logs(tmp_path)
    log = make_segments(tmp_path, replace(ONE_FILE, quota_bytes=9000))
    log.write([make_event("first")])
    assert log.close()
    events = [event["text"] for event in read_log(tmp_path / DONE / "run-0000.mcap").events]
    assert "room for logs: 1.mcap was deleted, 5000 bytes, not copied" in events
