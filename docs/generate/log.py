"""Writes the topics and fields of a log from the tables of its rows."""

from __future__ import annotations

from collections.abc import Iterator

from docs.generate.markdown import code, table
from firmware_host.log.rows import ROW_KINDS
from firmware_host.log.schema import Field


def topics() -> Iterator[str]:
    for kind in ROW_KINDS:
        yield f"## {kind.topic}"
        yield ""
        yield f"Message type `{kind.schema_name}`."
        yield from table(("field", "type", "meaning"), map(_row, kind.fields))


def _row(field: Field) -> tuple[str, str, str]:
    return code(field.name), f"{field.kind}[{field.length}]" if field.length else field.kind, field.meaning
