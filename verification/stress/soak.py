"""An hour of operation without growth: the loop, its status socket and a real recorder, in accelerated lockstep.

The robot walks over a long sequence of muds. A random operator arms, walks, stops, disarms and clears through the
socket, asks and leaves, sometimes at once or without reading; parts of the robot fail at random times. As in the daemon
no garbage is collected. The simulated robot and the clients are in the same process, so their memory counts too. Rows
reach the recorder as fast as its pipe takes them, many times faster than on a robot.

After the warm-up (the loop keeps its last 200 strides, Python its free lists, each up to a bound) resident memory must
not grow by more than the bar, every descriptor and thread must be released, the logs must stay within quota plus the
file that is being written, and the files that the quota has preserved must contain every tick. Nothing traces
allocations; a collection at the end counts the cyclic garbage.
"""

import gc
import select
import socket
import sys
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import msgpack

from control.modes import Mode
from control.rate import RATE_HZ
from drivers.fault_injection.failures import Failures
from firmware_host.computer.realtime import freeze_garbage
from firmware_host.configuration.log_parameters import LogParameters
from firmware_host.fault_injection.failure_calls import with_failures
from firmware_host.log.log_folder import ACTIVE, DONE, first_path, log_files, new_run_id
from firmware_host.log.recorder import LogReport, Recorder
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.status_socket import StatusSocket
from firmware_host.sockets.user_groups import load_rights
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import DRIEST_PERCENT, WETTEST_PERCENT, clay_of_water
from simulation.mud.track import Track
from simulation.mud.unevenness import RandomStrength
from verification.benchmark import evaluated, run_benchmark, show_progress
from verification.example_robot import load_example
from verification.stress.resources import descriptors, resident_kib, threads
from verification.stress.written_rows import count_rows

BAR_KIB = 1024.0
WARM_UP_FRACTION = 0.2  # of the readings
LOG = LogParameters(segment_bytes=8_000_000, quota_bytes=40_000_000, min_free_fraction=0.0, rest_hz=0.0)
CALL_TICKS = 190  # between two calls of the operator
BY_HAND_TICKS = 1900  # between two checks for joints out of their range
FAILURE_S = 15.0  # between two failures, on average
SEGMENTS, SEGMENT_M = 100, 3.0
STAY_TICKS = (0, 50, 50, 50, 200)  # of a client
SILENT_FRACTION = 0.1  # of the clients never read
READINGS = 30
ROOM_MS = 20_000  # that the writer may take to empty its pipe
QUESTIONS = ("status", "strides", "map", "check", "hello", "failures")
DEPTHS_M = (0.02, 0.03, 0.04, 0.05)
UNHARMED = "log"  # its failures lose rows on purpose
Call = tuple[str, dict[str, Any]]


class Visitor(NamedTuple):
    connection: socket.socket
    last_tick: int
    reads: bool


class PatientRecorder(Recorder):
    """Waits for room, since a loop without a clock is faster than any writer."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._room = select.poll()
        self._room.register(self._pipe, select.POLLOUT)

    def put(self, kind_index: int, payload: bytes) -> bool:
        if not self._room.poll(ROOM_MS):
            raise RuntimeError("the log's writer takes no row any more")
        return super().put(kind_index, payload)

    def report(self) -> LogReport:
        """Omit the age of the writer's reports, which has another clock."""
        return super().report()._replace(slowest_write_s=0.0)


class SoakedRobot(Lockstep):
    """Owns socket and recorder, the operator's visits, and the counts. A seed always gives the same calls."""

    def __init__(self, folder: Path, seed: int) -> None:
        configuration = replace(load_example(), log=LOG)
        self.chance = Random(seed)
        self.logs = folder / "logs"
        run = new_run_id("soak")
        metadata = {"robot": "soak", "run_id": run}
        self.recorder = PatientRecorder(first_path(self.logs, run), configuration.text, metadata, LOG)
        failures = Failures(configuration.bus, seed)
        super().__init__(configuration, self._track(), seed, self.recorder, failures=failures)
        self._harms = [(name, str(kind)) for name, kind, _ in failures.table() if name != UNHARMED]
        calls = OperatorCalls(self.loop, [], self._now_s)
        self.socket = StatusSocket(folder / "s", {}, load_rights(configuration.status))
        self.socket.methods = with_failures(
            calls.methods, failures, self.loop.events.report, self._now_s, calls.require_own_robot
        )
        self.bugs: list[str] = []
        self.socket.report_bug = self.bugs.append
        self.visitors: list[Visitor] = []
        self.asked: Counter[str] = Counter()
        self.faults: Counter[str] = Counter()
        self.mode_ticks: Counter[str] = Counter()

    def _track(self) -> Track:
        waters = [self.chance.uniform(DRIEST_PERCENT + 1.0, WETTEST_PERCENT - 1.0) for _ in range(SEGMENTS)]
        track = Track([(SEGMENT_M, clay_of_water(water)) for water in waters], random_strength=RandomStrength(0.2))
        track.ground_at(SEGMENTS * SEGMENT_M)  # drawn as far as this, so that it does not grow on the way
        return track

    def run_for(self, duration_s: float) -> None:
        """Run with operator and failures, and then until no client is connected."""
        for _ in range(round(duration_s * RATE_HZ)):
            self.step()
            self._invite()
        while self.visitors or self.socket.counters["clients"]:
            self.step()

    def step(self) -> None:
        super().step()
        self.socket.serve(self.now_s)
        self.mode_ticks[self.loop.mode.name.lower()] += 1
        self.faults.update(fault.name for fault in self.loop.faults.begun)
        for visitor in [each for each in self.visitors if self.tick_number >= each.last_tick]:
            with suppress(BlockingIOError):
                if visitor.reads:
                    visitor.connection.recv(1 << 20)
            visitor.connection.close()
            self.visitors.remove(visitor)

    def _invite(self) -> None:
        """Let the operator and failures come at their times, and reset joints that a fault moved out of range."""
        present = self.loop.faults.present
        if self.tick_number % BY_HAND_TICKS == 0 and any(fault.name == "joint_position" for fault in present):
            for arm in self.robot.plant.arms:
                arm.reset()
        if self.tick_number % CALL_TICKS == 0:
            self._visit(self._next_call(self.loop.mode.name.lower(), bool(self.loop.faults.blocking())))
        if self.chance.random() < 1.0 / (FAILURE_S * RATE_HZ):
            component, kind = self.chance.choice(self._harms)
            for_s = round(self.chance.choice((0.02, 0.1, 0.5, 1.0)) * self.chance.uniform(0.5, 1.5), 3)
            self._visit(("fail", {"component": component, "kind": kind, "for_s": for_s}))

    def _next_call(self, mode: str, blocked: bool) -> Call:
        """Return the next call that makes sense in this mode, or a question."""
        draw = self.chance.random()
        if mode in ("fault", "damping") or (mode == "idle" and blocked):
            return "clear", {}
        if mode == "idle":
            return "arm", {}
        if mode in ("hold", "walking") and draw < 0.05:
            return "stop" if mode == "walking" and draw < 0.03 else "disarm", {}
        if mode != "hold":
            return self._question()
        depth = {"depth_m": self.chance.choice(DEPTHS_M)} if self.chance.random() < 0.3 else {}
        return "walk", {"strides": self.chance.choice((0, 0, 0, 1, 5))} | depth

    def _question(self) -> Call:
        method = self.chance.choice(QUESTIONS)
        return method, {"since": self.chance.randrange(1000)} if method == "strides" else {}

    def _visit(self, call: Call) -> None:
        calls = [call, *(self._question() for _ in range(self.chance.randrange(3)))]
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        connection.connect(str(self.socket.path))
        connection.setblocking(False)
        connection.sendall(b"".join(msgpack.packb([0, number, *each]) for number, each in enumerate(calls)))
        last_tick, reads = self.tick_number + self.chance.choice(STAY_TICKS), self.chance.random() >= SILENT_FRACTION
        self.visitors.append(Visitor(connection, last_tick, reads))
        self.asked.update(method for method, _ in calls)

    def reading(self) -> dict[str, float]:
        writer = self.recorder.writer_pid
        return {
            "at_s": round(self.now_s, 1),
            "resident_kib": resident_kib(),
            "descriptors": descriptors(),
            "threads": threads(),
            "writer_kib": resident_kib(writer),
            "writer_descriptors": descriptors(writer),
            "log_bytes": sum(path.stat().st_size for path in log_files(self.logs, ACTIVE, DONE)),
        }

    def report(self) -> dict[str, Any]:
        return {
            "simulated_s": round(self.now_s, 1),
            "strides": self.loop.learning.strides_closed,
            "walked_m": round(self.robot.plant.body_m, 2),
            "asked": dict(self.asked),
            "faults": dict(self.faults),
            "modes_s": {mode: round(ticks / RATE_HZ, 1) for mode, ticks in self.mode_ticks.items()},
            "bugs": self.bugs[:10],
            "dropped": self.recorder.dropped,
        }


def soak(folder: Path, seed: int, seconds: float) -> dict[str, Any]:
    soaked, readings = SoakedRobot(folder, seed), []
    try:
        freeze_garbage()
        for number in range(READINGS):
            show_progress(number, READINGS, "in lockstep")
            soaked.run_for(seconds / READINGS)
            readings.append(soaked.reading())
        report = soaked.report() | {"garbage": count_garbage(), "readings": readings}
        if soaked.loop.mode is Mode.BOOT:
            raise RuntimeError("the drives were never heard")
    finally:
        soaked.socket.close()
        soaked.recorder.close(60.0)
    return report | count_rows(soaked.logs)


def count_garbage() -> dict[str, Any]:
    """Count the reference cycles since collections ended, which only a collection frees."""
    gc.set_debug(gc.DEBUG_SAVEALL)
    gc.collect()
    kinds = Counter(type(each).__name__ for each in gc.garbage)
    gc.set_debug(0)
    gc.garbage.clear()
    return {"objects": sum(kinds.values()), "kinds": dict(kinds.most_common(6))}


def measure(folder: Path, *, hours: float = 1.0, seed: int = 1) -> dict[str, Any]:
    report = soak(folder, seed, 3600.0 * hours)
    after = report["readings"][int(WARM_UP_FRACTION * READINGS) :]
    growth_kib = after[-1]["resident_kib"] - after[0]["resident_kib"]
    left = {name: after[-1][name] - after[0][name] for name in ("descriptors", "threads", "writer_descriptors")}
    quota_bytes = LOG.quota_bytes + LOG.segment_bytes
    largest_log_bytes = max(reading["log_bytes"] for reading in report["readings"])
    sound = not (report["bugs"] or report["dropped"] or report["ticks_missing"] or report["files_not_whole"])
    sound = sound and growth_kib < BAR_KIB and max(left.values()) <= 0 and largest_log_bytes <= quota_bytes
    report |= {"seed": seed, "growth_kib": growth_kib, "left": left}
    report |= {"largest_log_bytes": largest_log_bytes, "quota_bytes": quota_bytes}
    bar = f"growth below {BAR_KIB:.0f} KiB, nothing left over, no row lost, logs within their quota"
    return evaluated(report, bar, sound)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
