"""Random and mutated byte streams through the status socket of a real loop: it must survive and still answer.

Each stream has a Unix connection of its own, of an operator, a reader, an unauthorised user or root, fifteen at a time;
some arrive in pieces, some hang up at once. A stream starts with valid requests, which must be answered, and continues
with bytes from verification.stress.fuzz_loop import fuzz
from verification.stress.malformed_streams. A reference client next to them asks repeatedly and must be
answered within one more tick than there are clients. Memory is that of the whole process with garbage collection off,
as in the daemon.
"""

import sys
import time
from collections import Counter
from pathlib import Path
from random import Random
from typing import Any

import msgpack

from control.rate import PERIOD_S
from firmware_host.computer.realtime import freeze_garbage
from firmware_host.lease import Lease
from firmware_host.loop_timing import Histogram
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.rights import Group, Peer, Rights
from firmware_host.sockets.status_socket import MOST_CLIENTS, Methods, StatusSocket
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from verification.benchmark import Report, evaluated, run_benchmark
from verification.example_robot import load_example
from verification.stress.fuzz_loop import fuzz
from verification.stress.malformed_streams import Stream, next_stream
from verification.stress.stream_client import StreamClient

BAR_KIB = 1024.0
AT_ONCE = MOST_CLIENTS - 1  # the reference client has the last connection
LONGEST_WAIT_TICKS = 1 + MOST_CLIENTS
LONGEST_BATCH_TICKS = 600
HURRIED_FRACTION = 0.1  # of the streams
RIGHTS = Rights(readers=Group("viewers", 70), operators=Group("pilots", 71), own_uid=1)
REFERENCE = Peer(400, 2000, frozenset({71}))
PEERS = (
    Peer(500, 1000, frozenset({71})),
    Peer(501, 1001, frozenset({70})),
    Peer(502, 1002, frozenset({1002})),
    Peer(503, 0, frozenset({0})),
)


class Bench:
    """Owns the socket, its robot, the time, and the counts."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.chance = Random(seed)
        self.robot = Lockstep(load_example(), Track([(1000.0, MUDS["48.5"])]))
        calls = OperatorCalls(self.robot.loop, [], lambda: self.now_s)
        self._next_peers = [REFERENCE]
        self.socket = StatusSocket(folder / "s", {}, RIGHTS, lambda connection: self._next_peers.pop(0))
        self.socket.methods = self._counted(calls.methods)
        self.socket.on_hang_up = Lease().hang_up
        self.bugs: list[str] = []
        self.socket.report_bug = self.bugs.append
        self.now_s = 1000.0
        self.kinds: Counter[str] = Counter()
        self.valid = self.answers = self.ticks = 0
        self.most_calls_a_tick = self.longest_wait_ticks = self._calls = 0
        self.durations = Histogram()
        self.reference = StreamClient(self.socket.path, [])
        self.tick()

    def _counted(self, methods: Methods) -> Methods:
        def counted(name: str) -> Any:
            def call(params: dict[str, Any], caller: Any) -> Any:
                self._calls += 1
                return methods[name](params, caller)

            return call

        return {name: counted(name) for name in methods}

    def tick(self) -> None:
        self.now_s += PERIOD_S
        self._calls = 0
        start_s = time.thread_time()
        self.socket.serve(self.now_s)
        self.durations.add(time.thread_time() - start_s)
        self.most_calls_a_tick = max(self.most_calls_a_tick, self._calls)
        self.ticks += 1

    def run_batch(self, count: int) -> list[str]:
        """Send streams at once and return what is wrong with the answers."""
        known = len(self.bugs)
        self.robot.step()  # so that it executes the requests
        self._next_peers += [PEERS[number % len(PEERS)] for number in range(count)]
        streams = [next_stream(self.chance) for _ in range(count)]
        clients = [
            StreamClient(self.socket.path, stream.pieces, hurried=self.chance.random() < HURRIED_FRACTION)
            for stream in streams
        ]
        for _ in range(count):
            self.tick()
        self._ask_reference(clients)
        for _ in range(LONGEST_BATCH_TICKS):
            for client in clients:
                client.step()
            if all(map(_is_done, clients, streams)):
                break
            self.tick()
        for client, stream in zip(clients, streams, strict=True):
            self._count(client, stream)
        while self.socket.counters["clients"] > 1:
            self.tick()
        return self.bugs[known:]

    def _ask_reference(self, others: list[StreamClient]) -> None:
        """Ask as the reference client while the others send."""
        number = self.ticks
        self.reference.pieces.append(msgpack.packb([0, number, "status", {}]))
        for waited in range(LONGEST_BATCH_TICKS):
            for client in (*others, self.reference):
                client.step()
            if number in self.reference.answers:
                self.reference.answers.clear()
                self.longest_wait_ticks = max(self.longest_wait_ticks, waited)
                return
            self.tick()
        raise RuntimeError("the reference client is not answered any more")

    def _count(self, client: StreamClient, stream: Stream) -> None:
        self.kinds[stream.kind] += 1
        self.answers += len(client.answers)
        if not client.hurried:
            self.valid += stream.valid
            self.bugs += [
                f"request {each} of a {stream.kind} stream is not answered" for each in _unanswered(client, stream)
            ]
        client.close()

    def close(self) -> None:
        self.reference.close()
        self.socket.close()


def _unanswered(client: StreamClient, stream: Stream) -> set[int]:
    return set(range(1, stream.valid + 1)) - client.answers.keys()


def _is_done(client: StreamClient, stream: Stream) -> bool:
    """Return whether all is sent and answered, or the connection closed."""
    return client.closed or not (client.pieces or _unanswered(client, stream))


def measure(folder: Path, *, streams: int = 200_000, seed: int = 1) -> Report:
    bench = Bench(folder, seed)
    freeze_garbage()

    def try_batch(number: int) -> tuple[str, list[str]]:
        return "answered", bench.run_batch(min(AT_ONCE, streams - number * AT_ONCE))

    try:
        found = fuzz(-(-streams // AT_ONCE), "streams", try_batch)
    finally:
        bench.close()
    report = found.report() | {
        "streams": streams,
        "seed": seed,
        "kinds": dict(bench.kinds),
        "ticks": bench.ticks,
        "answers": bench.answers,
        "valid_requests": bench.valid,
        "counters": bench.socket.counters,
        "most_calls_a_tick": bench.most_calls_a_tick,
        "longest_wait_ticks": bench.longest_wait_ticks,
        "serve_us": bench.durations.summary(),
    }
    sound = not found.bugs and bench.most_calls_a_tick <= 1
    reached = sound and bench.longest_wait_ticks <= LONGEST_WAIT_TICKS and found.growth_kib < BAR_KIB
    bar = f"every valid request answered, one a tick, no bug, memory growth below {BAR_KIB:.0f} KiB"
    return evaluated(report, bar, reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
