"""Rows of a log with the given fields; the others hold zeros."""

from typing import Any

from firmware_host.log.rows import EVENT, EVENT_KIND, TICK, TICK_KIND
from firmware_host.log.schema import RowKind

OPENING: dict[str, Any] = {
    "configuration_text": "[robot]\n",
    "metadata": {"robot": "mudskipper-1", "run_id": "run"},
    "wall_minus_monotonic_ns": 1_700_000_000_000_000_000,
}


def encode_row(kind: RowKind, **known: Any) -> bytes:
    zeros = {field.name: (0,) * field.length if field.length else 0 for field in kind.numbers}
    return kind.encode_named(**(zeros | known))


def make_tick(number: int, mode: int = 0) -> tuple[int, bytes]:
    return TICK_KIND, encode_row(TICK, stamp_s=number / 380, tick=number, mode=mode)


def make_ticks(first: int, end: int, mode: int = 0) -> list[tuple[int, bytes]]:
    return [make_tick(number, mode) for number in range(first, end)]


def make_event(text: str, stamp_s: float = 0.0) -> tuple[int, bytes]:
    return EVENT_KIND, encode_row(EVENT, stamp_s=stamp_s, text=text)
