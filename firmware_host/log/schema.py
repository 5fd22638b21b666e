"""The layout of a log's rows: a table of fields, which defines the ros2msg text, the packing and the decoding.

A row is one ROS 2 message in CDR: four bytes of encapsulation (little-endian), then the fields in the table's order,
each aligned to its own size. The ros2msg text goes into the log file, and a log is decoded by the text that it carries:
a field that the file lacks is NaN, 0, False or an empty text, and a field that this version does not know is kept.
"""

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from typing import Any

CDR_HEADER = b"\x00\x01\x00\x00"  # CDR, little-endian, no options
FORMAT_OF = {
    "float64": "d", "float32": "f", "bool": "?", "char": "B", "byte": "B",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q",
}  # fmt: skip
TEXT = "string"
MISSING = {TEXT: "", "bool": False}  # a missing float is NaN, a missing integer 0
FIELD_LINE = re.compile(r"(\w+)(?:\[(\d+)\])?\s+(\w+)\s*(?:#\s*(.*))?")


class LayoutError(ValueError):
    """This version cannot decode the definition of a row."""


@dataclass(frozen=True)
class Field:
    """One value of a row, or a fixed-size array with one value for each of `each`. The name ends with the unit."""

    name: str
    kind: str  # a ROS 2 primitive, or TEXT in the last position of a row
    meaning: str = ""
    each: tuple[str, ...] = ()
    words: tuple[str, ...] = ()  # of an enumeration, by number from 0
    formerly: tuple[str, ...] = ()  # names of this field in older logs
    array: int = 0  # length of an array in a definition that was read from a file

    @property
    def length(self) -> int:
        """Return the number of values in an array, 0 for a plain field."""
        return self.array or len(self.each)

    @property
    def missing(self) -> Any:
        """Return the value in a log that lacks this field."""
        value: Any = nan if self.kind.startswith("float") else MISSING.get(self.kind, 0)
        return (value,) * self.length if self.length else value

    @property
    def line(self) -> str:
        """Return the field in a ros2msg definition, its meaning as a comment."""
        array = f"[{self.length}]" if self.length else ""
        return f"{self.kind}{array} {self.name}  # {self.meaning}".rstrip(" #")


class RowKind:
    """One channel of the log: its topic, its ROS 2 message name and its fields."""

    def __init__(
        self,
        topic: str,
        schema_name: str,
        fields: Sequence[Field],
        definition: str = "",
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        """`definition` is the text from a file; without it the text follows from the fields."""
        self.topic = topic
        self.schema_name = schema_name
        self.fields = tuple(fields)
        self.metadata = {field.name: " ".join(field.words) for field in fields if field.words} | dict(metadata or {})
        self.definition = definition or "".join(f"{field.line}\n" for field in fields)
        self.has_text = bool(fields) and fields[-1].kind == TEXT
        self.numbers = self.fields[:-1] if self.has_text else self.fields
        formats, self.offsets = self._align()
        self.layout = struct.Struct("<4s" + "".join(formats))
        stamps = [offset for field, offset in zip(self.numbers, self.offsets, strict=True) if field.name == "stamp_s"]
        self._stamp_offset = stamps[0] if stamps else None

    def __reduce__(self) -> Any:
        return RowKind, (self.topic, self.schema_name, self.fields, self.definition, self.metadata)

    def _align(self) -> tuple[list[str], list[int]]:
        """Return the formats of `struct` with padding, and each field's position in the row."""
        formats, offsets, end = [], [], 0
        for field in self.numbers:
            size = struct.calcsize(f"<{FORMAT_OF[field.kind]}")
            padding = -end % size
            formats.append(f"{padding}x" * bool(padding) + f"{field.length or 1}{FORMAT_OF[field.kind]}")
            offsets.append(len(CDR_HEADER) + end + padding)
            end += padding + size * (field.length or 1)
        return formats, offsets

    def offset_of(self, name: str) -> int:
        """Return the position of a field's first byte in a row."""
        return dict(zip((field.name for field in self.numbers), self.offsets, strict=True))[name]

    def fits(self, row: bytes) -> bool:
        """Return whether a row has the length of this layout; a text may be of any length."""
        return len(row) >= self.layout.size if self.has_text else len(row) == self.layout.size

    def stamp_s(self, row: bytes) -> float:
        """Return the monotonic time of a row; NaN where it has none."""
        if self._stamp_offset is None or len(row) < self._stamp_offset + 8:
            return nan
        return float(struct.unpack_from("<d", row, self._stamp_offset)[0])

    def encode(self, *values: Any) -> bytes:
        """Pack values in the order of the fields, arrays spread out, a text last."""
        if not self.has_text:
            return self.layout.pack(CDR_HEADER, *values)
        text: bytes = values[-1].encode() + b"\x00"
        fixed = self.layout.pack(CDR_HEADER, *values[:-1])
        padding = b"\x00" * (-(len(fixed) - len(CDR_HEADER)) % 4)
        return fixed + padding + struct.pack("<I", len(text)) + text

    def encode_named(self, **values: Any) -> bytes:
        """Pack the given fields; the others have the value of a missing one."""
        flat: list[Any] = []
        for field in self.fields:
            value = values.get(field.name, field.missing)
            flat.extend(value if field.length else [value])
        return self.encode(*flat)

    def decode(self, row: bytes) -> dict[str, Any]:
        """Return the values by field name, arrays as tuples. Raises struct.error where the row is too short."""
        flat = self.layout.unpack_from(row)[1:]
        values: dict[str, Any] = {}
        start = 0
        for field in self.numbers:
            values[field.name] = flat[start : start + field.length] if field.length else flat[start]
            start += field.length or 1
        if self.has_text:
            text = self.layout.size + -(self.layout.size - len(CDR_HEADER)) % 4
            (length,) = struct.unpack_from("<I", row, text)
            values[self.fields[-1].name] = row[text + 4 : text + 3 + length].decode(errors="replace")
        return values


def read_definition(own: RowKind, definition: str) -> RowKind:
    """Return the row kind of a file, its fields under the names of this version. Raises LayoutError."""
    present = {field.name: field for field in own.fields}
    renamed = {former: field.name for field in own.fields for former in field.formerly}
    fields = list(_parse_fields(definition))
    names = {field.name for field in fields}
    fields = [
        Field(renamed.get(field.name, field.name), field.kind, array=field.array)
        if renamed.get(field.name) not in names
        else field
        for field in fields
    ]
    for field in fields[:-1]:
        if field.kind == TEXT:
            raise LayoutError(f"{own.topic} has the text {field.name} before its last field")
    for field in fields:
        known = present.get(field.name, field)
        if (known.length, known.kind == TEXT) != (field.length, field.kind == TEXT):
            raise LayoutError(f"{own.topic} has the field '{field.line}', this version reads '{known.line}'")
    return RowKind(own.topic, own.schema_name, fields, definition, own.metadata)


def _parse_fields(definition: str) -> Iterator[Field]:
    for line in filter(None, (line.split("#")[0].strip() for line in definition.splitlines())):
        found = FIELD_LINE.fullmatch(line)
        if not found or (found[1] not in FORMAT_OF and found[1] != TEXT):
            raise LayoutError(f"the definition has the field '{line}', whose type is unknown")
        yield Field(found[3], found[1], array=int(found[2] or 0))
