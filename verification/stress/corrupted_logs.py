"""Reading and recovery of corrupted logs: flipped bits, cuts, garbage, doubled pieces, tails of zeros.

Each log is a sound one with one to three such changes, by a seeded generator. Reading it must give a log or a one-line
refusal. Recovery must preserve every row of the chunks that end before the first changed byte, must invent none and
double none, and must write a complete log. Memory is the process's peak above that before the first log, in units of
the largest log; the slowest log shows whether anything hangs.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from control.rate import PERIOD_S
from firmware_host.log.log_file import LogFile
from firmware_host.log.rows import EVENT, EVENT_KIND, TICK, TICK_KIND
from logs.files.log_error import LogError
from logs.files.log_reader import Log, read_log
from logs.files.log_summary import log_summary
from logs.recovery import recover_log
from verification.benchmark import Report, evaluated, run_benchmark
from verification.stress.fuzz_loop import fuzz
from verification.stress.resources import peak_kib

BAR_S = 2.0  # for one log
BAR_MEMORY = 40.0  # times the largest log
OPENING = {"configuration_text": "[robot]\n" * 40, "metadata": {"robot": "x"}, "wall_minus_monotonic_ns": 10**18}
GARBAGE_BYTES = (1, 8, 100, 5000)
HUGE_LENGTHS = (2**60, 2**63, 2**64 - 1, 2**31, 2**32 - 1)
PAGE_BYTES = 4096


class SoundLog(NamedTuple):
    contents: bytes
    rows: frozenset[bytes]
    safe: tuple[tuple[int, int], ...]  # (bytes of the file, ticks before them)


def make_sound_log(path: Path, chance: Random, finished: bool) -> SoundLog:
    """Write eight chunks of ticks, each with an event."""
    log = LogFile(path, OPENING)
    rows: list[bytes] = []
    safe = []
    for number in range(400):
        rows.append(_tick_row(number, chance))
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


def _tick_row(number: int, chance: Random) -> bytes:
    """Make a row with random values and its own number, by which the reader sorts."""
    kinds = [field.kind for field in TICK.fields for _ in range(field.length or 1)]
    whole = {"uint32": number, "int32": number}
    values = [chance.random() if kind == "float64" else whole.get(kind, number % 7) for kind in kinds[1:]]
    return TICK.encode(number * PERIOD_S, *values)


# Each changes the contents from an index on.
CHANGES: dict[str, Callable[[bytearray, int, Random], Any]] = {
    "flip": lambda contents, at, chance: contents.__setitem__(at, contents[at] ^ 1 << chance.randrange(8)),
    "cut": lambda contents, at, chance: contents.__delitem__(slice(at, None)),
    "garbage": lambda contents, at, chance: _insert(contents, at, chance.randbytes(chance.choice(GARBAGE_BYTES))),
    "double": lambda contents, at, chance: _insert(contents, at, contents[chance.randrange(at + 1) : at]),
    "zero tail": lambda contents, at, chance: _replace(contents, at, bytes(len(contents))),
    "zero page": lambda contents, at, chance: _replace(contents, at, bytes(PAGE_BYTES)),
    "huge length": lambda contents, at, chance: _replace(
        contents, at, chance.choice(HUGE_LENGTHS).to_bytes(8, "little")
    ),
}


def _insert(contents: bytearray, at: int, data: bytes | bytearray) -> None:
    contents[at:at] = data


def _replace(contents: bytearray, at: int, data: bytes) -> None:
    """Replace no more than there is."""
    contents[at : at + len(data)] = data[: len(contents) - at]


def corrupt(log: SoundLog, chance: Random) -> tuple[bytes, int, str]:
    """Return (the corrupted bytes, the index of the first changed one, the names of the changes)."""
    contents, first, names = bytearray(log.contents), len(log.contents), []
    for _ in range(chance.choice((1, 1, 2, 3))):
        if contents:
            name, at = chance.choice(list(CHANGES)), chance.randrange(len(contents))
            CHANGES[name](contents, at, chance)
            first = min(first, at)
            names.append(name)
    return bytes(contents), first, "+".join(names)


def try_log(path: Path, sound: SoundLog, contents: bytes, first: int) -> tuple[str, str]:
    """Return (the outcome, what is wrong with it or an empty text)."""
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
    """Return what is wrong with a recovered log, or an empty text."""
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


def measure(folder: Path, *, logs: int = 10_000, seed: int = 1) -> Report:
    (folder / "active").mkdir()
    chance = Random(seed)
    sound = [make_sound_log(folder / "sound.mcap", chance, finished) for finished in (True, False)]
    before_kib = peak_kib()

    def try_next(number: int) -> tuple[str, list[str]]:
        contents, first, how = corrupt(sound[number % 2], chance)
        try:
            outcome, problem = try_log(folder / "active" / f"{number}.mcap", sound[number % 2], contents, first)
        finally:
            for path in folder.glob("*/*"):
                path.unlink()
        return outcome, [f"{how} from byte {first} on: {problem}"] if problem else []

    found = fuzz(logs, "logs", try_next)
    memory = 1024.0 * (peak_kib() - before_kib) / max(len(log.contents) for log in sound)
    report = found.report() | {"logs": logs, "seed": seed, "peak_in_log_sizes": round(memory, 1)}
    reached = not found.bugs and found.slowest_s < BAR_S and memory < BAR_MEMORY
    return evaluated(report, "no crash, no hang, bounded memory, no row lost", reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
