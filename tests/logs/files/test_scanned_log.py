"""Logs of any length: read in blocks, in order, in little memory, and refused if cut off meanwhile."""

import os
import random
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from firmware_host.log.log_file import LogFile
from firmware_host.log.rows import TICK, TICK_KIND
from firmware_host.trial import METADATA_KEY, Trial, to_json
from logs.files import scanned_log
from logs.files.log_error import LogError
from logs.files.log_reader import read_logs
from logs.files.log_summary import log_summary, trial_of
from logs.files.scanned_log import scan_log, scan_logs
from logs.recovery import recover_log
from tests.firmware_host.synthetic_rows import OPENING, encode_row

TICKS = 3000
POND: Trial = {"mud": "pond"}


def write_ticks(path: Path, numbers: list[int], segment: int = 0) -> Path:
    log = LogFile(path, OPENING | {"metadata": OPENING["metadata"] | {"segment": str(segment)}})
    rows = (encode_row(TICK, stamp_s=number / 380, tick=number, body_x_m=place) for place, number in enumerate(numbers))
    log.write([(TICK_KIND, row) for row in rows])
    log.finish()
    return path


def held_back(count: int, farthest: int, seed: int = 1) -> list[int]:
    """Tick numbers of which some follow later ones, as after a rest; two ticks have one number."""
    chance = random.Random(seed)
    numbers = sorted(range(count), key=lambda number: number + chance.choice((0, 0, 0, farthest)))
    return [*numbers, numbers[-1]]


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scanned_log, "BLOCK_ROWS", 300)


@pytest.mark.parametrize("farthest", [0, 1, 40, 5000])
def test_blocks_are_the_ticks_in_the_order_of_their_numbers(tmp_path: Path, farthest: int) -> None:
    numbers = held_back(TICKS, farthest)
    log = scan_log(write_ticks(tmp_path / "run.mcap", numbers))
    blocks = list(log.blocks())
    order = np.argsort(numbers, kind="stable")
    read = np.concatenate([np.stack([block["tick"], block["body_x_m"]]) for block in blocks], axis=1)
    assert read.T.tolist() == np.stack([np.array(numbers)[order], order]).T.tolist()
    assert log.tally.farthest <= farthest and log.rows == len(numbers)
    if farthest < TICKS:  # no block waits for the end of the log
        assert max(map(len, blocks)) <= 2 * (300 + 180) + farthest


@pytest.mark.parametrize(
    ("described", "joined"), [((POND, POND, {}), POND), ((POND, POND | {"note": "rain"}), {}), (({}, POND), {})]
)
def test_a_trial_keeps_its_description_when_it_is_joined_with_the_rest_after_it(
    tmp_path: Path, described: tuple[Trial, ...], joined: Trial
) -> None:
    paths = [tmp_path / f"run-{number}.mcap" for number in range(len(described))]
    for number, (path, trial) in enumerate(zip(paths, described, strict=True)):
        of_trial = {METADATA_KEY: to_json(trial)} if trial else {}
        LogFile(path, OPENING | {"metadata": {"run_id": "run", "segment": str(number)} | of_trial}).finish()
    assert trial_of(scan_logs(paths)) == joined


def test_a_run_with_a_recovered_segment_was_recovered(tmp_path: Path) -> None:
    paths = [write_ticks(tmp_path / f"run-{n}.mcap", [n], segment=n) for n in range(2)]
    assert log_summary(scan_logs(paths))["recovered"] is False
    paths[1].write_bytes(paths[1].read_bytes()[:-40])
    recover_log(paths[1])
    assert log_summary(scan_logs(paths))["recovered"] is True


def test_segments_are_read_one_after_the_other_and_ticks_between_them_are_sorted(tmp_path: Path) -> None:
    numbers = held_back(TICKS, 100)
    halves = [numbers[: TICKS // 2], numbers[TICKS // 2 :]]
    paths = [write_ticks(tmp_path / f"{number}.mcap", half, number) for number, half in enumerate(halves)]
    log = scan_logs(paths[::-1])
    assert [tick for block in log.blocks() for tick in block["tick"].tolist()] == sorted(numbers)
    assert log_summary(log) == log_summary(read_logs(paths))
    assert log.ends["tick"].tolist() == [0, TICKS - 1]


def peak_bytes(do: Callable[[], object]) -> int:
    tracemalloc.start()
    try:
        do()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_the_memory_of_a_pass_does_not_depend_on_the_length_of_the_log(tmp_path: Path) -> None:
    """1.1 times as much for ten times the ticks, measured; a whole log would take ten times as much."""
    short, long = (write_ticks(tmp_path / f"{count}.mcap", list(range(count))) for count in (2000, 20_000))

    def read(path: Path) -> int:
        return sum(map(len, scan_log(path).blocks()))

    assert (read(short), read(long)) == (2000, 20_000)
    assert peak_bytes(lambda: read(long)) < 1.5 * peak_bytes(lambda: read(short))


def test_a_file_that_is_cut_between_two_passes_is_refused(tmp_path: Path) -> None:
    path = write_ticks(tmp_path / "run.mcap", list(range(TICKS)))
    log = scan_log(path)
    os.truncate(path, path.stat().st_size // 2)
    with pytest.raises(LogError):
        list(log.blocks())


def test_a_file_that_grows_between_two_passes_is_read_as_far_as_the_first_one(tmp_path: Path) -> None:
    path = write_ticks(tmp_path / "run.mcap", list(range(TICKS)))
    contents = path.read_bytes()
    path.write_bytes(contents[: len(contents) // 2])
    log = scan_log(path)
    path.write_bytes(contents)
    assert not log.complete and 0 < log.rows < TICKS
    assert sum(map(len, log.blocks())) == log.rows


def test_a_log_that_was_moved_to_done_between_two_passes_is_found(tmp_path: Path) -> None:
    path = tmp_path / "active" / "run.mcap"
    path.parent.mkdir()
    (tmp_path / "done").mkdir()
    log = scan_log(write_ticks(tmp_path / "run.mcap", list(range(TICKS))).rename(path))
    path.rename(tmp_path / "done" / "run.mcap")
    assert sum(map(len, log.blocks())) == TICKS


def test_only_the_chunks_of_a_span_are_read(tmp_path: Path) -> None:
    log = scan_log(write_ticks(tmp_path / "run.mcap", list(range(TICKS))))
    read = np.concatenate([block["tick"] for block in log.blocks(spans=[(5.0, 5.5)])])
    assert len(read) < TICKS / 4 and set(range(1900, 2090)) <= set(read.tolist())
