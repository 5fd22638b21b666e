"""The robot that a daemon controls, through the daemon's socket and from the logs that it leaves on this computer.

From its first question to its end this program holds a dead man's lease, and renews it whenever it waits: where it
dies or hangs, the daemon stops the robot, and as long as it is there nobody else arms a robot under the hands of
whoever levels the mud. The log is read while it is being written; the writer's last rows come half a second late.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import Any

from experiments.robot.bench_errors import AccessDeniedError, BenchError, DaemonLostError, RobotInUseError
from experiments.robot.bench_robot import ENERGISED, UNDER_WAY, Status
from experiments.robot.log_copies import copy_since, cut_log
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import why_not
from firmware_host.configuration.loading import parse_configuration
from firmware_host.configuration.toml_records import ConfigurationError
from firmware_host.log.log_folder import run_files
from firmware_host.log_reading.log_reader import Log, LogError, read_logs
from firmware_host.operator.lease import TAKEN_OVER
from firmware_host.operator.status_client import CallRefusedError, NoDaemonError, NotPermittedError, StatusClient

PROMISE_S = 2.0  # of the lease, while torque may be on
RESTING_S = 10.0  # and while it is off: reading a log may take some time, and nothing has to be stopped
RENEWAL_S = 0.2
WRITTEN_S = 10.0  # to wait for rows that are on their way to the disk
MOTIONS = ("arm", "walk", "move")  # that begin under the lease, not before it
ENDINGS = ("clear", "stop", "disarm")  # not of a robot that another program operates
START_IT = "Start it with 'systemctl start mudskipper', or name its socket with --socket."


class DaemonRobot:
    """A BenchRobot. Owns the connection."""

    def __init__(self, socket: Path) -> None:
        """Raises BenchError where there is no daemon, it does not let this user drive, or somebody else drives.

        So it does where this user may drive and not read the log: before anything moves, not after.
        """
        try:
            self._client = StatusClient(socket)
        except NoDaemonError as problem:
            raise DaemonLostError(f"{problem}. {START_IT}") from problem
        except NotPermittedError as problem:
            raise AccessDeniedError(str(problem)) from problem
        self._renewed_s = -inf
        self._seen_s = inf  # the robot's clock, as last told
        self._used_s = inf  # by it, since when this program has moved the robot or read its log
        self._log: Path | None = None  # as last seen
        self._name: str | None = None  # of this program, as the daemon calls who holds a lease
        self._may_move = False
        self._ousted = ""  # why it operates the robot no more
        try:
            self._require_at_rest()
            self._renew()
            self.configuration = self._read_configuration()
        except (BenchError, ConfigurationError):
            self._give_back()
            self._client.close()
            raise

    def _give_back(self) -> None:
        """The lease, where it has it: whoever's robot was armed meanwhile is left as it is."""
        if self._name:
            with suppress(BenchError, CallRefusedError):
                self.call("release")

    def _require_at_rest(self) -> None:
        """Before the lease: to take it and then go away would stop a walk that somebody has begun without one."""
        self._require_alone()
        mode = self.call("status")["mode"]
        if mode in UNDER_WAY:
            raise BenchError(f"the robot is {mode}: wait for its end, or 'mudskipper stop' it, then begin again")

    def _read_configuration(self) -> Configuration:
        """As the daemon runs with it, from its log."""
        log = self._awaited(lambda: self._read(self._segments()[-1:], from_s=inf))
        return parse_configuration(log.configuration_text)

    def call(self, method: str, **params: Any) -> Any:
        if method in MOTIONS:
            self._may_move = True
            self._promise()
        elif method in ENDINGS:
            self._require_alone()
        self._may_move = self._may_move and method != "disarm"
        try:
            answer = self._client.call(method, **params)
        except NoDaemonError as problem:
            raise DaemonLostError(str(problem)) from problem
        except NotPermittedError as problem:
            raise AccessDeniedError(str(problem)) from problem
        if method in MOTIONS:  # and was not refused
            self._used_s = min(self._used_s, self._seen_s)
        return answer

    def wait(self, duration_s: float) -> None:
        if self._ousted:
            raise RobotInUseError(self._ousted)
        end_s = time.monotonic() + duration_s
        while (left_s := end_s - time.monotonic()) > 0.0:
            time.sleep(min(left_s, RENEWAL_S))
            self._renew()

    def _renew(self) -> None:
        if time.monotonic() - self._renewed_s > RENEWAL_S:
            self._promise()

    def _promise(self) -> None:
        """Refused where the lease was lost, which the status tells, and where another program operates the robot.

        Raises RobotInUseError for that.
        """
        self._renewed_s = time.monotonic()
        self._require_alone()
        try:
            self.call("lease", for_s=PROMISE_S if self._may_move else RESTING_S)
            self._name = self._name or self.call("status")["lease"]
        except CallRefusedError as refusal:
            if str(refusal).startswith(TAKEN_OVER):
                self._ousted = str(refusal)
            self._require_alone()

    def _require_alone(self) -> None:
        if self._ousted:
            raise RobotInUseError(self._ousted)
        status = self.call("status")
        self._seen_s = status["now_s"]
        if status["lease"] not in (None, self._name):
            raise RobotInUseError(f"{status['lease']} operates the robot: wait until it has ended, then begin again")
        if self._name and status["lease"] is None and status["mode"] in ENERGISED and not _winds_up(status):
            self._ousted = self._why_ousted()
            raise RobotInUseError(self._ousted)

    def _why_ousted(self) -> str:
        """A lease that is had for the asking has only lapsed: it is given back at once, the robot left as it is."""
        try:
            self.call("lease", for_s=RESTING_S)
            self.call("release")
        except CallRefusedError as refusal:
            return str(refusal)
        return "somebody has armed the robot while this program slept: begin again when it is free"

    def record(self, from_s: float, to_s: float) -> Log:
        def written() -> Log | None:
            log = self._read_since(from_s)
            return log if log is not None and len(log.ticks) and log.ticks["stamp_s"][-1] >= to_s else None

        log = cut_log(self._awaited(written), from_s, to_s)
        self._used_s = min(self._used_s, from_s)
        return log

    def _awaited(self, written: Callable[[], Log | None]) -> Log:
        deadline_s = time.monotonic() + WRITTEN_S
        while (log := written()) is None:
            if time.monotonic() > deadline_s:
                raise BenchError("the log does not hold what was just done: 'mudskipper status' tells how it is")
            self.wait(RENEWAL_S)
        return log

    def _read_since(self, from_s: float) -> Log | None:
        """As few of the run's last segments as hold it; None where one was just moved to its place."""
        segments = self._segments()
        for count in range(1, len(segments) + 1):
            log = self._read(segments[-count:], from_s)
            if log is None or (len(log.ticks) and log.ticks["stamp_s"][0] <= from_s):
                return log
        return log

    def _read(self, segments: list[Path], from_s: float) -> Log | None:
        """None where one was only just made, or has gone: a segment that is whole moves to another folder."""
        try:
            return read_logs(segments, lambda what, done, total: self._renew(), from_s)  # a minute's rows take a second
        except LogError as problem:
            if not all(segment.exists() and segment.stat().st_size for segment in segments):
                return None
            raise BenchError(f"the daemon's log cannot be read: {problem}") from problem

    def _segments(self) -> list[Path]:
        path = self.call("status")["log"]["path"]
        if path is None:
            raise BenchError("the daemon writes no log: set log.enabled = true in its configuration")
        self._log = Path(path)
        end_s = time.monotonic() + WRITTEN_S
        while not (segments := _files_of(Path(path))):  # its writer has only just started
            if time.monotonic() > end_s:
                raise BenchError(f"the daemon's log {path} is not on this computer")
            self.wait(RENEWAL_S)
        return segments

    def copy_logs(self, folder: Path) -> list[Path]:
        """Of the daemon's run, even where it has ended meanwhile, what holds any time of this program's; else none."""
        if self._used_s == inf:
            return []
        segments = self._segments_at_last()
        try:
            return copy_since(segments, self._used_s, folder)
        except LogError as problem:
            raise BenchError(f"the daemon's log cannot be copied: {problem}") from problem
        except OSError as problem:
            stays = f"it stays in {segments[-1].parent.parent}, copy it from there"
            raise BenchError(f"the daemon's log cannot be copied: {why_not(problem, folder)}; {stays}") from problem

    def _segments_at_last(self) -> list[Path]:
        try:
            return self._segments()
        except BenchError:
            if self._log is None:
                raise
            return _files_of(self._log)

    def close(self) -> None:
        """A robot that somebody else operates is left to them."""
        with suppress(BenchError, CallRefusedError):
            if self.call("status")["mode"] in ("hold", *UNDER_WAY):
                self.call("stop")
                self.wait(RENEWAL_S)  # a request waits for its tick
            self._wait_for_hold()
            self.call("disarm")
            self.call("release")
        self._client.close()

    def _wait_for_hold(self) -> None:
        """Flippers in the mud are raised before torque goes off."""
        end_s = time.monotonic() + WRITTEN_S
        while self.call("status")["mode"] in UNDER_WAY and time.monotonic() < end_s:
            self.wait(RENEWAL_S)


def _files_of(log: Path) -> list[Path]:
    try:
        return run_files(log)
    except PermissionError as problem:
        raise AccessDeniedError(
            f"you may operate the robot, but not read its log, which every experiment does: have root add you to the"
            f" group of {problem.filename}, then log in again"
        ) from problem


def _winds_up(status: Status) -> bool:
    """Where a lease was lost under torque, the robot stops and is nobody's until its torque is off."""
    return any(fault["name"] == "lease_lost" for fault in status["faults"])
