"""Reading and recovery of corrupted logs: flipped bits, cuts, garbage, doubled pieces, tails of zeros.

Each log is a sound one with one to three such changes, by a seeded generator. Reading it must give a log or a one-line
refusal. Recovery must preserve every row of the chunks that end before the first changed byte, must invent none and
double none, and must write a complete log. Memory is the process's peak above that before the first log, in units of
the largest log; the slowest log shows whether anything hangs.
"""

from __future__ import annotations

import argparse
import random
import resource
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.report import Progress, evaluated, new_parser, run_benchmark
from control.rate import PERIOD_S
from firmware_host.log.log_file import LogFile
from firmware_host.log.rows import EVENT, EVENT_KIND, TICK, TICK_KIND
from firmware_host.log_reading.log_reader import Log, LogError, log_summary, read_log
from firmware_host.log_reading.recovery import recover_log

BAR_S = 2.0  # for one log
BAR_MEMORY = 40.0  # times the largest log


class SoundLog(NamedTuple):
    contents: bytes
    rows: frozenset[bytes]
    safe: tuple[tuple[int, int], ...]  # (bytes of the file, ticks before them)


def make_sound_log(path: Path, chance: random.Random, finished: bool) -> SoundLog:
    """Writes eight chunks of ticks, each with an event."""
    opening = {"configuration_text": "[robot]\n" * 40, "metadata": {"robot": "x"}, "wall_minus_monotonic_ns": 10**18}
    log = LogFile(path, opening)
    rows: list[bytes] = []
    safe = []
    for number in range(400):
        values = [chance.random() for field in TICK.fields for _ in range(field.length or 1)]
        kinds = [field.kind for field in TICK.fields for _ in range(field.length or 1)]
        other = {"uint32": number, "int32": number}  # above all the tick's number, by which the reader sorts
        whole = [
            value if kind == "float64" else other.get(kind, number % 7)
            for value, kind in zip(values, kinds, strict=True)
        ]
        rows.append(TICK.encode(number * PERIOD_S, *whole[1:]))
        log.write([(TICK_KIND, rows[-1])])
        if number % 50 == 49:
            log.write([(EVENT_KIND, EVENT.encode(number * PERIOD_S, f"event {number}"))])
            log.flush()
            safe.append((path.stat().st_size, len(rows)))
    if finished:
        log.finish()
    contents = path.read_bytes()
    path.unlink()
    return SoundLog(contents, frozenset(rows), tuple(safe))


def flip(contents: bytearray, chance: random.Random) -> int:
    index = chance.randrange(len(contents))
    contents[index] ^= 1 << chance.randrange(8)
    return index


def cut(contents: bytearray, chance: random.Random) -> int:
    index = chance.randrange(len(contents))
    del contents[index:]
    return index


def insert_garbage(contents: bytearray, chance: random.Random) -> int:
    index = chance.randrange(len(contents))
    contents[index:index] = chance.randbytes(chance.choice((1, 8, 100, 5000)))
    return index


def double_piece(contents: bytearray, chance: random.Random) -> int:
    start = chance.randrange(len(contents))
    end = start + chance.randrange(1, len(contents) // 2)
    piece = contents[start:end]
    index = min(end, len(contents))
    contents[index:index] = piece
    return index


def zero_tail(contents: bytearray, chance: random.Random) -> int:
    index = chance.randrange(len(contents))
    contents[index:] = bytes(len(contents) - index)
    return index


def zero_page(contents: bytearray, chance: random.Random) -> int:
    index = chance.randrange(len(contents))
    contents[index : index + 4096] = bytes(len(contents[index : index + 4096]))
    return index


def huge_length(contents: bytearray, chance: random.Random) -> int:
    index = chance.randrange(len(contents))
    length = chance.choice((2**60, 2**63, 2**64 - 1, 2**31, 2**32 - 1)).to_bytes(8, "little")
    contents[index : index + 8] = length[: len(contents) - index]
    return index


def empty(contents: bytearray, chance: random.Random) -> int:
    contents.clear()
    return 0


CHANGES: tuple[Callable[[bytearray, random.Random], int], ...] = (
    flip, cut, insert_garbage, double_piece, zero_tail, zero_page, huge_length, empty,
)  # fmt: skip


def corrupt(log: SoundLog, chance: random.Random) -> tuple[bytes, int, str]:
    """Returns (the corrupted bytes, the index of the first changed one, the names of the changes)."""
    contents, first, names = bytearray(log.contents), len(log.contents), []
    for _ in range(chance.choice((1, 1, 2, 3))):
        if contents:
            change = chance.choices(CHANGES, (4, 4, 4, 4, 4, 4, 4, 1))[0]
            first = min(first, change(contents, chance))
            names.append(change.__name__)
    return bytes(contents), first, "+".join(names)


def try_log(path: Path, sound: SoundLog, contents: bytes, first: int) -> tuple[str, str]:
    """Returns (the outcome, what is wrong with it or an empty text)."""
    path.write_bytes(contents)
    try:
        log_summary(read_log(path))
        outcome = "read"
    except LogError:
        outcome = "refused"
    try:
        recovered = recover_log(path)
    except LogError:
        return f"{outcome}, nothing to recover", "rows lost" if _ticks_before(sound, first) else ""
    if not recovered.path.exists():
        return f"{outcome}, removed", "" if not contents else "a file with contents was removed"
    return f"{outcome}, recovered", _wrong_with(read_log(recovered.path), sound, first)


def _wrong_with(log: Log, sound: SoundLog, first: int) -> str:
    """Returns what is wrong with a recovered log, or an empty text."""
    stored, size = log.ticks.tobytes(), TICK.layout.size
    ticks = [stored[index : index + size] for index in range(0, len(stored), size)]
    if not log.complete:
        return "recovered, but not whole"
    if len(ticks) != len(set(ticks)):
        return "a row was doubled"
    if not set(ticks) <= sound.rows:
        return "a row was invented"
    return "rows before the damage were lost" if len(ticks) < _ticks_before(sound, first) else ""


def _ticks_before(sound: SoundLog, first: int) -> int:
    return max((ticks for end, ticks in sound.safe if end <= first), default=0)


def peak_bytes() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _tried(path: Path, sound: SoundLog, contents: bytes, first: int) -> tuple[str, str]:
    """Runs `try_log` and reports exceptions as an outcome."""
    try:
        return try_log(path, sound, contents, first)
    except Exception:  # noqa: BLE001 - which must not happen is what is looked for
        return "crashed", traceback.format_exc(limit=-3)


def try_many(count: int, seed: int, folder: Path, progress: Progress) -> dict[str, Any]:
    chance = random.Random(seed)
    sound = [make_sound_log(folder / "sound.mcap", chance, finished) for finished in (True, False)]
    outcomes: Counter[str] = Counter()
    wrong: list[dict[str, Any]] = []
    slowest_s, before = 0.0, peak_bytes()
    for number in range(count):
        if number % 50 == 0:
            progress.show(number, "logs")
        log = sound[number % 2]
        contents, first, how = corrupt(log, chance)
        started_s = time.perf_counter()
        outcome, complaint = _tried(folder / "active" / f"{number}.mcap", log, contents, first)
        slowest_s = max(slowest_s, time.perf_counter() - started_s)
        outcomes[outcome] += 1
        if complaint:
            wrong.append({"number": number, "how": how, "first": first, "complaint": complaint})
        for path in folder.glob("*/*"):
            path.unlink()
    return {
        "logs": count,
        "seed": seed,
        "outcomes": dict(outcomes),
        "wrong": wrong,
        "slowest_s": round(slowest_s, 3),
        "peak_in_log_sizes": round((peak_bytes() - before) / max(len(log.contents) for log in sound), 1),
    }


def measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    (folder / "active").mkdir()
    report = try_many(options.logs, options.seed, folder, Progress(options.logs))
    reached = not report["wrong"] and report["slowest_s"] < BAR_S and report["peak_in_log_sizes"] < BAR_MEMORY
    return evaluated(report, "no crash, no hang, bounded memory, no row lost", reached)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("benchmarks.stress.corrupted_logs", __doc__)
    parser.add_argument("--logs", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    return run_benchmark(parser, arguments, measure, finds_defects=True)


if __name__ == "__main__":
    sys.exit(main())
