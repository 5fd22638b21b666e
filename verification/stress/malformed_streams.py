"""Byte streams that a hostile, broken or hasty client may send, derived from valid requests or drawn at random.

Each begins with valid requests, which must be answered whether or not the rest is valid.
"""

from collections.abc import Callable
from random import Random
from typing import Any, NamedTuple

import msgpack

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


def next_stream(chance: Random) -> Stream:
    kind, valid = chance.choice(list(KINDS)), chance.choice((0, 0, 1, 1, 2, 4))
    prefix = b"".join(msgpack.packb([0, number + 1, "hello", {}]) for number in range(valid))
    data = prefix + KINDS[kind](chance)
    cuts = sorted(chance.randrange(len(data) + 1) for _ in range(chance.choice((0, 0, 0, 0, 1, 2, 3))))
    return Stream(kind, valid, [data[low:high] for low, high in zip([0, *cuts], [*cuts, len(data)], strict=True)])


def requests(chance: Random, fewest: int, most: int) -> bytes:
    return b"".join(msgpack.packb(request(chance)) for _ in range(chance.randint(fewest, most)))


def request(chance: Random) -> list[Any]:
    names = chance.sample(PARAMS, chance.randint(0, 2))
    params = {name: chance.choice((0, 1, 5, 0.02, 0.5, None)) for name in names}
    return [0, chance.randrange(100, 2**32), chance.choice(METHODS), params]


def malformed_values(chance: Random) -> bytes:
    message = request(chance)
    message[3] = {name: chance.choice(VALUES) for name in PARAMS}
    if chance.random() < 0.3:
        message[chance.randrange(4)] = chance.choice(VALUES)
    if chance.random() < 0.1:
        message.insert(chance.randrange(5), chance.choice(VALUES))
    return bytes(msgpack.packb(message))


def mutated(chance: Random, fewest: int, most: int) -> bytes:
    """Replaces, inserts and removes bytes of requests."""
    data = bytearray(requests(chance, fewest, most))
    for _ in range(chance.randint(1, 5)):
        index, removed, inserted = chance.randrange(len(data) + 1), *chance.choice(((1, 1), (0, 3), (3, 0)))
        data[index : index + removed] = chance.randbytes(inserted)
    return bytes(data)


def truncated(chance: Random) -> bytes:
    data = requests(chance, 1, 3)
    return data[: chance.randrange(len(data))]


def nested(chance: Random) -> bytes:
    return (chance.choice(HEADERS) * chance.randint(1, 1500))[:6000] + requests(chance, 0, 1)


KINDS: dict[str, Callable[[Random], bytes]] = {
    "random": lambda chance: chance.randbytes(chance.randrange(300)),
    "mutated": lambda chance: mutated(chance, 1, 3),
    "truncated": truncated,
    "concatenated": lambda chance: requests(chance, 2, 6) + mutated(chance, 1, 6),
    "nested": nested,
    "malformed values": malformed_values,
    "valid": lambda chance: b"",
}
