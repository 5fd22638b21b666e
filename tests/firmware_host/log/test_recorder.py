"""The recorder with its real writer: rows come back bit for bit, and lost rows are reported.

Two readers that share no code with the project, rosbags and mcap-ros2-support, must see the same values.
"""

import json
import math
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from firmware_host.configuration.log_parameters import LogParameters
from firmware_host.log.log_folder import DONE, first_path, unfinished_files
from firmware_host.log.recorder import (
    HEALTHY,
    LONGEST_TEXT,
    LogReport,
    NullRecorder,
    Recorder,
)
from firmware_host.log.row_records import pack_record
from firmware_host.log.rows import EVENT, EVENT_KIND, ROW_KINDS, TICK, TICK_KIND
from firmware_host.log.schema import RowKind
from firmware_host.log.writer import Reporter
from logs.files.log_reader import read_log
from tests.waiting import LONGEST_S, wait_until

CONFIGURATION = '[robot]\nname = "Ünïcode"\n'
NUMBERS = random.Random(1)  # noise does not compress, so a file grows as rows are put

MAKE: dict[str, Callable[[int], Any]] = {
    "float64": lambda index: index * NUMBERS.random(),
    "uint32": lambda index: 2**32 - index,
    "int32": lambda index: -index,
    "uint8": lambda index: index % 6,
    "bool": lambda index: index % 2 == 0,
    "string": lambda index: "mud, glorious mud: ü",
}


class Row(NamedTuple):
    kind: RowKind
    values: list[Any]

    @property
    def payload(self) -> bytes:
        return self.kind.encode(*self.values)


def make_row(kind: RowKind, stamp_s: float) -> Row:
    """Return a row with a different value in every field, one of them NaN."""
    kinds = [field.kind for field in kind.fields for _ in range(field.length or 1)]
    values = [stamp_s, *(MAKE[name](index) for index, name in enumerate(kinds) if index > 0)]
    if len(values) > 2:
        values[1] = math.nan
    return Row(kind, values)


def make_tick(stamp_s: float) -> bytes:
    return make_row(TICK, stamp_s).payload


def fill_pipe(recorder: Recorder) -> int:
    """Put ticks until one is dropped; returns how many went in."""
    accepted = 0
    while recorder.put(TICK_KIND, make_tick(float(accepted))):
        accepted += 1
    return accepted


@pytest.fixture
def recorder(tmp_path: Path) -> Recorder:
    return Recorder(tmp_path / "logs" / "run.mcap", CONFIGURATION, {"robot": "test"})


@pytest.fixture(scope="module")
def golden(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Row]]:
    """Write three rows of every kind into a finished log, and return it with them."""
    recorder = Recorder(tmp_path_factory.mktemp("golden") / "run.mcap", CONFIGURATION, {"robot": "test"})
    rows = [make_row(kind, 100.0 + number) for number in range(3) for kind in ROW_KINDS]
    for row in rows:
        assert recorder.put(ROW_KINDS.index(row.kind), row.payload)
    assert recorder.close(LONGEST_S)
    return recorder.path, rows


def comparable(values: list[Any]) -> list[str]:
    """Return the values as text, so that they compare bit for bit; NaN equals NaN, and True equals 1.0."""
    return [value if isinstance(value, str) else float(value).hex() for value in values]


def values_of(message: Any, kind: RowKind) -> list[Any]:
    """Return the values of a message that another reader decoded, in the order of the row's fields."""
    values: list[Any] = []
    for field in kind.fields:
        value = getattr(message, field.name)
        values.extend(value if field.length else [value])
    return values


def test_rows_come_back_bit_for_bit(golden: tuple[Path, list[Row]]) -> None:
    with golden[0].open("rb") as file:
        rows = list(make_reader(file, validate_crcs=True).iter_messages(log_time_order=False))
    assert [message.data for _, _, message in rows] == [row.payload for row in golden[1]]
    assert [channel.topic for _, channel, _ in rows] == [row.kind.topic for row in golden[1]]
    assert [message.sequence for _, _, message in rows] == [0, 0, 0, 1, 1, 1, 2, 2, 2]


def test_a_row_has_the_wall_clock_of_its_stamp(golden: tuple[Path, list[Row]]) -> None:
    """Other programs order and align a log by it."""
    offset_ns = int(read_log(golden[0]).metadata["wall_minus_monotonic_ns"])
    assert abs(offset_ns - (time.time_ns() - time.monotonic_ns())) < 1e9
    with golden[0].open("rb") as file:
        times_ns = [message.log_time for _, _, message in make_reader(file).iter_messages(log_time_order=False)]
    assert times_ns == [offset_ns + round(1e9 * row.values[0]) for row in golden[1]]


def test_rosbags_decodes_the_same_values(golden: tuple[Path, list[Row]]) -> None:
    with AnyReader([golden[0]]) as bag:
        for kind in ROW_KINDS:
            connections = [connection for connection in bag.connections if connection.topic == kind.topic]
            messages = [bag.deserialize(raw, source.msgtype) for source, _, raw in bag.messages(connections)]
            expected = [row.values for row in golden[1] if row.kind is kind]
            for values, message in zip(expected, messages, strict=True):
                assert comparable(values_of(message, kind)) == comparable(values)


def test_a_full_pipe_drops_at_once_and_the_log_says_how_many(recorder: Recorder) -> None:
    wait_until(recorder.path.exists)
    os.kill(recorder.writer_pid, signal.SIGSTOP)
    accepted = fill_pipe(recorder)
    assert accepted > 5 * 380  # seconds of ticks: a memory card may pause for one
    for stamp_s in range(9):
        assert not recorder.put(TICK_KIND, make_tick(float(stamp_s)))  # a blocking pipe would wait for ever
    assert (recorder.dropped, recorder.writer_alive) == (10, True)
    os.kill(recorder.writer_pid, signal.SIGCONT)
    wait_until(lambda: recorder.put(TICK_KIND, make_tick(1e3)))
    assert recorder.close(LONGEST_S)
    with recorder.path.open("rb") as file:
        topics = [row.topic for _, row, _ in make_reader(file).iter_messages(log_time_order=False)]
    assert topics == ["/tick"] * accepted + ["/event", "/tick"]
    (event,) = read_log(recorder.path).events
    assert event["text"].startswith(f"rows missing here: {recorder.dropped},") and event["stamp_s"] >= 8.0


def test_close_ends_though_the_writer_hangs_and_reports_the_last_loss(recorder: Recorder) -> None:
    wait_until(recorder.path.exists)
    os.kill(recorder.writer_pid, signal.SIGSTOP)
    fill_pipe(recorder)
    assert not recorder.close(0.1)  # the writer would never end
    os.kill(recorder.writer_pid, signal.SIGCONT)
    assert recorder.close(LONGEST_S)
    (event,) = read_log(recorder.path).events  # about a row that was lost at the very end
    assert event["text"].startswith("rows missing here: 1,")


def test_signals_do_not_cut_the_log(recorder: Recorder) -> None:
    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGABRT)
    for number in signals:
        os.kill(recorder.writer_pid, number)  # while it is still starting
    recorder.put(TICK_KIND, make_tick(1.0))
    wait_until(recorder.path.exists)
    for number in signals:
        os.kill(recorder.writer_pid, number)
    recorder.put(TICK_KIND, make_tick(2.0))
    assert recorder.close(LONGEST_S)
    log = read_log(recorder.path)
    assert (log.complete, log.ticks["stamp_s"].tolist()) == (True, [1.0, 2.0])


def test_an_event_of_any_length_is_logged_shortened(recorder: Recorder) -> None:
    assert recorder.put(EVENT_KIND, EVENT.encode(1.0, "ü" * 5000))
    assert recorder.close(LONGEST_S)
    (event,) = read_log(recorder.path).events
    assert event == {"stamp_s": 1.0, "text": "ü" * (LONGEST_TEXT // 2)}


def test_a_configuration_longer_than_the_pipe_arrives(tmp_path: Path) -> None:
    text = "# a long comment\n" * 200_000
    recorder = Recorder(tmp_path / "run.mcap", text, {})
    assert recorder.close(LONGEST_S)
    assert read_log(recorder.path).configuration_text == text


def test_a_row_without_a_stamp_does_not_stop_the_writer(recorder: Recorder) -> None:
    for stamp_s in (1.0, math.nan, -math.inf, 2.0):
        recorder.put(EVENT_KIND, EVENT.encode(stamp_s, "event"))
    assert recorder.close(LONGEST_S)
    assert len(read_log(recorder.path).events) == 4


def test_the_writer_is_last_in_line_for_the_cpu(recorder: Recorder) -> None:
    wait_until(recorder.path.exists)
    niceness = os.getpriority(os.PRIO_PROCESS, recorder.writer_pid)
    assert niceness == min(19, os.getpriority(os.PRIO_PROCESS, 0) + 10)
    assert os.sched_getscheduler(recorder.writer_pid) == os.SCHED_OTHER
    assert recorder.close(LONGEST_S)


def test_a_path_that_cannot_be_made_is_reported_in_a_sentence(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    recorder = Recorder(tmp_path / "file" / "run.mcap", "", {})
    assert not recorder.close(LONGEST_S)
    assert capfd.readouterr().err == f"The log cannot be written: {recorder.path}: Not a directory.\n"


def test_a_log_is_never_written_over(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "run.mcap"
    path.write_text("precious")
    recorder = Recorder(path, "", {})
    assert recorder.close(LONGEST_S)
    assert (path.read_text(), recorder.path.name) == ("precious", "run-0001.mcap")
    assert capfd.readouterr().err == f"The log cannot be written: {path}: File exists.\n"


def test_a_disk_that_refuses_costs_rows_that_the_log_counts(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The kernel limits the size of files for a while."""
    recorder = Recorder(tmp_path / "run.mcap", "", {})
    wait_until(recorder.path.exists)
    resource.prlimit(recorder.writer_pid, resource.RLIMIT_FSIZE, (2000, resource.RLIM_INFINITY))
    put = 0
    deadline_s = time.monotonic() + LONGEST_S
    while not look(recorder).problem and time.monotonic() < deadline_s:
        put += recorder.put(TICK_KIND, make_tick(float(put)))
        time.sleep(0.003)
    assert look(recorder).problem == f"{tmp_path / 'run.mcap'}: File too large."
    assert recorder.writer_alive
    unlimited = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
    resource.prlimit(recorder.writer_pid, resource.RLIMIT_FSIZE, unlimited)
    while look(recorder).problem and time.monotonic() < deadline_s:
        put += recorder.put(TICK_KIND, make_tick(float(put)))
        time.sleep(0.003)
    assert recorder.close(LONGEST_S)
    log = read_log(recorder.path)
    lost = int(log.events[0]["text"].split()[3].rstrip(","))
    assert recorder.dropped == lost > 0
    assert log.ticks["stamp_s"].tolist() == [float(number) for number in range(lost, put)]
    assert log.events[0]["text"].endswith("the log could not be written: File too large")
    assert capfd.readouterr().err.count("\n") == 1


def count_rows(path: Path) -> int:
    """Return the number of ticks in the chunks that are complete so far."""
    return len(read_log(path).ticks) if path.exists() and path.stat().st_size else 0


def test_what_a_killed_writer_left_is_recovered_at_the_next_start(tmp_path: Path) -> None:
    killed = Recorder(first_path(tmp_path, "1"), CONFIGURATION, {"robot": "test"}, LogParameters())
    for number in range(500):
        killed.put(TICK_KIND, make_tick(float(number)))
    wait_until(lambda: count_rows(killed.path) > 100)
    os.kill(killed.writer_pid, signal.SIGKILL)
    wait_until(lambda: not killed.put(TICK_KIND, make_tick(0.0)))
    assert not killed.close(LONGEST_S)
    cut = read_log(killed.path)
    assert (cut.complete, cut.configuration_text) == (False, CONFIGURATION)
    recorder = Recorder(first_path(tmp_path, "2"), CONFIGURATION, {"robot": "test"}, LogParameters())
    assert recorder.report().repairing == 1  # before its writer has said anything
    recorder.put(TICK_KIND, make_tick(1.0))
    wait_until((tmp_path / DONE / "1-0000.mcap").exists)
    wait_until(lambda: not look(recorder).repairing)
    assert recorder.close(LONGEST_S)
    assert recorder.path == tmp_path / DONE / "2-0000.mcap"
    wait_until(lambda: not unfinished_files(tmp_path))
    recovered = read_log(tmp_path / DONE / "1-0000.mcap")
    assert recovered.complete and recovered.metadata["recovered"] == "true"
    assert recovered.ticks["stamp_s"].tolist() == [float(number) for number in range(len(recovered.ticks))]
    assert len(recovered.ticks) > 100


def look(recorder: Recorder) -> LogReport:
    """Read the pipe of reports now, and not only after some calls."""
    recorder._calls = 0
    return recorder.report()


def test_before_the_writer_reports_the_room_on_the_disk_is_unknown() -> None:
    assert math.isnan(NullRecorder().report().free_fraction)


def test_the_writer_reports_the_disk(recorder: Recorder) -> None:
    wait_until(lambda: look(recorder).free_bytes < HEALTHY.free_bytes)
    report, disk = look(recorder), os.statvfs(recorder.path)
    assert report.free_fraction == pytest.approx(disk.f_bavail / disk.f_blocks, abs=0.05)
    assert (report.alive, report.dropped, report.problem) == (True, 0, "")
    assert 0.0 <= report.slowest_write_s < LONGEST_S
    os.kill(recorder.writer_pid, signal.SIGKILL)
    os.waitid(os.P_PID, recorder.writer_pid, os.WEXITED | os.WNOWAIT)
    assert not [recorder.report().alive for _ in range(100)][-1]  # a quarter of a second of ticks
    recorder.close(LONGEST_S)


def test_the_writer_reports_at_once_where_another_file_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firmware_host.log.writer.REPORT_INTERVAL_S", math.inf)
    reports, pipe = os.pipe()
    log = SimpleNamespace(path=Path("/1"), problem="", slowest_s=0.0, dropped=0, durable_stamp_s=0.0, repairing=0)
    reporter = Reporter(pipe)
    for path in ("/1", "/1", "/2", "/2"):
        log.path = Path(path)
        reporter.update(log)  # type: ignore[arg-type]
    os.close(pipe)
    with os.fdopen(reports) as lines:
        assert [json.loads(line)[0] for line in lines] == ["/1", "/2"]


def test_a_writer_that_waits_for_its_disk_shows_as_a_slow_write(recorder: Recorder) -> None:
    wait_until(lambda: look(recorder).free_bytes < HEALTHY.free_bytes)
    recorder._reported_s -= 60.0
    assert look(recorder).slowest_write_s >= 60.0
    recorder.close(LONGEST_S)


def test_what_is_no_report_neither_ends_the_loop_nor_changes_what_is_known(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    lines = [b"a stray line", b"[]", b"{}", b"7", b"\xff", b'{"path": 3, "dropped": "x"}', b"[" * 5000]
    recorder = Recorder(tmp_path / "run.mcap", "", {})
    wait_until(lambda: look(recorder).free_bytes < HEALTHY.free_bytes)
    report = recorder._report
    assert not any(map(recorder._accept, lines))
    assert (recorder._report, recorder.path) == (report, tmp_path / "run.mcap")
    assert recorder.close(LONGEST_S)
    assert f"{len(lines)} malformed reports" in capfd.readouterr().err


@pytest.mark.parametrize("sent", [b"", pack_record(0, b"{" * 100)[:6]], ids=["nothing", "half an opening"])
def test_a_writer_that_hears_nothing_makes_no_file(tmp_path: Path, sent: bytes) -> None:
    path = tmp_path / "run.mcap"
    command = [sys.executable, "-m", "firmware_host.log.writer", str(path)]
    ended = subprocess.run(command, input=sent, capture_output=True, timeout=LONGEST_S, check=True)
    assert (ended.stderr, path.exists()) == (b"", False)


def test_a_row_cut_off_with_its_sender_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    opening = {"configuration_text": "", "metadata": {}, "wall_minus_monotonic_ns": 0}
    records = [(0, json.dumps(opening).encode()), (TICK_KIND, make_tick(1.0)), (TICK_KIND, make_tick(2.0))]
    sent = b"".join(pack_record(kind, payload) for kind, payload in records)
    command = [sys.executable, "-m", "firmware_host.log.writer", str(path)]
    subprocess.run(command, input=sent[:-1], timeout=LONGEST_S, check=True)
    assert read_log(path).ticks["stamp_s"].tolist() == [1.0]
