"""Random and mutated byte streams through the status socket of a real loop: it must survive and still answer.

Each stream has a Unix connection of its own, of an operator, a reader, an unauthorised user or root, fifteen at a time;
some arrive in pieces, some hang up at once. A stream starts with valid requests, which must be answered, and continues
with bytes from benchmarks.stress.malformed_streams. A reference client next to them asks repeatedly and must be
answered within one more tick than there are clients. An exception ends the run. Times are the thread's own, so other
programs do not count. Memory is that of the whole process with garbage collection off, as in the daemon, read ten
times; the growth is that of the second half, because the walking robot fills its bounded lists in the first.
"""

from __future__ import annotations

import argparse
import socket
import sys
import time
from array import array
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgpack

from benchmarks.example_robot import load_example
from benchmarks.report import Progress, evaluated, new_parser, run_benchmark, summary_us
from benchmarks.stress.malformed_streams import MalformedStreams, Stream
from benchmarks.stress.resources import resident_kib
from control.rate import PERIOD_S
from firmware_host.computer.realtime import freeze_garbage
from firmware_host.log.recorder import NullRecorder
from firmware_host.operator.lease import Lease
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.operator.rights import Group, Peer, Rights
from firmware_host.operator.status_socket import MOST_CLIENTS, Methods, StatusSocket
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

BAR_KIB = 1024.0
AT_ONCE = MOST_CLIENTS - 1  # the reference client has the last connection
LONGEST_WAIT_TICKS = 1 + MOST_CLIENTS
LONGEST_BATCH_TICKS = 600
SAMPLES = 100_000  # of durations that are stored
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
        self.streams = MalformedStreams(seed)
        self.robot = Lockstep(load_example(), Track([(1000.0, MUDS["48.5"])]))
        lease = Lease()
        calls = OperatorCalls(self.robot.loop, NullRecorder(), [], lambda: self.now_s)
        self._next_peers = [REFERENCE]
        self.socket = StatusSocket(folder / "s", {}, RIGHTS, lambda connection: self._next_peers.pop(0))
        self.socket.methods = self._counted(calls.methods)
        self.socket.on_hang_up = lease.hang_up
        self.bugs: list[str] = []
        self.socket.report_bug = self.bugs.append
        self.now_s = 1000.0
        self.kinds: Counter[str] = Counter()
        self.valid = self.unanswered = self.answers = self.ticks = 0
        self.most_calls_a_tick = self.longest_wait_ticks = self._calls = 0
        self.durations_s = array("d", bytes(8 * SAMPLES))
        self.longest_s = 0.0
        self.reference = self._connect()
        self.tick()

    def _counted(self, methods: Methods) -> Methods:
        def counted(name: str) -> Any:
            def call(params: dict[str, Any], caller: Any) -> Any:
                self._calls += 1
                return methods[name](params, caller)

            return call

        return {name: counted(name) for name in methods}

    def _connect(self) -> socket.socket:
        client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        client.connect(str(self.socket.path))
        client.setblocking(False)
        return client

    def tick(self) -> None:
        self.now_s += PERIOD_S
        self._calls = 0
        start_s = time.thread_time()
        self.socket.serve(self.now_s)
        duration_s = time.thread_time() - start_s
        self.durations_s[self.ticks % SAMPLES] = duration_s
        self.longest_s = max(self.longest_s, duration_s)
        self.most_calls_a_tick = max(self.most_calls_a_tick, self._calls)
        self.ticks += 1

    def run_batch(self, count: int) -> None:
        self.robot.step()  # so that it executes the requests
        senders = []
        for number in range(count):
            self._next_peers.append(PEERS[number % len(PEERS)])
            senders.append(Sender(self._connect(), self.streams.next_stream(), self.streams))
        for _ in range(count):
            self.tick()
        self._ask_reference(senders)
        for _ in range(LONGEST_BATCH_TICKS):
            if all(sender.is_done() for sender in senders):
                break
            self.tick()
        for sender in senders:
            self._count(sender)
        while self.socket.counters["clients"] > 1:
            self.tick()

    def _ask_reference(self, senders: list[Sender]) -> None:
        """Asks as the reference client while the others send."""
        for sender in senders:
            sender.send()
        self.reference.send(msgpack.packb([0, 1, "status", {}]))
        answer, waited = msgpack.Unpacker(raw=False), 0
        while not any(True for _ in answer):
            self.tick()
            waited += 1
            for sender in senders:
                sender.send()
            with suppress(BlockingIOError):
                answer.feed(self.reference.recv(65536))
            if waited > LONGEST_BATCH_TICKS:
                raise RuntimeError("the reference client is not answered any more")
        self.longest_wait_ticks = max(self.longest_wait_ticks, waited)

    def _count(self, sender: Sender) -> None:
        self.kinds[sender.stream.kind] += 1
        self.answers += len(sender.answered)
        if not sender.hurried:
            self.valid += sender.stream.valid
            self.unanswered += sum(n + 1 not in sender.answered for n in range(sender.stream.valid))
        sender.client.close()

    def close(self) -> None:
        self.reference.close()
        self.socket.close()


class Sender:
    """Owns one stream in transit, and the numbers of its answered requests."""

    def __init__(self, client: socket.socket, stream: Stream, streams: MalformedStreams) -> None:
        self.client = client
        self.stream = stream
        self.hurried = streams.choose(0.1)  # hangs up as soon as it has sent all
        self.answered: list[Any] = []
        self._pieces = streams.pieces(stream.data)
        self._unpacker = msgpack.Unpacker(raw=False)
        self._closed = False

    def send(self) -> None:
        """Sends the next piece."""
        if not self._pieces:
            return
        with suppress(BrokenPipeError, ConnectionResetError, BlockingIOError):
            self.client.send(self._pieces.pop(0))
        if self.hurried and not self._pieces:
            self.client.close()
            self._closed = True

    def is_done(self) -> bool:
        """Returns whether all is sent and answered, or the connection closed."""
        self.send()
        if not self._closed:
            self._receive()
        wanted = self.stream.valid
        return not self._pieces and (self._closed or sum(n + 1 in self.answered for n in range(wanted)) == wanted)

    def _receive(self) -> None:
        try:
            data = self.client.recv(65536)
        except BlockingIOError:
            return
        except ConnectionResetError:
            data = b""
        self._closed = not data
        self._unpacker.feed(data)
        self.answered += [number for _, number, _, _ in self._unpacker]


def fuzz(streams: int, seed: int, folder: Path, progress: Progress) -> dict[str, Any]:
    bench = Bench(folder, seed)
    freeze_garbage()
    start_s = time.monotonic()
    try:
        readings = _send(bench, streams, progress)
    finally:
        bench.close()
    samples = min(bench.ticks, SAMPLES)
    return {
        "streams": streams,
        "seed": seed,
        "seconds": round(time.monotonic() - start_s, 1),
        "kinds": dict(bench.kinds),
        "ticks": bench.ticks,
        "answers": bench.answers,
        "valid_requests": bench.valid,
        "unanswered": bench.unanswered,
        "bugs": bench.bugs[:10],
        "counters": bench.socket.counters,
        "most_calls_a_tick": bench.most_calls_a_tick,
        "longest_wait_ticks": bench.longest_wait_ticks,
        "serve_us": summary_us(bench.durations_s[:samples]) | {"longest": round(1e6 * bench.longest_s, 1)},
        "readings": readings,
        "growth_kib": readings[-1]["resident_kib"] - readings[len(readings) // 2]["resident_kib"],
    }


def _send(bench: Bench, streams: int, progress: Progress) -> list[dict[str, float]]:
    """Sends all streams; returns ten readings of the process's memory."""
    sent, readings = 0, list[dict[str, float]]()
    while sent < streams:
        count = min(AT_ONCE, streams - sent)
        bench.run_batch(count)
        sent += count
        if sent >= streams * (len(readings) + 1) / 10:
            readings.append({"streams": sent, "resident_kib": resident_kib()})
        progress.show(sent, "streams")
    return readings


def reached(report: dict[str, Any]) -> bool:
    return (
        report["unanswered"] == 0
        and not report["bugs"]
        and report["most_calls_a_tick"] <= 1
        and report["longest_wait_ticks"] <= LONGEST_WAIT_TICKS
        and report["growth_kib"] < BAR_KIB
    )


def measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    report = fuzz(options.streams, options.seed, folder, Progress(options.streams))
    bar = f"every valid request answered, one a tick, no bug, memory growth below {BAR_KIB:.0f} KiB"
    return evaluated(report, bar, reached(report))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("benchmarks.stress.socket_fuzz", __doc__)
    parser.add_argument("--streams", type=int, default=200_000)
    parser.add_argument("--seed", type=int, default=1)
    return run_benchmark(parser, arguments, measure, finds_defects=True)


if __name__ == "__main__":
    sys.exit(main())
