"""A log with flipped bytes, cuts, garbage or doubled pieces is read or refused, and recovered without any loss.

Recovery keeps every row of the chunks that end before the first changed byte, invents none, doubles none, and writes a
complete log.
"""

from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from firmware_host.log.log_file import LogFile
from firmware_host.log.log_folder import ACTIVE
from firmware_host.log.rows import TICK
from logs.files.log_error import LogError
from logs.files.log_reader import read_log
from logs.files.log_summary import log_summary
from logs.recovery import recover_log
from tests.firmware_host.synthetic_rows import OPENING, make_event, make_ticks

CHUNK = 50  # ticks
CHUNKS = 8
PAGE_BYTES = 4096
HUGE_LENGTHS = [number.to_bytes(8, "little") for number in (2**60, 2**63, 2**64 - 1, 2**31, 2**32 - 1)]


class SoundLog(NamedTuple):
    contents: bytes
    rows: frozenset[bytes]
    safe: list[tuple[int, int]]  # (bytes of the file, ticks before them)


class Damage(NamedTuple):
    """Bytes that are replaced by others, or by a copy of the bytes before them."""

    at: float  # as a fraction of the file
    removed: int
    inserted: bytes | int


DAMAGES = st.builds(
    Damage,
    st.floats(0.0, 1.0, exclude_max=True),
    st.integers(0, 8) | st.sampled_from([PAGE_BYTES, 10**9]),
    st.binary(max_size=8) | st.sampled_from([bytes(PAGE_BYTES), *HUGE_LENGTHS]) | st.integers(1, 5000),
)


def make_sound_log(path: Path, finished: bool) -> SoundLog:
    """Write chunks of ticks, each with an event."""
    log, rows, safe = LogFile(path, OPENING), [], []
    for number in range(CHUNKS):
        ticks = make_ticks(number * CHUNK, (number + 1) * CHUNK)
        rows += [row for _, row in ticks]
        log.write([*ticks, make_event(f"event {number}")])
        log.flush()
        safe.append((path.stat().st_size, len(rows)))
    done = log.finish() if finished else path
    if not finished:
        log._file.close()
    return SoundLog(done.read_bytes(), frozenset(rows), safe)


def damaged(contents: bytes, damages: list[Damage]) -> tuple[bytes, int]:
    """Return the damaged contents, and the first byte that may differ."""
    first = len(contents)
    for at_fraction, removed, inserted in damages:
        at = int(at_fraction * len(contents))
        new = contents[max(0, at - inserted) : at] if isinstance(inserted, int) else inserted
        contents, first = contents[:at] + new + contents[at + removed :], min(first, at)
    return contents, first


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> list[SoundLog]:
    """Return a log that was finished, and one whose writer was killed."""
    return [make_sound_log(tmp_path_factory.mktemp("sound") / "sound.mcap", finished) for finished in (True, False)]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])  # each example leaves the folder empty
@given(st.sampled_from((0, 1)), st.lists(DAMAGES, min_size=1, max_size=3))
def test_a_corrupted_log_loses_no_row_that_is_still_there(
    tmp_path: Path, sound: list[SoundLog], which: int, damages: list[Damage]
) -> None:
    log_before = sound[which]
    contents, first = damaged(log_before.contents, damages)
    path = tmp_path / ACTIVE / "run-0000.mcap"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(contents)
    kept = max((ticks for end, ticks in log_before.safe if end <= first), default=0)
    with suppress(LogError):
        log_summary(read_log(path))
    try:
        recovered = recover_log(path).path
        if recovered.exists():
            log, size = read_log(recovered), TICK.layout.size
            stored = log.ticks.tobytes()
            ticks = [stored[index : index + size] for index in range(0, len(stored), size)]
            assert log.complete and len(ticks) == len(set(ticks)) >= kept
            assert set(ticks) <= log_before.rows
        else:
            assert not contents
    except LogError:
        assert not kept
    finally:
        for left in tmp_path.glob("*/*"):
            left.unlink()
