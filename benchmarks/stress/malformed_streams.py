"""Byte streams that a hostile, broken or hasty client may send, derived from valid requests or drawn at random.

Each begins with valid requests, which must be answered whether or not the rest is valid.
"""

from __future__ import annotations

import random
from collections.abc import Callable
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
    b"\xdc\x20\x00",
    b"\xdd\x00\x00\x20\x00",
    b"\xde\x20\x00",
    b"\xdf\xff\xff\xff\xff",
    b"\x81\xa1a",
    b"\x94",
)
HEADERS += (b"\xdb\x00\x00\x10\x00", b"\xc9\x00\x00\x10\x00\x05", b"\xc6\xff\xff\xff\xff", b"\x94\x00\x01", b"\xc1")


class Stream(NamedTuple):
    kind: str
    valid: int  # requests at its beginning, numbered from 1
    data: bytes


class MalformedStreams:
    """Owns the random numbers; the same seed makes the same streams."""

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(seed)
        self._makers: dict[str, Callable[[], bytes]] = {
            "random": lambda: self._chance.randbytes(self._chance.randrange(300)),
            "mutated": lambda: self._mutate(self._requests(1, 3)),
            "truncated": self._truncated,
            "concatenated": lambda: self._requests(2, 6) + self._mutate(self._requests(1, 6)),
            "nested": self._nested,
            "malformed values": lambda: msgpack.packb(self._malformed_message()),
            "valid": lambda: b"",
        }

    @property
    def kinds(self) -> tuple[str, ...]:
        return tuple(self._makers)

    def next_stream(self) -> Stream:
        kind = self._chance.choice(self.kinds)
        valid = self._chance.choice((0, 0, 1, 1, 2, 4))
        prefix = b"".join(msgpack.packb([0, number + 1, "hello", {}]) for number in range(valid))
        return Stream(kind, valid, prefix + self._makers[kind]())

    def pieces(self, data: bytes) -> list[bytes]:
        """Splits a stream as it may arrive."""
        if self._chance.random() < 0.7:
            return [data]
        cuts = sorted(self._chance.randrange(len(data) + 1) for _ in range(self._chance.randint(1, 3)))
        return [data[low:high] for low, high in zip([0, *cuts], [*cuts, len(data)], strict=True)]

    def choose(self, fraction: float) -> bool:
        return self._chance.random() < fraction

    def _requests(self, fewest: int, most: int) -> bytes:
        count = self._chance.randint(fewest, most)
        return b"".join(msgpack.packb(self._request()) for _ in range(count))

    def _request(self) -> list[Any]:
        names = self._chance.sample(PARAMS, self._chance.randint(0, 2))
        params = {name: self._chance.choice((0, 1, 5, 0.02, 0.5, None)) for name in names}
        return [0, self._chance.randrange(100, 2**32), self._chance.choice(METHODS), params]

    def _malformed_message(self) -> Any:
        message = self._request()
        message[3] = {name: self._chance.choice(VALUES) for name in PARAMS}
        if self.choose(0.3):
            message[self._chance.randrange(4)] = self._chance.choice(VALUES)
        if self.choose(0.1):
            message.insert(self._chance.randrange(5), self._chance.choice(VALUES))
        return message

    def _mutate(self, data: bytes) -> bytes:
        changed = bytearray(data)
        for _ in range(self._chance.randint(1, 5)):
            index = self._chance.randrange(len(changed) + 1)
            match self._chance.randrange(3):
                case 0:
                    changed[index : index + 1] = self._chance.randbytes(1)
                case 1:
                    changed[index:index] = self._chance.randbytes(self._chance.randint(1, 4))
                case _:
                    del changed[index : index + self._chance.randint(1, 4)]
        return bytes(changed)

    def _truncated(self) -> bytes:
        data = self._requests(1, 3)
        return data[: self._chance.randrange(len(data))]

    def _nested(self) -> bytes:
        header = self._chance.choice(HEADERS)
        return (header * self._chance.randint(1, 1500))[:6000] + self._requests(0, 1)
