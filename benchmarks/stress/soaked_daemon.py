"""A long operation in real time: the daemon as a process, the simulated robot as another one, and random clients.

Most clients ask and leave, one operates the robot as in lockstep, and at random times a part fails on purpose. The
kernel reports memory, descriptors and threads of the daemon and of its log's writer.
"""

from __future__ import annotations

import signal
import time
from collections import Counter
from pathlib import Path
from typing import Any

from benchmarks.local_robot import LONGEST_WAIT_S, LocalRobot, wait_for
from benchmarks.report import Progress
from benchmarks.stress.random_operator import Call, RandomOperator
from benchmarks.stress.resources import children_of
from benchmarks.stress.soaked_loop import reading_of, rows_of
from firmware_host.log.log_folder import ACTIVE, log_files
from firmware_host.operator.status_client import CallRefusedError, NoDaemonError

QUOTA_BYTES, SEGMENT_BYTES = 20_000_000, 4_000_000
LOG_LINES = f"quota_bytes = {QUOTA_BYTES}\nsegment_bytes = {SEGMENT_BYTES}\nrest_hz = 0.0\n"
ASK_S = 0.1  # between two clients
CLIENTS_PER_OPERATOR = 10  # clients between two calls of the operator
FAILURE_FRACTION = 1.0 / 150.0  # of the clients, so every 15 s
PATIENCE_READINGS = 5  # of a joint out of its range, before the robot is replaced
READINGS = 40
BUSES = ("left", "right")


class Client:
    """Owns the calls and their answers; every call has a connection of its own."""

    def __init__(self, robot: LocalRobot, seed: int) -> None:
        self._robot = robot
        self.operator = RandomOperator(BUSES, seed)
        self.asked: Counter[str] = Counter()
        self.faults: Counter[str] = Counter()
        self.refused = self.unanswered = self.replaced_robots = 0
        self.report: dict[str, Any] = {}
        self._standing: set[str] = set()
        self.helpless = 0  # readings in a row with a joint out of its range

    def ask(self, call: Call) -> Any:
        self.asked[call.method] += 1
        try:
            return self._robot.call(call.method, **call.params)
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


def soak_daemon(seconds: float, seed: int, folder: Path, progress: Progress) -> dict[str, Any]:
    robot = LocalRobot(folder, LOG_LINES)
    daemon, client = robot.start_daemon(), Client(robot, seed)
    try:
        if not wait_for(lambda: robot.call("status")["mode"] == "idle" and bool(log_files(robot.logs, ACTIVE))):
            raise RuntimeError("the daemon did not start")
        readings = _readings(client, robot, daemon.pid, seconds, progress)
        client.read_status()
        daemon.send_signal(signal.SIGTERM)
        status = daemon.wait(LONGEST_WAIT_S)
    finally:
        robot.end()
    rows = rows_of(robot.logs)
    return {
        "seconds": seconds,
        "robots": 1 + client.replaced_robots,
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
    client: Client, robot: LocalRobot, daemon: int, seconds: float, progress: Progress
) -> list[dict[str, float]]:
    readings: list[dict[str, float]] = []
    begin_s, number = time.monotonic(), 0
    while (at_s := time.monotonic() - begin_s) < seconds:
        client.step(number)
        number += 1
        if client.helpless >= PATIENCE_READINGS:
            robot.replace_robot()  # as if a person moved its joints back
            client.replaced_robots += 1
            client.helpless = 0
        if at_s >= seconds * len(readings) / READINGS:
            time.sleep(ASK_S)  # until the last client is closed
            progress.show(at_s, "in real time")
            (writer,) = children_of(daemon)[:1]
            readings.append(reading_of(at_s, daemon, writer, robot.logs))
        time.sleep(ASK_S)
    return readings
