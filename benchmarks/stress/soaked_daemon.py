"""A long operation in real time: the daemon as a process, the simulated robot as another one, and random clients.

Most clients ask and leave, one operates the robot as in lockstep, and at random times a part fails on purpose. The
kernel reports memory, descriptors and threads of the daemon and of its log's writer.
"""

from __future__ import annotations

import signal
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

from benchmarks.report import Progress
from benchmarks.stress.log_kills import start
from benchmarks.stress.random_operator import Call, RandomOperator
from benchmarks.stress.resources import children_of
from benchmarks.stress.soaked_loop import reading_of, rows_of
from firmware_host.operator.status_client import CallRefusedError, NoDaemonError, StatusClient
from simulation.harness.local_setup import write_local_setup

QUOTA_BYTES, SEGMENT_BYTES = 20_000_000, 4_000_000
ASK_S = 0.1  # between two clients
CLIENTS_PER_OPERATOR = 10  # clients between two calls of the operator
FAILURE_FRACTION = 1.0 / 150.0  # of the clients, so every 15 s
LONGEST_START_S = 60.0
PATIENCE_READINGS = 5  # of a joint out of its range, before it is moved back by hand
READINGS = 40
BUSES = ("left", "right")


def write_setup(folder: Path) -> Path:
    path = write_local_setup(folder, folder / "logs")
    limits = f"quota_bytes = {QUOTA_BYTES}\nsegment_bytes = {SEGMENT_BYTES}\nrest_hz = 0.0\n"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("[log]\n", f"[log]\n{limits}"), encoding="utf-8")
    return path


class Client:
    """Owns the calls and their answers; every call has a connection of its own."""

    def __init__(self, path: Path, seed: int) -> None:
        self._path = path
        self.operator = RandomOperator(BUSES, seed)
        self.asked: Counter[str] = Counter()
        self.faults: Counter[str] = Counter()
        self.refused = self.unanswered = 0
        self.report: dict[str, Any] = {}
        self._standing: set[str] = set()
        self.helpless = 0  # readings in a row with a joint out of its range

    def ask(self, call: Call) -> Any:
        self.asked[call.method] += 1
        try:
            client = StatusClient(self._path)
            try:
                return client.call(call.method, **call.params)
            finally:
                client.close()
        except CallRefusedError:
            self.refused += 1
        except NoDaemonError:
            self.unanswered += 1
        return None

    def read_status(self) -> None:
        self.report = self.ask(Call("status", {})) or self.report
        standing = {fault["name"] for fault in self.report.get("faults", [])}
        self.faults.update(standing - self._standing)
        self._standing = standing

    def operate(self) -> None:
        self.read_status()
        self.helpless = self.helpless + 1 if "joint_position" in self._standing else 0
        blocked = any(fault["blocks_arming"] for fault in self.report["faults"])
        self.ask(self.operator.next_call(self.report["mode"], blocked))

    def step(self, number: int) -> None:
        if self.operator.chance.random() < FAILURE_FRACTION:
            self.ask(self.operator.failure())
        elif number % CLIENTS_PER_OPERATOR == 0:
            self.operate()
        else:
            self.ask(self.operator.question())


def wait_until_idle(path: Path) -> None:
    deadline_s = time.monotonic() + LONGEST_START_S
    while time.monotonic() < deadline_s:
        with suppress(NoDaemonError, OSError):
            client = StatusClient(path)
            mode = client.call("status")["mode"]
            client.close()
            if mode == "idle":
                return
        time.sleep(0.05)
    raise RuntimeError("the daemon did not start")


class Session:
    """Owns the processes of robot and daemon."""

    def __init__(self, folder: Path) -> None:
        self._configuration = write_setup(folder)
        self._robot = start("simulation.harness.peer", self._configuration)
        self.daemon = start("firmware_host.daemon", self._configuration)
        self.robots = 1

    def move_by_hand(self) -> None:
        """Replaces the robot by a new one: its joints are in range and its drives start again."""
        self._robot.kill()
        self._robot.wait()
        self._robot = start("simulation.harness.peer", self._configuration)
        self.robots += 1

    def end(self) -> None:
        for process in (self.daemon, self._robot):
            if process.poll() is None:
                process.kill()
            process.wait()


def soak_daemon(seconds: float, seed: int, folder: Path, progress: Progress) -> dict[str, Any]:
    session = Session(folder)
    client = Client(folder / "mudskipper.sock", seed)
    try:
        wait_until_idle(folder / "mudskipper.sock")
        readings = _readings(client, session, seconds, folder / "logs", progress)
        client.read_status()
        session.daemon.send_signal(signal.SIGTERM)
        status = session.daemon.wait(LONGEST_START_S)
    finally:
        session.end()
    rows = rows_of(folder / "logs")
    return {
        "seconds": seconds,
        "robots": session.robots,
        "strides": client.report["strides_closed"],
        "loop": client.report["loop"],
        "asked": dict(client.asked),
        "refused": client.refused,
        "unanswered": client.unanswered,
        "faults": dict(client.faults),
        "bugs": [] if status == 0 else [f"the daemon ended with status {status}"],
        "dropped": client.report["log"]["dropped"],
        "quota_bytes": QUOTA_BYTES + SEGMENT_BYTES,
        "readings": readings,
    } | rows


def _readings(
    client: Client, session: Session, seconds: float, logs: Path, progress: Progress
) -> list[dict[str, float]]:
    readings: list[dict[str, float]] = []
    daemon = session.daemon.pid
    begin_s, number = time.monotonic(), 0
    while (at_s := time.monotonic() - begin_s) < seconds:
        client.step(number)
        number += 1
        if client.helpless >= PATIENCE_READINGS:
            session.move_by_hand()
            client.helpless = 0
        if at_s >= seconds * len(readings) / READINGS:
            time.sleep(ASK_S)  # until the last client is closed
            progress.show(at_s, "in real time")
            (writer,) = children_of(daemon)[:1]
            readings.append(reading_of(at_s, daemon, writer, logs))
        time.sleep(ASK_S)
    return readings
