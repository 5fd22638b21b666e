"""Peak memory and time per row of the commands that read logs, for two lengths: neither may grow with the length.

A lockstep walk of `--walk` seconds is repeated, with continued tick numbers and times, into a log of `--short` walks
and one of `--long` walks, which the daemon's own writer writes. Each command then reads each of them as a process of
its own. The bare figures depend on the computer; the ratios of the long log to the short one hardly do. A command that
loads a whole log has a ratio of memory near that of the lengths.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from control.controller import WalkOrder
from firmware_host.log.log_file import LogFile
from firmware_host.log.rows import ROW_KINDS, TICK_KIND
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track
from verification.benchmark import evaluated, run_benchmark, show_progress
from verification.example_robot import load_example
from verification.faults.failing_robot import RowList

BAR_MEMORY, BAR_TIME = 1.5, 1.3
KIB_PER_MIB = 1024
COMMANDS = {  # the words before and after the log
    "info": (("log", "info"), ()),
    "replay": (("replay",), ()),
    "plot": (("plot",), ("--out", "plot.png")),
    "csv": (("log", "export", "--csv"), ("--out", "log.csv")),
    "parquet": (("log", "export", "--parquet"), ("--out", "tables")),
    "report": (("log", "report"), ("--out", "report")),
}
Record = tuple[int, bytes]


def record_walk(duration_s: float) -> list[Record]:
    """Return the rows from the start of the walk."""
    configuration, recorder = load_example(), RowList()
    robot = Lockstep(configuration, paper_track(), recorder=recorder)
    robot.arm()
    recorder.rows.clear()
    robot.walk(WalkOrder(configuration.adaptation.initial_depth_m))
    robot.run_for(duration_s)
    return recorder.rows


def repeated(rows: list[Record], times: int) -> Iterator[Record]:
    """Yield the rows again and again, with continued tick numbers and times."""
    decoded = [(ROW_KINDS[number], number, ROW_KINDS[number].decode(row)) for number, row in rows]
    first, *_, last = (values for _, number, values in decoded if number == TICK_KIND)
    ticks = last["tick"] - first["tick"] + 1
    length_s = (last["stamp_s"] - first["stamp_s"]) * ticks / (ticks - 1)
    for turn in range(times):
        shifts = {"tick": turn * ticks, "stamp_s": turn * length_s, "t_start_s": turn * length_s}
        for kind, number, values in decoded:
            shifted = {name: values[name] + shift for name, shift in shifts.items() if name in values}
            yield number, kind.encode_named(**values | shifted)


def write_log(path: Path, rows: list[Record], times: int) -> int:
    """Return the number of rows."""
    opening = {
        "wall_minus_monotonic_ns": 0,
        "configuration_text": load_example().text,
        "metadata": {"robot": "repeated walk"},
    }
    log = LogFile(path, opening)
    for row in repeated(rows, times):
        log.write([row])
    log.finish()
    return log.rows


def run_command(name: str, log: Path) -> tuple[float, float]:
    """Return the peak memory in MiB and the processor time in s of a command."""
    before, after = COMMANDS[name]
    process = subprocess.Popen(
        [sys.executable, "-m", "command_line.main", *before, str(log), *after],
        cwd=log.parent,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        stdout=subprocess.DEVNULL,
    )
    _, status, used = os.wait4(process.pid, 0)
    if code := os.waitstatus_to_exitcode(status):
        raise SystemExit(f"{name} of {log.name} ended with status {code}")
    return used.ru_maxrss / KIB_PER_MIB, used.ru_utime + used.ru_stime


def measure(
    folder: Path, *, walk: float = 20.0, short: int = 6, long: int = 24, commands: str = ",".join(COMMANDS)
) -> dict[str, Any]:
    rows = record_walk(walk)
    logs = [folder / "short.mcap", folder / "long.mcap"]
    lengths = [write_log(log, rows, times) for log, times in zip(logs, (short, long), strict=True)]
    names = commands.split(",")
    figures = {}
    for number, name in enumerate(names):
        show_progress(number, len(names), name)
        figures[name] = _compared([run_command(name, log) for log in logs], lengths)
    ratios = [max(figure[name] for figure in figures.values()) for name in ("memory_ratio", "row_time_ratio")]
    report = {"rows": lengths, "commands": figures, "bar_memory_ratio": BAR_MEMORY, "bar_row_time_ratio": BAR_TIME}
    bar = f"{long / short:g} times the rows take at most {BAR_MEMORY:g} times the memory, {BAR_TIME:g} the time a row"
    return evaluated(report, bar, ratios[0] <= BAR_MEMORY and ratios[1] <= BAR_TIME)


def _compared(used: list[tuple[float, float]], rows: list[int]) -> dict[str, Any]:
    peaks_mib = [peak_mib for peak_mib, _ in used]
    rows_us = [1e6 * time_s / count for (_, time_s), count in zip(used, rows, strict=True)]
    return {
        "peak_mib": [round(peak_mib, 1) for peak_mib in peaks_mib],
        "row_us": [round(row_us, 1) for row_us in rows_us],
        "memory_ratio": round(peaks_mib[1] / peaks_mib[0], 2),
        "row_time_ratio": round(rows_us[1] / rows_us[0], 2),
    }


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
