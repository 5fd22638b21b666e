"""Compares the log of a run with the run: it holds every tick or reports how many rows are missing, and replays equal.

The rows go to files as they do in the log's writer, but in this process.
"""

import dataclasses
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from firmware_host.configuration.log_parameters import ONE_FILE
from firmware_host.log.log_folder import DONE, first_path, log_files
from firmware_host.log.segments import LogSegments
from firmware_host.loop import Loop
from logs.files.log_reader import Log, read_logs
from logs.replay import replay_log
from tests.dst.starts import RecordedRobot

BATCH_ROWS = 200
MISSING = re.compile(r"rows missing here: (\d+)")


def write_log(folder: Path, rows: Sequence[tuple[int, bytes]], loop: Loop) -> list[Path]:
    configured = loop.configuration.log
    parameters = dataclasses.replace(
        ONE_FILE, segment_s=configured.segment_s, rest_hz=configured.rest_hz, rest_full_s=configured.rest_full_s
    )
    opening = {"configuration_text": loop.configuration.text, "metadata": {"run_id": "run", "robot": "dst"}}
    segments = LogSegments(first_path(folder, "run"), opening, parameters)
    for start in range(0, len(rows), BATCH_ROWS):
        segments.write(rows[start : start + BATCH_ROWS])
    segments.close()
    return log_files(folder, DONE)


def log_problems(folder: Path, robot: RecordedRobot) -> Iterator[str]:
    loop = robot.loop
    log = read_logs(write_log(folder, robot.rows.rows, loop))
    missing = sum(int(match[1]) for event in log.events if (match := MISSING.match(event["text"])))
    resting = robot.resting_ticks if loop.configuration.log.rest_hz == 0.0 else []  # else thinned
    absent = {*robot.energised_ticks, *resting} - set(log.ticks["tick"].tolist())
    if len(absent) > missing:
        yield f"{len(absent)} ticks are not in the log, which reports {missing} missing rows"
    if not missing:
        yield from _replay_problems(log, loop)


def _replay_problems(log: Log, loop: Loop) -> Iterator[str]:
    loop.learning.finish()  # the run may end between the units of a stride that closes
    live = [repr(dataclasses.astuple(stride.estimate)) for stride in loop.learning.strides]
    if loop.target.stride < 0 and not live:
        return
    replayed = [repr(dataclasses.astuple(stride)) for stride in replay_log(Path("log"), log).strides]
    if live != replayed:
        yield f"{len(live)} strides closed live, {len(replayed)} in the replay, and they are not the same"
