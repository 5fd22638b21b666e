"""The files of one run: what each carries, that no row is lost or doubled between them, and a disk that refuses."""

from __future__ import annotations

import errno
import os
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import pytest

from control.modes import Mode
from firmware_host import log_folder, log_segments
from firmware_host.log_folder import ACTIVE, DONE, first_path, log_files, unfinished_files
from firmware_host.log_parameters import ONE_FILE, LogParameters
from firmware_host.log_reader import LogError, read_log, read_logs
from firmware_host.log_segments import LogSegments
from tests.firmware_host.made_up_rows import OPENING, make_event, make_ticks

BY_TIME = replace(ONE_FILE, segment_s=1.0)


def make_segments(folder: Path, parameters: LogParameters = BY_TIME) -> LogSegments:
    return LogSegments(first_path(folder, "run"), OPENING, parameters)


def write_ticks(log: LogSegments, first: int, end: int) -> None:
    for number in range(first, end, 19):
        log.write(make_ticks(number, min(number + 19, end), Mode.WALKING))


def test_no_row_is_lost_or_doubled_at_a_border(tmp_path: Path) -> None:
    log = make_segments(tmp_path)
    write_ticks(log, 0, 1500)
    assert log.close()
    paths = log_files(tmp_path, DONE)
    assert [path.name for path in paths] == [f"run-{number:04d}.mcap" for number in range(4)]
    assert read_logs(paths).ticks["tick"].tolist() == list(range(1500))
    assert unfinished_files(tmp_path) == []


def test_a_segment_ends_by_its_size(tmp_path: Path) -> None:
    log = make_segments(tmp_path, replace(ONE_FILE, segment_bytes=100_000))
    for _ in range(5):
        log.write([make_event(os.urandom(500).hex()) for _ in range(100)])
    assert log.close()
    assert len(log_files(tmp_path, DONE)) == 5
    assert all(path.stat().st_size < 200_000 for path in log_files(tmp_path, DONE))


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
    with pytest.raises(LogError, match="not all here"):
        read_logs([first, third])
    with pytest.raises(LogError, match="not all here"):
        read_logs([fourth, fourth])


def test_a_full_disk_frees_the_oldest_log_and_counts_what_it_cost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    old = tmp_path / DONE / "old.mcap"
    old.parent.mkdir()
    old.write_bytes(b"x")
    monkeypatch.setattr(log_segments, "RETRY_S", 0.0)
    log = make_segments(tmp_path, ONE_FILE)
    log.write(make_ticks(0, 10))
    assert log._file is not None
    log._file.flush()

    write = os.write

    def full(descriptor: int, piece: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    log.write(make_ticks(10, 200))
    assert log.problem.endswith("run-0000.mcap cannot be written: No space left on device.")
    assert log.dropped == 190
    monkeypatch.setattr(os, "write", write)
    log.write(make_ticks(200, 210))
    assert (log.problem, old.exists()) == ("", False)
    assert log.close()
    capsys.readouterr()
    ours = read_log(tmp_path / DONE / "run-0001.mcap")
    assert ours.ticks["tick"].tolist() == list(range(200, 210))
    assert ours.events[0]["text"] == ("rows missing here: 190, the log could not be written: No space left on device")
    left = read_log(log_folder.present_path(tmp_path / ACTIVE / "run-0000.mcap"))
    assert left.ticks["tick"].tolist() == list(range(10))  # to the row, not to the chunk


def test_the_quota_frees_the_oldest_and_says_so(tmp_path: Path) -> None:
    (tmp_path / DONE).mkdir()
    (tmp_path / "kept").mkdir()
    for folder, name in ((DONE, "1"), (DONE, "2"), ("kept", "0")):
        (tmp_path / folder / f"{name}.mcap").write_bytes(bytes(1000))
    log = make_segments(tmp_path, replace(ONE_FILE, quota_bytes=50_000))
    log.write([make_event("first")])
    assert log.close()
    (event,) = read_log(tmp_path / DONE / "run-0000.mcap").events
    assert event["text"] == "first"
    log = LogSegments(first_path(tmp_path, "sun"), OPENING, replace(ONE_FILE, quota_bytes=4000))
    log.write([make_event("first")])
    assert log.close()
    events = [event["text"] for event in read_log(tmp_path / DONE / "sun-0000.mcap").events]
    assert "room for logs: 1.mcap was freed, 1000 bytes" in events
    assert (tmp_path / "kept" / "0.mcap").exists()


def test_thinning_is_said_in_the_log(tmp_path: Path) -> None:
    log = make_segments(tmp_path, replace(ONE_FILE, rest_hz=10.0, rest_full_s=1.0))
    log.write(make_ticks(0, 2000, Mode.IDLE))
    log.write(make_ticks(2000, 2100, Mode.ARMING))
    assert log.close()
    read = read_log(tmp_path / DONE / "run-0000.mcap")
    assert read.metadata["rest_hz"] == "10"
    assert [event["text"].split(":")[0] for event in read.events] == ["at rest", "end of the rest"]
    numbers = read.ticks["tick"].tolist()
    assert numbers == sorted(set(numbers))
    assert numbers[-480:] == list(range(1620, 2100))
