"""A long operation in lockstep: the loop, its status socket and a real recorder, as fast as they compute.

The robot walks over a long sequence of muds. A random operator arms, walks, stops, disarms and clears through the
socket; other clients ask and leave, some at once and some without reading; parts of the robot fail at random times. As
in the daemon no garbage is collected. The simulated robot and the clients are in the same process, so their memory
counts too. Rows reach the recorder as fast as its pipe takes them, many times faster than on a robot.
"""

from __future__ import annotations

import gc
import select
import socket
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import msgpack
import numpy as np

from benchmarks.example_robot import load_example
from benchmarks.report import Progress
from benchmarks.stress.random_operator import Call, RandomOperator
from benchmarks.stress.resources import holding
from control.modes import Mode
from control.rate import RATE_HZ
from drivers.fault_injection.failures import Failures
from firmware_host.computer.realtime import freeze_garbage
from firmware_host.configuration.log_parameters import LogParameters
from firmware_host.fault_injection.failure_calls import with_failures
from firmware_host.log.log_folder import ACTIVE, DONE, first_path, log_files, new_run_id
from firmware_host.log.recorder import LogReport, Recorder
from firmware_host.log_reading.log_reader import read_log
from firmware_host.operator.lease import Lease
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.operator.rights import load_rights
from firmware_host.operator.status_socket import StatusSocket
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import DRIEST_PERCENT, WETTEST_PERCENT, clay_of_water
from simulation.mud.track import RandomStrength, Track

LOG = LogParameters(segment_bytes=8_000_000, quota_bytes=40_000_000, min_free_fraction=0.0, rest_hz=0.0)
CALL_TICKS = 190  # between two calls of the operator
BY_HAND_TICKS = 1900  # between two checks for joints out of their range
FAILURE_S = 15.0  # between two failures, on average
SEGMENTS, SEGMENT_M = 100, 3.0
PATIENCE_TICKS = 200  # of a client that waits for an answer
READINGS = 30
ROOM_MS = 20_000  # that the writer may take to empty its pipe


class PatientRecorder(Recorder):
    """Waits for room, since a loop without a clock is faster than any writer."""

    def put(self, kind_index: int, payload: bytes) -> bool:
        if not self._room.poll(ROOM_MS):
            raise RuntimeError("the log's writer takes no row any more")
        return super().put(kind_index, payload)

    def watch(self) -> None:
        self._room = select.poll()
        self._room.register(self._pipe, select.POLLOUT)

    def report(self) -> LogReport:
        """Omits the age of the writer's reports, which has another clock."""
        return super().report()._replace(slowest_write_s=0.0)


class Visitor:
    """Owns one connection: asks, waits for the answers or not, and leaves."""

    def __init__(self, path: Path, calls: list[Call], chance: Random) -> None:
        self._connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._connection.connect(str(path))
        self._connection.setblocking(False)
        for number, (method, params) in enumerate(calls):
            self._connection.send(msgpack.packb([0, number, method, params]))
        self._unpacker = msgpack.Unpacker(raw=False)
        self._waits_for, self._patience = len(calls), PATIENCE_TICKS
        self._reads = chance.random() > 0.1  # or keeps its connection and never reads
        self._hurried = chance.random() < 0.05  # and gone before the answer
        self.refused: list[str] = []

    def step(self) -> bool:
        """Returns whether the client has left."""
        self._patience -= 1
        if self._reads:
            with suppress(BlockingIOError, ConnectionResetError):
                self._unpacker.feed(self._connection.recv(65536))
        for _, _, problem, _ in self._unpacker:
            self._waits_for -= 1
            self.refused += [problem] if problem else []
        if self._hurried or self._waits_for <= 0 or self._patience <= 0:
            self._connection.close()
            return True
        return False


class SoakedLoop:
    """Owns robot, socket and recorder, and the counts."""

    def __init__(self, folder: Path, seed: int) -> None:
        configuration = replace(load_example(), log=LOG)
        self.operator = RandomOperator(list(configuration.bus), seed)
        self.chance = self.operator.chance
        self.logs = folder / "logs"
        run = new_run_id("soak")
        metadata = {"robot": "soak", "run_id": run}
        self.recorder = PatientRecorder(first_path(self.logs, run), configuration.text, metadata, LOG)
        self.recorder.watch()
        failures = Failures(configuration.bus, seed)
        self.robot = Lockstep(configuration, self._track(), seed, self.recorder, failures=failures)
        self.lease = Lease()
        calls = OperatorCalls(self.robot.loop, self.recorder, [], self._now_s)
        self.socket = StatusSocket(folder / "s", {}, load_rights(configuration.status))
        self.socket.methods = with_failures(calls.methods, failures, self.robot.loop.events.report, self._now_s)
        self.bugs: list[str] = []
        self.socket.report_bug = self.bugs.append
        self.visitors: list[Visitor] = []
        self.asked: Counter[str] = Counter()
        self.faults: Counter[str] = Counter()
        self.mode_ticks: Counter[str] = Counter()
        self.ticks = self.visits = self.refused = self.moved_by_hand = 0

    def _now_s(self) -> float:
        return self.robot.now_s

    def _track(self) -> Track:
        waters = [self.chance.uniform(DRIEST_PERCENT + 1.0, WETTEST_PERCENT - 1.0) for _ in range(SEGMENTS)]
        track = Track([(SEGMENT_M, clay_of_water(water)) for water in waters], random_strength=RandomStrength(0.2))
        track.clay_at(SEGMENTS * SEGMENT_M)  # drawn as far as this, so that it does not grow on the way
        return track

    def _move_by_hand(self) -> None:
        """Resets joints that a fault has moved out of their range."""
        for arm in self.robot.robot.plant.arms:
            arm.reset()
        self.moved_by_hand += 1

    def run_for(self, seconds: float) -> None:
        for _ in range(round(seconds * RATE_HZ)):
            self._step()

    def _step(self) -> None:
        loop = self.robot.loop
        self.robot.step()
        self.socket.serve(self.robot.now_s)
        self.ticks += 1
        self.mode_ticks[loop.mode.name.lower()] += 1
        for fault in loop.faults.begun:
            self.faults[fault.name] += 1
        self.visitors = [visitor for visitor in self.visitors if not self._is_gone(visitor)]
        if self.ticks % BY_HAND_TICKS == 0 and any(fault.name == "joint_position" for fault in loop.faults.present):
            self._move_by_hand()
        if self.ticks % CALL_TICKS == 0:
            self._visit(self.operator.next_call(loop.mode.name.lower(), bool(loop.faults.blocking())))
        if self.chance.random() < 1.0 / (FAILURE_S * RATE_HZ):
            self._visit(self.operator.failure())

    def _visit(self, call: Call) -> None:
        calls = [call, *(self.operator.question() for _ in range(self.chance.randrange(3)))]
        self.visitors.append(Visitor(self.socket.path, calls, self.chance))
        self.visits += 1
        for each in calls:
            self.asked[each.method] += 1

    def _is_gone(self, visitor: Visitor) -> bool:
        gone = visitor.step()
        if gone:
            self.refused += len(visitor.refused)
        return gone

    def settle(self) -> None:
        """Runs until no client is connected."""
        while self.visitors or self.socket.counters["clients"]:
            self.robot.step()
            self.socket.serve(self.robot.now_s)
            self.visitors = [visitor for visitor in self.visitors if not self._is_gone(visitor)]

    def close(self) -> None:
        self.socket.close()
        self.recorder.close(60.0)


def soak_loop(seconds: float, seed: int, folder: Path, progress: Progress) -> dict[str, Any]:
    soaked = SoakedLoop(folder, seed)
    try:
        readings, walked_s = _readings(soaked, seconds, progress)
        garbage = _garbage()
        if soaked.robot.loop.mode is Mode.BOOT:
            raise RuntimeError("the drives were never heard")
    finally:
        soaked.close()
    rows = rows_of(soaked.logs)
    return {
        "simulated_s": round(soaked.robot.now_s, 1),
        "walking_s": walked_s,
        "strides": soaked.robot.loop.learning.strides_closed,
        "walked_m": round(soaked.robot.robot.plant.body_m, 2),
        "moved_by_hand": soaked.moved_by_hand,
        "visits": soaked.visits,
        "asked": dict(soaked.asked),
        "refused": soaked.refused,
        "faults": dict(soaked.faults),
        "modes_s": {mode: round(ticks / RATE_HZ, 1) for mode, ticks in soaked.mode_ticks.items()},
        "bugs": soaked.bugs[:10],
        "garbage": garbage,
        "dropped": soaked.recorder.dropped,
        "quota_bytes": LOG.quota_bytes + LOG.segment_bytes,
        "readings": readings,
    } | rows


def _readings(soaked: SoakedLoop, seconds: float, progress: Progress) -> tuple[list[dict[str, float]], float]:
    readings = []
    freeze_garbage()
    for number in range(READINGS):
        progress.show(number * seconds / READINGS, "in lockstep")
        soaked.run_for(seconds / READINGS)
        soaked.settle()
        readings.append(reading_of(soaked.robot.now_s, "self", soaked.recorder.writer_pid, soaked.logs))
    return readings, round(soaked.mode_ticks["walking"] / RATE_HZ, 1)


def reading_of(at_s: float, loop: int | str, writer: int, logs: Path) -> dict[str, float]:
    own, writers = holding(loop), holding(writer)
    return {
        "at_s": round(at_s, 1),
        "resident_kib": own.resident_kib,
        "descriptors": own.descriptors,
        "threads": own.threads,
        "writer_kib": writers.resident_kib,
        "writer_descriptors": writers.descriptors,
        "log_bytes": sum(path.stat().st_size for path in log_files(logs, ACTIVE, DONE)),
    }


def _garbage() -> dict[str, Any]:
    """Counts the reference cycles since collections ended, which only a collection frees."""
    gc.set_debug(gc.DEBUG_SAVEALL)
    gc.collect()
    kinds = Counter(type(each).__name__ for each in gc.garbage)
    gc.set_debug(0)
    gc.garbage.clear()
    return {"objects": sum(kinds.values()), "kinds": dict(kinds.most_common(6))}


def rows_of(logs: Path) -> dict[str, Any]:
    """Counts the rows in the files that the quota preserved: ticks are numbered, and count the missed ones."""
    files = log_files(logs, ACTIVE, DONE)
    ticks, missing, not_whole, last = 0, 0, 0, None
    for path in files:
        log = read_log(path)
        not_whole += not log.complete
        numbers = log.ticks["tick"].astype(np.int64) - log.ticks["missed_ticks"].astype(np.int64)
        numbers = numbers if last is None else np.concatenate([last, numbers])
        missing += int(np.abs(np.diff(numbers) - 1).sum())
        ticks += len(log.ticks)
        last = numbers[-1:]
    return {"files": len(files), "files_not_whole": not_whole, "ticks_in_files": ticks, "ticks_missing": missing}
