"""Random and mutated byte streams through the status socket of a real loop: it must survive and still answer.

Each stream has a Unix connection of its own, of an operator, a reader, an unauthorised user or root, fifteen at a time;
some arrive in pieces, some hang up at once. A stream starts with valid requests, which must be answered, and continues
with what a hostile, broken or hasty client may send. A reference client next to them asks repeatedly and must be
answered within one more tick than there are clients. Memory is that of the whole process with garbage collection off,
as in the daemon.
"""

import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

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

METHODS = ("hello", "status", "strides", "map", "check", "arm", "walk", "stop", "disarm", "clear", "lease", "release")
PARAMS = ("since", "strides", "depth_m", "for_s", "what")
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 2**63, 2**64 - 1, -(2**63), 0.0, 0.02, 1e308, float("nan"), float("inf")),
    *("", "x" * 900, "\ud800".encode("utf-8", "surrogatepass"), b"\x00\xff", [], [[]], {}, {"a": {"b": []}}),
    *(msgpack.ExtType(7, b"abc"), msgpack.Timestamp(1, 2)),
)
HEADERS: tuple[bytes, ...] = (
    *(b"\xdc\x20\x00", b"\xdd\x00\x00\x20\x00", b"\xde\x20\x00", b"\xdf\xff\xff\xff\xff", b"\x81\xa1a", b"\x94"),
    *(b"\xdb\x00\x00\x10\x00", b"\xc9\x00\x00\x10\x00\x05", b"\xc6\xff\xff\xff\xff", b"\x94\x00\x01", b"\xc1"),
)


class Stream(NamedTuple):
    kind: str
    valid: int  # requests at its beginning, numbered from 1
    pieces: list[bytes]  # as they may arrive


def request(chance: Random) -> list[Any]:
    names = chance.sample(PARAMS, chance.randint(0, 2))
    params = {name: chance.choice((0, 1, 5, 0.02, 0.5, None)) for name in names}
    return [0, chance.randrange(100, 2**32), chance.choice(METHODS), params]


def requests(chance: Random, fewest: int, most: int) -> bytes:
    return b"".join(msgpack.packb(request(chance)) for _ in range(chance.randint(fewest, most)))


def malformed_values(chance: Random) -> bytes:
    message = request(chance)
    message[3] = {name: chance.choice(VALUES) for name in PARAMS}
    if chance.random() < 0.3:
        message[chance.randrange(4)] = chance.choice(VALUES)
    if chance.random() < 0.1:
        message.insert(chance.randrange(5), chance.choice(VALUES))
    return bytes(msgpack.packb(message))


def mutated(chance: Random) -> bytes:
    """Replace, insert and remove bytes of requests."""
    data = bytearray(requests(chance, 1, 8))
    for _ in range(chance.randint(1, 5)):
        index, removed, inserted = chance.randrange(len(data) + 1), *chance.choice(((1, 1), (0, 3), (3, 0)))
        data[index : index + removed] = chance.randbytes(inserted)
    return bytes(data)


def truncated(chance: Random) -> bytes:
    data = requests(chance, 1, 3)
    return data[: chance.randrange(len(data))]


KINDS: dict[str, Callable[[Random], bytes]] = {
    "random": lambda chance: chance.randbytes(chance.randrange(300)),
    "mutated": mutated,
    "truncated": truncated,
    "nested": lambda chance: (chance.choice(HEADERS) * chance.randint(1, 1500))[:6000] + requests(chance, 0, 1),
    "malformed values": malformed_values,
    "valid": lambda chance: b"",
}


def next_stream(chance: Random) -> Stream:
    kind, valid = chance.choice(list(KINDS)), chance.choice((0, 0, 1, 1, 2, 4))
    prefix = b"".join(msgpack.packb([0, number + 1, "hello", {}]) for number in range(valid))
    data = prefix + KINDS[kind](chance)
    cuts = sorted(chance.randrange(len(data) + 1) for _ in range(chance.choice((0, 0, 0, 0, 1, 2, 3))))
    return Stream(kind, valid, [data[low:high] for low, high in zip([0, *cuts], [*cuts, len(data)], strict=True)])


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
            if all(
                client.closed or not (client.pieces or _unanswered(client, stream))
                for client, stream in zip(clients, streams, strict=True)
            ):
                break
            self.tick()
        for client, stream in zip(clients, streams, strict=True):
            self.kinds[stream.kind] += 1
            self.answers += len(client.answers)
            if not client.hurried:
                self.valid += stream.valid
                unanswered = _unanswered(client, stream)
                self.bugs += [f"request {each} of a {stream.kind} stream is not answered" for each in unanswered]
            client.close()
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

    def close(self) -> None:
        self.reference.close()
        self.socket.close()


def _unanswered(client: StreamClient, stream: Stream) -> set[int]:
    return set(range(1, stream.valid + 1)) - client.answers.keys()


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
