"""A log whose writer was killed is recovered with every row on the disk, and other programs can open it."""

import os
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from firmware_host.log.log_file import LogFile
from firmware_host.log.log_folder import ACTIVE, DONE, unfinished_files
from firmware_host.log.recorder import BLOCKED
from firmware_host.log.rows import TICK
from logs import recovery
from logs.files.log_error import LogError, Watch
from logs.files.log_reader import read_log
from logs.recovery import recover_all, recover_log, salvage_rows
from tests.firmware_host.synthetic_rows import OPENING, make_ticks
from tests.waiting import wait_until

CHUNK = 100  # ticks


def make_file(path: Path, chunks: int = 5) -> LogFile:
    """Write chunks of ticks, each of them flushed, and leave the log open."""
    log = LogFile(path, OPENING)
    for chunk in range(chunks):
        log.write(make_ticks(chunk * CHUNK, (chunk + 1) * CHUNK))
        log.flush()
    return log


def make_cut_log(folder: Path, name: str = "run-0000.mcap") -> Path:
    """Write a log as SIGKILL leaves it, without index and lock."""
    log = make_file(folder / ACTIVE / name)
    log._file.close()
    return log.path


def test_every_row_comes_back_and_the_file_moves_to_done(tmp_path: Path) -> None:
    path = make_cut_log(tmp_path)
    recovered = recover_log(path)
    assert recovered.path == tmp_path / DONE / path.name
    assert (recovered.rows, recovered.lost) == (5 * CHUNK, 0)
    assert unfinished_files(tmp_path) == []
    log = read_log(recovered.path)
    assert log.complete and log.ticks["tick"].tolist() == list(range(5 * CHUNK))
    assert log.metadata["recovered"] == "true" and log.metadata["run_id"] == "run"
    assert log.metadata["wall_minus_monotonic_ns"] == str(OPENING["wall_minus_monotonic_ns"])
    assert log.configuration_text == OPENING["configuration_text"]
    assert log.events[-1]["text"].startswith("recovered: 500 rows; ")


def test_a_recovered_log_is_durable_before_the_damaged_one_goes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, steps, fsync, unlink = make_cut_log(tmp_path), [], os.fsync, Path.unlink

    def synchronise(descriptor: int) -> None:
        steps.append(Path(f"/proc/self/fd/{descriptor}").readlink())
        fsync(descriptor)

    def remove(path: Path, **options: bool) -> None:
        steps.append(path)
        unlink(path, **options)

    monkeypatch.setattr(os, "fsync", synchronise)
    monkeypatch.setattr(Path, "unlink", remove)
    recover_log(path)
    assert set(steps[-3:-1]) == {tmp_path / ACTIVE, tmp_path / DONE}
    assert steps[-1] == path.with_name(path.name + ".broken")


def test_readers_of_other_projects_open_a_recovered_log(tmp_path: Path) -> None:
    path = recover_log(make_cut_log(tmp_path)).path
    with AnyReader([path]) as bag:
        assert bag.message_count == sum(1 for _ in bag.messages()) == 5 * CHUNK + 1
    with path.open("rb") as file:
        messages = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        assert [row.decoded_message.tick for row in messages if row.channel.topic == "/tick"] == list(range(5 * CHUNK))


def test_damage_in_the_middle_costs_what_it_touches(tmp_path: Path) -> None:
    path = make_cut_log(tmp_path)
    contents = bytearray(path.read_bytes())
    third = contents.split(b"\x03\x00\x00\x00lz4")[:3]
    contents[sum(map(len, third)) + 100] ^= 0x10
    path.write_bytes(contents)
    recovered = recover_log(path)
    log = read_log(recovered.path)
    assert (recovered.rows, recovered.lost, len(log.ticks)) == (4 * CHUNK, CHUNK, 4 * CHUNK)
    assert log.ticks["tick"][-1] == 5 * CHUNK - 1
    assert f"{CHUNK} lost in damaged places" in log.events[-1]["text"]
    assert log.metadata["rows_lost"] == str(CHUNK)


def test_rows_of_a_log_without_its_metadata_have_the_wall_clock_that_they_had(tmp_path: Path) -> None:
    cut = make_file(tmp_path / "run.mcap", chunks=0)
    cut.write(make_ticks(380, 380 + CHUNK))
    cut.flush()
    cut._file.close()
    path = cut.path
    path.write_bytes(path.read_bytes().replace(b"\x0a\x00\x00\x00mudskipper", b"\x0a\x00\x00\x00mudskippeR"))
    log = read_log(recover_log(path).path)
    assert "run_id" not in log.metadata and len(log.ticks) == CHUNK
    assert log.metadata["wall_minus_monotonic_ns"] == str(OPENING["wall_minus_monotonic_ns"])


def test_a_log_that_is_being_written_is_left_alone(tmp_path: Path) -> None:
    log = make_file(tmp_path / ACTIVE / "run-0000.mcap")
    with pytest.raises(BlockingIOError):
        recover_log(log.path)
    complaints: list[str] = []
    assert not recover_all(tmp_path, complaints.append) and not complaints
    log.finish()
    assert len(read_log(tmp_path / DONE / "run-0000.mcap").ticks) == 5 * CHUNK


def test_a_recovery_that_was_cut_off_is_done_again(tmp_path: Path) -> None:
    path = make_cut_log(tmp_path)
    path = path.rename(path.with_name(path.name + ".broken"))
    path.with_name("run-0000.mcap.part").write_bytes(b"half")
    recover_all(tmp_path, print)
    assert unfinished_files(tmp_path) == []
    assert len(read_log(tmp_path / DONE / "run-0000.mcap").ticks) == 5 * CHUNK


def test_a_part_without_its_damaged_log_is_recovered_itself(tmp_path: Path) -> None:
    """It is the last copy of these rows: it stays until the recovered log is written."""
    path = make_cut_log(tmp_path)
    part, broken = (path.with_name(path.name + ending) for ending in (".part", ".broken"))
    broken.write_bytes(path.read_bytes())
    path.rename(part)
    with pytest.raises(LogError, match=f"left as it is: an interrupted recovery of {broken}"):
        recover_log(part)
    assert part.exists()
    broken.unlink()
    assert recover_log(part).rows == 5 * CHUNK
    assert unfinished_files(tmp_path) == []
    assert len(read_log(tmp_path / DONE / path.name).ticks) == 5 * CHUNK


def test_a_recovery_ends_with_the_service_though_the_writer_ignores_that(tmp_path: Path) -> None:
    (tmp_path / ACTIVE).mkdir()
    os.mkfifo(tmp_path / ACTIVE / "hangs.mcap")
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, BLOCKED)
    try:
        process = subprocess.Popen([sys.executable, "-m", "logs.recovery", str(tmp_path)])
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        signal.signal(signal.SIGTERM, before)

    def ends() -> bool:
        process.terminate()
        return process.poll() is not None

    try:
        wait_until(ends)
    finally:
        process.kill()
    assert process.returncode == -signal.SIGTERM


@pytest.mark.parametrize(("name", "contents"), [("film.part", b"half"), ("notes", b"")])
def test_a_file_that_is_no_log_by_its_name_is_not_removed(tmp_path: Path, name: str, contents: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(contents)
    with pytest.raises(LogError, match="left as it is"):
        recover_log(path)
    assert path.read_bytes() == contents


def test_a_recovery_cut_off_at_its_very_end_recovers_nothing_twice(tmp_path: Path) -> None:
    path = make_cut_log(tmp_path)
    contents = path.read_bytes()
    done = recover_log(path).path
    before = done.read_bytes()
    path.with_name(path.name + ".broken").write_bytes(contents)
    recover_all(tmp_path, print)
    assert (unfinished_files(tmp_path), done.read_bytes()) == ([], before)


@pytest.mark.parametrize(("named", "other"), [("a.mcap", "a.mcap.broken"), ("a.mcap.broken", "a.mcap")])
def test_a_recovery_overwrites_no_other_cut_log(tmp_path: Path, named: str, other: str) -> None:
    contents = make_cut_log(tmp_path / "robot").read_bytes()
    (tmp_path / named).write_bytes(contents[:20000])
    (tmp_path / other).write_bytes(contents)
    with pytest.raises(LogError, match=f"left as it is: {tmp_path / other} is another log"):
        recover_log(tmp_path / named)
    assert (tmp_path / other).read_bytes() == contents
    assert (tmp_path / named).read_bytes() == contents[:20000]


def test_a_whole_file_that_was_not_renamed_is_only_renamed(tmp_path: Path) -> None:
    log = make_file(tmp_path / "run-0000.mcap")
    path = log.finish()
    (tmp_path / ACTIVE).mkdir()
    before = path.read_bytes()
    recovered = recover_log(path.rename(tmp_path / ACTIVE / path.name))
    assert (recovered.note, recovered.path.read_bytes()) == ("is whole", before)


def test_an_empty_file_goes(tmp_path: Path) -> None:
    (tmp_path / ACTIVE).mkdir()
    (tmp_path / ACTIVE / "x.mcap").touch()
    recover_all(tmp_path, print)
    assert unfinished_files(tmp_path) == []


def test_a_disk_without_room_keeps_the_broken_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = make_cut_log(tmp_path)

    def refuse(log: LogFile) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(LogFile, "finish", refuse)
    complaints: list[str] = []
    recover_all(tmp_path, complaints.append)
    assert complaints == [f"{path}: cannot be recovered: No space left on device"]
    monkeypatch.undo()
    assert [entry.name for entry in unfinished_files(tmp_path)] == [path.name + ".broken"]
    recover_all(tmp_path, complaints.append)
    assert len(read_log(tmp_path / DONE / path.name).ticks) == 5 * CHUNK


def recompress(path: Path, cut_bytes: int = 0, ros_text: str = "", topics: tuple[str, ...] = ("/tick",)) -> Path:
    """Write a log with another program's compression, or with other topics or another layout of its rows."""
    ticks = [payload for _, payload in make_ticks(0, 300)]
    with path.open("wb") as file:
        compression = CompressionType.LZ4 if ros_text or len(topics) > 1 else CompressionType.ZSTD
        writer = Writer(file, compression=compression, chunk_size=10_000)
        writer.start(profile="ros2", library="another")
        writer.add_metadata("mudskipper", {"run_id": "run"})
        schema = writer.register_schema(TICK.schema_name, "ros2msg", (ros_text or TICK.definition).encode())
        channels = [writer.register_channel(topic, "cdr", schema) for topic in topics]
        for number, payload in enumerate(ticks):
            for channel in channels:
                writer.add_message(channel, 0, payload, 0, number)
        writer.finish()  # type: ignore[no-untyped-call]
    path.write_bytes(path.read_bytes()[: path.stat().st_size - cut_bytes])
    return path


def test_a_cut_log_that_another_program_compressed_is_recovered(tmp_path: Path) -> None:
    path = recompress(tmp_path / "run.mcap", cut_bytes=2000)
    ticks = read_log(path).ticks["tick"].tolist()
    assert recover_log(path).rows == len(ticks) > 100
    assert read_log(path).ticks["tick"].tolist() == ticks


@pytest.mark.parametrize("cut_bytes", [0, 2000])
def test_a_log_that_this_version_cannot_decode_is_left_as_it_is(tmp_path: Path, cut_bytes: int) -> None:
    path = recompress(tmp_path / "run.mcap", cut_bytes, ros_text="std_msgs/Header header\n")
    before = path.read_bytes()
    with pytest.raises(LogError, match="left as it is: .* whose type is unknown"):
        recover_log(path)
    assert path.read_bytes() == before


def test_rows_of_other_programs_are_counted_as_lost(tmp_path: Path) -> None:
    path = recompress(tmp_path / "run.mcap", 2000, topics=("/camera", "/tick"))
    recovered = recover_log(path)
    assert recovered.rows > 100 and 0 <= recovered.lost - recovered.rows <= 1
    assert f"{recovered.lost} of other programs left out" in recovered.note
    log = read_log(path)
    assert len(log.ticks) == recovered.rows and log.metadata["rows_lost"] == str(recovered.lost)


def test_a_finished_log_of_the_same_name_with_fewer_rows_takes_nothing_away(tmp_path: Path) -> None:
    path = make_cut_log(tmp_path)
    other = make_file(tmp_path / "other.mcap", chunks=1).finish()
    (tmp_path / DONE).mkdir()
    other = other.rename(tmp_path / DONE / path.name)
    with pytest.raises(LogError, match="has its name and fewer rows"):
        recover_log(path)
    assert path.exists() and len(read_log(other).ticks) == CHUNK


def test_a_log_that_is_cut_off_during_its_recovery_stays_for_another_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, found = make_cut_log(tmp_path), recovery.Salvage.found_rows
    half = path.stat().st_size // 2

    def cut_before_the_second_pass(salvage: recovery.Salvage, *watch: Watch) -> Iterator[tuple[int, bytes]]:
        broken = path.with_name(path.name + ".broken")
        if broken.exists():
            os.truncate(broken, half)
        return found(salvage, *watch)

    monkeypatch.setattr(recovery.Salvage, "found_rows", cut_before_the_second_pass)
    with pytest.raises(LogError, match="was changed while it was read: nothing was recovered"):
        recover_log(path)
    monkeypatch.undo()
    (broken,) = unfinished_files(tmp_path)
    assert broken.name == path.name + ".broken"
    assert 0 < recover_log(broken).rows < 5 * CHUNK


def test_the_memory_of_a_recovery_does_not_grow_with_the_log(tmp_path: Path) -> None:
    peaks = []
    for chunks in (10, 80):
        path = make_file(tmp_path / f"{chunks}.mcap", chunks).path
        tracemalloc.start()
        with path.open("rb") as file:
            assert salvage_rows(path, file).rows == chunks * CHUNK
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]
