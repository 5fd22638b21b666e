"""Writes a log once more, with standard ROS 2 messages next to its own rows.

The standard messages would make every log larger by more than a fifth (docs/how-to/open_data.md has the number), so an
export adds them.
"""

import heapq
from collections.abc import Iterable, Iterator
from itertools import chain, tee
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.writer import CompressionType, Writer

from control.geometry import FlipperGeometry
from control.records import Rig
from firmware_host.log.log_file import ATTACHMENT, EXPORTED, METADATA
from firmware_host.log.rows import EVENT, STRIDE, TICK, row_kinds, tick_kind
from firmware_host.log.schema import CDR_HEADER
from logs.export.ros_definitions import full_definition, schema_name
from logs.export.ros_messages import topics_of
from logs.export.standard_messages import StandardMessages
from logs.files.log_error import Watch, unwatched
from logs.files.log_reader import AnyLog, TickPass
from logs.files.tick_array import Ticks, tick_type
from logs.files.whole_files import whole_file

LATEST_NS = (1 << 31) * 1_000_000_000 - 1


class _Message(NamedTuple):
    stamp_s: float
    topic: str
    data: bytes


def write_ros_log(log: AnyLog, geometry: FlipperGeometry, path: Path, watch: Watch = unwatched) -> None:
    """Writes the whole file or nothing. Raises OSError, and LogError: LogCutError after the rows before the cut."""
    offset_ns = int(log.metadata.get("wall_minus_monotonic_ns", "0"))
    with whole_file(path) as hidden, hidden.open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start(profile="ros2", library="mudskipper")
        writer.add_metadata(METADATA, log.metadata | {EXPORTED: "ros"})
        writer.add_attachment(0, 0, ATTACHMENT, "application/toml", log.configuration_text.encode())
        channels = _register(writer, log.rig)
        read = TickPass(log, watch, "ticks written")
        own, others = tee(read)
        messages = heapq.merge(
            _own_rows(log, own), _standard(log, others, geometry, offset_ns), key=lambda message: message.stamp_s
        )
        for message in messages:
            time_ns = _wall_ns(message.stamp_s, offset_ns)
            writer.add_message(channels[message.topic], time_ns, message.data, time_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    read.raise_cut()


def _register(writer: Writer, rig: Rig) -> dict[str, int]:
    """Returns the channel of each topic."""
    kinds = {kind.topic: (kind.schema_name, kind.definition) for kind in row_kinds(rig)}
    standard = {topic: (schema_name(message), full_definition(message)) for topic, message in topics_of(rig).items()}
    schemas = {
        name: writer.register_schema(name, "ros2msg", text.encode()) for name, text in (kinds | standard).values()
    }
    return {
        topic: writer.register_channel(topic, "cdr", schemas[name]) for topic, (name, _) in (kinds | standard).items()
    }


def _wall_ns(stamp_s: float, offset_ns: int) -> int:
    """Returns the universal time of a row; a header cannot hold a time after 2038."""
    since_ns = round(stamp_s * 1e9) if abs(stamp_s) < 1e9 else 0
    return min(max(0, offset_ns + since_ns), LATEST_NS)


def _own_rows(log: AnyLog, blocks: Iterable[Ticks]) -> Iterator[_Message]:
    ticks = (_Message(*row) for block in blocks for row in _encoded(block, log.rig))
    strides = (_Message(row["stamp_s"], STRIDE.topic, STRIDE.encode_named(**row)) for row in log.strides)
    events = (_Message(row["stamp_s"], EVENT.topic, EVENT.encode_named(**row)) for row in log.events)
    return heapq.merge(ticks, strides, events, key=lambda message: message.stamp_s)


def _encoded(ticks: Ticks, rig: Rig) -> Iterator[tuple[float, str, bytes]]:
    rows = np.zeros(len(ticks), tick_type(tick_kind(rig)))
    for name in rows.dtype.names or ():
        rows[name] = ticks[name]
    stored, size = rows.tobytes(), rows.dtype.itemsize
    for begin, stamp_s in zip(range(0, len(stored), size), ticks["stamp_s"].tolist(), strict=True):
        yield stamp_s, TICK.topic, CDR_HEADER + stored[begin + len(CDR_HEADER) : begin + size]


def _standard(log: AnyLog, blocks: Iterable[Ticks], geometry: FlipperGeometry, offset_ns: int) -> Iterator[_Message]:
    standard = StandardMessages(geometry, log.rig)
    coming = sorted([*log.strides, *log.events], key=lambda row: float(row["stamp_s"]), reverse=True)
    for tick in chain.from_iterable(blocks):
        if not standard.is_due(int(tick["tick"])):
            continue
        stamp_s = float(tick["stamp_s"])
        while coming and coming[-1]["stamp_s"] <= stamp_s:
            row = coming.pop()
            (standard.add_stride if "flipper" in row else standard.add_event)(row)
        messages = standard.of_tick(_wall_ns(stamp_s, offset_ns), tick)
        yield from (_Message(stamp_s, *message) for message in messages.items())
