"""`mudskipper log pull`: copies finished logs from a robot with rsync over SSH, compares them, and marks them there.

A mark is an empty file in copied/ of the robot's folder of logs, with the time of the log; the quota deletes marked
logs first. The same mark in the folder here says that a log need not be compared again. A log that was annotated on the
robot since is copied again, unless it was annotated here too; the copy before moves to .replaced/. An interrupted copy
continues with the same command.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from glob import escape
from pathlib import Path
from typing import Annotated

from command_line import exit_codes
from command_line.errors import CommandError
from command_line.json_output import Answer
from command_line.screen import complain
from experiments.reports.counted_nouns import counted
from experiments.study.option import Option
from experiments.study.values import folder
from firmware_host.log.log_folder import COPIED, DONE, ENDING, PRESERVED, is_copied, log_files, mark_of

ROBOTS_LOGS = "/var/lib/mudskipper/logs"
SILENT_S = 30  # of the network: the copy ends; rsync alone takes what it still sends for a sign of life
PLACES = [f"--include=/{name}/" for name in (DONE, PRESERVED)]  # of finished logs, here as there
RSYNC = ("rsync", "--recursive", "--times", f"--timeout={SILENT_S}", "--partial-dir=.partial")
REPLACE = ("--backup", "--backup-dir=.replaced", "--modify-window=2")  # the seconds that a FAT disk knows
SSH = f"--rsh=ssh -o ConnectTimeout={SILENT_S} -o ServerAliveInterval={SILENT_S // 3} -o ServerAliveCountMax=3"


def pull(
    robot: Annotated[str, Option("robot: or user@robot:FOLDER, or a folder here", metavar="ROBOT:[FOLDER]")],
    into: Annotated[Path, Option("for the logs", metavar="DIR", parse=folder)] = Path("robot-logs"),
) -> Answer:
    source = f"{robot}{ROBOTS_LOGS}" if robot.endswith(":") else robot.rstrip("/")
    if robot.startswith("-") or (":" not in robot and not Path(robot).is_dir()):  # ssh takes -oKEY for an option
        raise CommandError(f"{robot}: there is no such folder, and a robot's name ends with a colon: '{robot}:'")
    into.mkdir(parents=True, exist_ok=True)
    before = log_files(into, DONE, PRESERVED)
    unchanged = [path for path in before if is_copied(path, into)]
    progress = ["--info=progress2"] * sys.stderr.isatty()
    try:
        with tempfile.NamedTemporaryFile("w", encoding="utf-8", errors="surrogateescape") as known:
            known.writelines(_exclusion(path, path in unchanged) for path in before)
            known.flush()
            chosen = [f"--exclude-from={known.name}", *PLACES, f"--include=/*/*{ENDING}", "--exclude=*"]
            _rsync(source, [*progress, *REPLACE, *chosen, f"{source}/", f"{into}/"])
        for path in unchanged:
            if not is_copied(path, into):  # any more: it was replaced
                mark_of(path, into).unlink()
        logs = [path for path in log_files(into, DONE, PRESERVED) if not mark_of(path, into).exists()]
        compared = _compare(source, into, logs)
    except (CommandError, KeyboardInterrupt) as problem:
        with suppress(OSError):
            into.rmdir()  # which is refused unless nothing was copied
        copied = counted(len(log_files(into, DONE, PRESERVED)) - len(before), "new log")
        status = exit_codes.UNHEALTHY if isinstance(problem, CommandError) else exit_codes.INTERRUPTED
        raise CommandError(
            f"{str(problem) or 'stopped'}; {copied} copied, the same command continues", status=status
        ) from None
    same = [path for path in logs if compared.get(_place(path)) is True]
    different = [path.name for path in logs if compared.get(_place(path)) is False]
    _mark(source, into, same)
    complain(
        *(
            f"{name}: differs from the robot's and is not marked: move it away here, and repeat the command"
            for name in different
        )
    )
    report = {"folder": str(into), "copied": [path.name for path in same], "different": different}
    text = f"{into}: {counted(len(same), 'log')} copied, compared and marked on the robot"
    return Answer(report, text, exit_codes.UNHEALTHY if different else exit_codes.OK, "log-pull")


def _rsync(source: str, arguments: Sequence[str]) -> str:
    """Return what it prints without --info. Raises CommandError with rsync's own reason."""
    shown = sys.stderr.fileno() if "--info=progress2" in arguments else subprocess.PIPE
    command = [*RSYNC, SSH, *arguments]
    try:
        ended = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=shown,
            stderr=subprocess.PIPE,
            text=True,
            errors="surrogateescape",
            check=False,
        )
    except FileNotFoundError:
        raise CommandError("rsync is not installed here: 'apt install rsync'") from None
    if ended.returncode:
        reasons = ended.stderr.strip().splitlines() or ["it gave no reason"]
        raise CommandError(f"{source}: rsync ended with status {ended.returncode}: {reasons[0]}")
    return ended.stdout or ""


def _exclusion(log: Path, is_unchanged: bool) -> str:
    """Return rsync's pattern for a log that is here: it may have a note added here, or be preserved on one side."""
    other = PRESERVED if log.parent.name == DONE else DONE
    return f"/{other if is_unchanged else '*'}/{escape(log.name)}\n"


def _place(log: Path) -> str:
    return f"{log.parent.name}/{log.name}"


def _compare(source: str, into: Path, logs: Sequence[Path]) -> dict[str, bool]:
    """Return whether each log has the bytes of the robot's; without those that the robot does not have."""
    if not logs:
        return {}
    only = [*PLACES, *(f"--include=/*/{escape(path.name)}" for path in logs), "--exclude=*"]
    compared = ["--checksum", "--dry-run", "--existing", "-ii", "--8-bit-output", "--out-format=%i:%n", *only]
    lines = _rsync(source, [*compared, f"{source}/", f"{into}/"]).splitlines()
    return {place: change.startswith(".") for change, _, place in (line.partition(":") for line in lines)}


def _mark(source: str, into: Path, logs: Sequence[Path]) -> None:
    """Mark the logs on the robot, and then here. Raises CommandError where the robot's folder may not be written."""
    with tempfile.TemporaryDirectory() as name:
        _touch_marks(Path(name), logs)
        if logs:
            try:
                _rsync(source, [f"{name}/{COPIED}", f"{source}/"])
            except CommandError as problem:
                done = f"{counted(len(logs), 'log')} copied to {into}, but not marked on the robot"
                raise CommandError(f"{done}: {problem}; pull as a user who may write its folder of logs") from None
    _touch_marks(into, logs)


def _touch_marks(place: Path, logs: Sequence[Path]) -> None:
    (place / COPIED).mkdir(exist_ok=True)
    for path in logs:
        mark = mark_of(path, place)
        mark.touch()
        os.utime(mark, (path.stat().st_mtime,) * 2)
