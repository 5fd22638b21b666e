"""Whole, cut and damaged logs are read as far as possible, or refused with one sentence."""

import json
import random
import struct
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from control.records import Rig
from firmware_host.log.log_file import LogFile
from firmware_host.log.rows import EVENT, EVENT_KIND, STRIDE, STRIDE_KIND, TICK, TICK_KIND, tick_kind
from firmware_host.log.schema import RowKind
from logs.files.log_error import LogError
from logs.files.log_reader import Log, read_log
from logs.files.log_summary import log_summary
from tests.firmware_host.synthetic_rows import OPENING, encode_row

TICKS = 1000  # six chunks


def make_tick(number: int) -> bytes:
    return encode_row(
        TICK,
        stamp_s=number / 380,
        angle_rad=[number + joint / 10 for joint in range(4)],
        tick=number,
        missed_ticks=number // 100,
        stride=-1,
        limited=number % 2,
    )


def make_log(path: Path, ticks: int = TICKS) -> Path:
    """Write a finished log with ticks, two strides and three events."""
    rows = [(TICK_KIND, make_tick(number)) for number in range(ticks)]
    strides = [encode_row(STRIDE, stamp_s=1.0, index=index, flipper=index) for index in range(2)]
    events = [encode_row(EVENT, stamp_s=1.0, text=text) for text in ("walk", "mud", "stop")]
    rows[ticks // 2 : ticks // 2] = [(STRIDE_KIND, row) for row in strides]
    rows[ticks // 3 : ticks // 3] = [(EVENT_KIND, row) for row in events]
    log = LogFile(path, OPENING)
    log.write(rows)
    log.finish()
    return path


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_log(tmp_path_factory.mktemp("logs") / "run.mcap")


@pytest.fixture(scope="module")
def whole(path: Path) -> Log:
    return read_log(path)


def read_bytes(tmp_path: Path, contents: bytes | bytearray) -> Log:
    changed = tmp_path / "changed.mcap"
    changed.write_bytes(contents)
    return read_log(changed)


def holds_first_rows_of(log: Log, whole: Log) -> bool:
    return (
        log.ticks.tobytes() == whole.ticks[: len(log.ticks)].tobytes()
        and log.strides == whole.strides[: len(log.strides)]
        and log.events == whole.events[: len(log.events)]
    )


def test_ticks_are_an_array_with_the_fields_of_the_table_and_other_rows_are_dictionaries(whole: Log) -> None:
    assert whole.ticks.dtype.names == tuple(field.name for field in TICK.fields)
    assert whole.ticks["angle_rad"].shape == (TICKS, 4)
    for number in (0, 1, TICKS - 1):
        expected = TICK.decode(make_tick(number))
        assert {name: np.array(whole.ticks[number][name]).tolist() for name in expected} == {
            name: list(value) if isinstance(value, tuple) else value for name, value in expected.items()
        }
    assert [(stride["index"], stride["flipper"]) for stride in whole.strides] == [(0, 0), (1, 1)]
    assert [event["text"] for event in whole.events] == ["walk", "mud", "stop"]


def test_ticks_that_earlier_segments_missed_are_not_missing_in_this_one(whole: Log) -> None:
    """One of a hundred ticks is missed: four from the tick 500 on."""
    summary = log_summary(whole._replace(ticks=whole.ticks[500:]))
    assert (summary["rows"], summary["ticks"], summary["missed_ticks"]) == (500, 496, 9)


def test_a_log_without_rows_is_a_log(tmp_path: Path) -> None:
    LogFile(tmp_path / "empty.mcap", OPENING).finish()
    log = read_log(tmp_path / "empty.mcap")
    assert (len(log.ticks), log.complete, log.configuration_text) == (0, True, "[robot]\n")
    summary = log_summary(log)
    assert (summary["started"], summary["rows"], summary["ticks"], summary["rate_hz"]) == ("", 0, 0, None)


def test_a_log_without_stamps_has_a_summary_that_is_json(tmp_path: Path) -> None:
    log = LogFile(tmp_path / "stampless.mcap", OPENING)
    log.write([(TICK_KIND, encode_row(TICK, stamp_s=np.nan, tick=number)) for number in range(2)])
    log.finish()
    summary = log_summary(read_log(log.path))
    assert (summary["duration_s"], summary["rate_hz"], summary["ticks"]) == (0.0, None, 2)
    json.dumps(summary, allow_nan=False)


def test_an_unfinished_log_is_read_up_to_its_cut(path: Path, whole: Log, tmp_path: Path) -> None:
    contents = path.read_bytes()
    lengths = [*range(len(MCAP0_MAGIC), len(contents), 1499), *range(len(contents) - 40, len(contents))]
    counts = []
    for length in lengths:
        log = read_bytes(tmp_path, contents[:length])
        assert not log.complete
        assert holds_first_rows_of(log, whole)
        counts.append(len(log.ticks))
    assert counts == sorted(counts)
    assert (counts[0], counts[-1]) == (0, TICKS)


def chunk_places(path: Path) -> list[int]:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return [chunk.chunk_start_offset for chunk in summary.chunk_indexes]


def test_a_tail_of_zeros_after_a_power_cut_is_a_cut(path: Path, whole: Log, tmp_path: Path) -> None:
    log = read_bytes(tmp_path, path.read_bytes()[: chunk_places(path)[3]] + bytes(4096))
    assert not log.complete
    assert len(log.ticks) > TICKS / 3
    assert holds_first_rows_of(log, whole)


def test_damage_is_refused_or_leaves_the_rows_intact(path: Path, whole: Log, tmp_path: Path) -> None:
    """After one flipped bit in any byte, all rows are right or the file is refused."""
    chance = random.Random(2)
    contents = path.read_bytes()
    refused = 0
    for _ in range(200):
        damaged = bytearray(contents)
        damaged[chance.randrange(len(damaged))] ^= 1 << chance.randrange(8)
        try:
            log = read_bytes(tmp_path, damaged)
        except LogError as error:
            refused += 1
            assert "changed.mcap: damaged" in str(error)
            continue
        assert holds_first_rows_of(log, whole)
        assert len(log.ticks) == TICKS or not log.complete
    assert refused > 100


def test_a_finished_log_that_lacks_rows_is_refused(path: Path, tmp_path: Path) -> None:
    """A chunk of an unknown kind of record is passed over, as the format demands."""
    contents = bytearray(path.read_bytes())
    contents[chunk_places(path)[1]] = 0x80
    with pytest.raises(LogError, match=r"only \d+ of its 1005 rows can be found"):
        read_bytes(tmp_path, contents)


@pytest.mark.parametrize("contents", [b"", b"time,turtle_state\n", MCAP0_MAGIC[:-1]])
def test_a_file_that_is_no_log_is_refused_at_its_first_byte(contents: bytes, tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"changed\.mcap: damaged at byte 0: .* MCAP"):
        read_bytes(tmp_path, contents)


def write_foreign(
    path: Path,
    rows: list[bytes],
    *,
    kind: RowKind = TICK,
    topic: str = "",
    ros_text: str = "",
) -> Path:
    """Write a valid MCAP file with one channel, as another program might."""
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start(profile="ros2", library="another")
        text = (ros_text or kind.definition).encode()
        schema = writer.register_schema(kind.schema_name, "ros2msg", text)
        channel = writer.register_channel(topic or kind.topic, "cdr", schema)
        for row in rows:
            writer.add_message(channel, 0, row, 0)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


@pytest.mark.parametrize(("kind", "fault"), [(TICK, r"has \d+ bytes"), (STRIDE, "is damaged"), (EVENT, "is damaged")])
def test_a_row_that_ends_early_is_named_by_its_number(kind: RowKind, fault: str, tmp_path: Path) -> None:
    path = write_foreign(tmp_path / "short.mcap", [encode_row(kind), encode_row(kind)[:10]], kind=kind)
    with pytest.raises(LogError, match=rf"short\.mcap: row 2 of {kind.topic} {fault}"):
        read_log(path)


@pytest.mark.parametrize("ros_text", ["Header header\n", "string name\nfloat64 stamp_s\n", "float64[2] stamp_s\n"])
def test_a_layout_that_this_version_cannot_decode_is_refused(tmp_path: Path, ros_text: str) -> None:
    path = write_foreign(tmp_path / "new.mcap", [make_tick(0)], ros_text=ros_text)
    with pytest.raises(LogError, match="the version of mudskipper that wrote it") as refusal:
        read_log(path)
    assert "recover" not in str(refusal.value)  # it would not help


def test_a_log_of_version_0_2_names_its_flippers_in_comments(tmp_path: Path) -> None:
    kind = tick_kind(Rig(("right",)))
    assert read_log(write_foreign(tmp_path / "run.mcap", [encode_row(kind)], kind=kind)).rig.flippers == ("right",)


def test_other_comments_are_no_other_layout(tmp_path: Path) -> None:
    ros_text = "".join(f"{line.split('#')[0]} # new words\n" for line in TICK.definition.splitlines())
    assert len(read_log(write_foreign(tmp_path / "run.mcap", [make_tick(0)], ros_text=ros_text)).ticks) == 1


def test_channels_of_others_are_passed_over(tmp_path: Path) -> None:
    log = read_log(write_foreign(tmp_path / "more.mcap", [b"anything"], topic="/camera"))
    assert (len(log.ticks), log.complete) == (0, True)


MIB = 1024 * 1024
BOMBS = {  # compression, sizes of the chunks, the size that each states, what the refusal says
    "lz4, 16 MiB in 69 kB": ("lz4", [16 * MIB], 0, "a chunk of .* cannot hold 16777216, at most 8388608"),
    "zstd, 16 MiB": ("zstd", [16 * MIB], 0, "a chunk of .* cannot hold 16777216"),
    "zstd, a chunk beyond the size that it states": ("zstd", [256 * MIB], 1000, "a chunk of 1000 bytes holds 1001"),
    "another compression": ("brotli", [1000], 0, "the compression 'brotli'"),
    "lz4, chunks that are each allowed": (
        "lz4",
        [3 * MIB // 9 * 9] * 20,
        0,
        "expand to more than .* 32 times its size",
    ),
}


@pytest.mark.parametrize(("compression", "sizes", "stated", "refusal"), BOMBS.values(), ids=BOMBS)
def test_a_log_that_expands_without_bound_or_not_at_all_is_refused_at_once(
    compression: str, sizes: list[int], stated: int, refusal: str, tmp_path: Path
) -> None:
    chunks = b"".join(chunk_of_zeros(size, compression, stated) for size in sizes)
    with pytest.raises(LogError, match=refusal):
        read_bytes(tmp_path, MCAP0_MAGIC + chunks + MCAP0_MAGIC)


def chunk_of_zeros(size: int, compression: str, stated: int) -> bytes:
    """Return a chunk's record without a checksum."""
    compress = lz4.frame.compress if compression == "lz4" else zstandard.compress
    name, stored = compression.encode(), compress(bytes(size))
    head = struct.pack(f"<QQQII{len(name)}sQ", 0, 0, stated or size, 0, len(name), name, len(stored))
    return struct.pack("<BQ", Opcode.CHUNK, len(head) + len(stored)) + head + stored


def test_a_log_read_from_a_moment_on_holds_all_that_came_after(path: Path) -> None:
    whole, late = read_log(path), read_log(path, from_s=2.0)
    assert len(late.ticks) < 0.7 * len(whole.ticks)
    after = whole.ticks[whole.ticks["stamp_s"] >= 2.0]
    assert len(after) and late.ticks[late.ticks["stamp_s"] >= 2.0]["tick"].tolist() == after["tick"].tolist()
    assert late.metadata == whole.metadata and late.complete
