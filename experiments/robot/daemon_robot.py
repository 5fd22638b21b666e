"""The robot of a daemon, through the daemon's socket and the logs on this computer.

From its first call to its end this program holds a lease and renews it whenever it waits. If the program dies or hangs,
the daemon stops the robot; and as long as the program runs, no other one arms a robot while its operator levels the
mud. The log is read while the daemon writes it, and the last rows arrive half a second late.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import Any

from experiments.robot.bench_errors import AccessDeniedError, BenchError, DaemonLostError, RobotInUseError
from experiments.robot.bench_robot import ENERGISED, UNDER_WAY
from experiments.robot.log_copies import copy_since, cut_log
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError, why_not
from firmware_host.configuration.loading import parse_configuration
from firmware_host.lease import TAKEN_OVER
from logs.files.log_error import LogError
from logs.files.log_reader import Log, read_logs
from logs.files.stored_logs import run_files
from operator_client.status_client import CallRefusedError, NoDaemonError, NotPermittedError, StatusClient

LEASE_S = 2.0  # while torque may be on
RESTING_LEASE_S = 10.0  # while torque is off: reading a log takes some time, and nothing has to be stopped
RENEWAL_S = 0.2
WRITTEN_S = 10.0  # longest delay of rows on their way to the disk
MOTIONS = ("arm", "walk", "move")  # need the lease
ENDINGS = ("clear", "stop", "disarm")  # refused for a robot in use
START_IT = "Start it with 'systemctl start mudskipper', or name its socket with --socket."


class DaemonRobot:
    """A BenchRobot with its own connection."""

    def __init__(self, socket: Path) -> None:
        """Connect and take the lease, before anything moves.

        Raises BenchError without a daemon, without the permission to drive or to read the log, or for a robot in use.
        """
        try:
            self._client = StatusClient(socket)
        except NoDaemonError as problem:
            raise DaemonLostError(f"{problem}. {START_IT}") from problem
        except NotPermittedError as problem:
            raise AccessDeniedError(str(problem)) from problem
        self._renewed_s = -inf
        self._robot_now_s = inf  # the robot's clock at the last status
        self._used_s = inf  # by that clock: the first motion or log of this program
        self._log: Path | None = None  # the last known path
        self._holder: str | None = None  # the daemon's name of this program
        self._may_move = False
        self._lost_reason = ""  # why the lease was lost
        try:
            self._require_at_rest()
            self._renew()
            self.configuration = self._read_configuration()
        except (BenchError, ConfigurationError):
            if self._holder:
                with suppress(BenchError, CallRefusedError):
                    self.call("release")
            self._client.close()
            raise

    def _require_at_rest(self) -> None:
        """Check before the lease: taking and releasing it would stop a walk that began without one."""
        self._require_alone()
        mode = self.call("status")["mode"]
        if mode in UNDER_WAY:
            raise BenchError(f"the robot is {mode}: wait for its end, or 'mudskipper stop', then start again")

    def _read_configuration(self) -> Configuration:
        """Return the daemon's configuration, from its log."""
        log = self._await_rows(lambda: self._read(self._segments()[-1:], from_s=inf))
        return parse_configuration(log.configuration_text)

    def call(self, method: str, **params: Any) -> Any:
        if method in MOTIONS:
            self._may_move = True
            self._lease()
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
            self._used_s = min(self._used_s, self._robot_now_s)
        return answer

    def wait(self, duration_s: float) -> None:
        if self._lost_reason:
            raise RobotInUseError(self._lost_reason)
        end_s = time.monotonic() + duration_s
        while (left_s := end_s - time.monotonic()) > 0.0:
            time.sleep(min(left_s, RENEWAL_S))
            self._renew()

    def _renew(self) -> None:
        if time.monotonic() - self._renewed_s > RENEWAL_S:
            self._lease()

    def _lease(self) -> None:
        """Ask for the lease again.

        Raises RobotInUseError where it was lost, which the status shows, or another program operates the robot.
        """
        self._renewed_s = time.monotonic()
        self._require_alone()
        try:
            self.call("lease", for_s=LEASE_S if self._may_move else RESTING_LEASE_S)
            self._holder = self._holder or self.call("status")["lease"]
        except CallRefusedError as refusal:
            if str(refusal).startswith(TAKEN_OVER):
                self._lost_reason = str(refusal)
            self._require_alone()

    def _require_alone(self) -> None:
        if self._lost_reason:
            raise RobotInUseError(self._lost_reason)
        status = self.call("status")
        self._robot_now_s = status["now_s"]
        if status["lease"] not in (None, self._holder):
            raise RobotInUseError(f"{status['lease']} operates the robot: wait for its end, then start again")
        is_lost = self._holder and status["lease"] is None and status["mode"] in ENERGISED
        stops = any(fault["name"] == "lease_lost" for fault in status["faults"])  # then no program operates it
        if is_lost and not stops:
            self._lost_reason = self._find_lost_reason()
            raise RobotInUseError(self._lost_reason)

    def _find_lost_reason(self) -> str:
        """Return the reason. A lease that is free again has only expired: it is released at once."""
        try:
            self.call("lease", for_s=RESTING_LEASE_S)
            self.call("release")
        except CallRefusedError as refusal:
            return str(refusal)
        return "the robot was armed by another program while this one was suspended: start again when it is free"

    def record(self, from_s: float, to_s: float) -> Log:
        def written() -> Log | None:
            log = self._read_since(from_s)
            return log if log is not None and len(log.ticks) and log.ticks["stamp_s"][-1] >= to_s else None

        log = cut_log(self._await_rows(written), from_s, to_s)
        self._used_s = min(self._used_s, from_s)
        return log

    def _await_rows(self, written: Callable[[], Log | None]) -> Log:
        deadline_s = time.monotonic() + WRITTEN_S
        while (log := written()) is None:
            if time.monotonic() > deadline_s:
                raise BenchError("the log does not contain the last motion: check it with 'mudskipper status'")
            self.wait(RENEWAL_S)
        return log

    def _read_since(self, from_s: float) -> Log | None:
        """Read as few of the last segments as contain the time; nothing while a segment is being moved."""
        segments = self._segments()
        for count in range(1, len(segments) + 1):
            log = self._read(segments[-count:], from_s)
            if log is None or (len(log.ticks) and log.ticks["stamp_s"][0] <= from_s):
                return log
        return log

    def _read(self, segments: list[Path], from_s: float) -> Log | None:
        """Return nothing for a segment that is new, or that is being moved to another folder."""
        try:
            return read_logs(segments, lambda what, done, total: self._renew(), from_s)  # a minute's rows take a second
        except LogError as problem:
            if not all(segment.exists() and segment.stat().st_size for segment in segments):
                return None
            raise BenchError(f"the daemon's log cannot be read: {problem}") from problem

    def _segments(self) -> list[Path]:
        path = self.call("status")["log"]["path"]
        if path is None:
            raise BenchError("the daemon writes no log: set log.enabled = true in its configuration and restart it")
        self._log = Path(path)
        end_s = time.monotonic() + WRITTEN_S
        while not (segments := _files_of(Path(path))):  # its writer has only just started
            if time.monotonic() > end_s:
                raise BenchError(f"the daemon's log {path} is not on this computer")
            self.wait(RENEWAL_S)
        return segments

    def copy_logs(self, folder: Path) -> list[Path]:
        """Copy the segments of this program's time, even after the daemon's end."""
        if self._used_s == inf:
            return []
        segments = self._segments_at_end()
        try:
            return copy_since(segments, self._used_s, folder)
        except LogError as problem:
            raise BenchError(f"the daemon's log cannot be copied: {problem}") from problem
        except OSError as problem:
            remains = f"it remains in {segments[-1].parent.parent}, copy it from there"
            raise BenchError(f"the daemon's log cannot be copied: {why_not(problem, folder)}; {remains}") from problem

    def _segments_at_end(self) -> list[Path]:
        try:
            return self._segments()
        except BenchError:
            if self._log is None:
                raise
            return _files_of(self._log)

    def leave_holding(self) -> None:
        """Release and disconnect; the robot goes on holding its pose. Raises BenchError, CallRefusedError."""
        self.call("release")
        self._client.close()

    def close(self) -> None:
        """Stop, disarm and release, unless another program operates the robot."""
        with suppress(BenchError, CallRefusedError):
            if self.call("status")["mode"] in ("hold", *UNDER_WAY):
                self.call("stop")
                self.wait(RENEWAL_S)  # a request waits for its tick
            end_s = time.monotonic() + WRITTEN_S
            while self.call("status")["mode"] in UNDER_WAY and time.monotonic() < end_s:  # flippers rise out of the mud
                self.wait(RENEWAL_S)
            self.call("disarm")
            self.call("release")
        self._client.close()


def _files_of(log: Path) -> list[Path]:
    try:
        return run_files(log)
    except PermissionError as problem:
        raise AccessDeniedError(
            f"you may operate the robot, but not read its log, which every experiment needs: have root add you to the"
            f" group of {problem.filename}, then log in again"
        ) from problem
