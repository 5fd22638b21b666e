"""Every key of the configuration file with its unit, bounds, default and meaning, read out of the records themselves.

The documentation's reference is generated from this list, so it cannot differ from what the reader enforces.
"""

import json
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from control.bounds import Bounds, Meaning, unit_of
from drivers.drive import DriveParameters
from drivers.drive_types import DEFAULT, DRIVE_TYPES
from firmware_host.configuration.configuration import Configuration


class Key(NamedTuple):
    section: str  # "limits", "drive.NAME" for each joint's table, "[watchdog_endpoints]" for a table of an array
    name: str
    kind: str  # "float", "int", "str", "bool", "table" or the accepted words
    unit: str  # empty where the key is no number
    bounds: Bounds | None
    default: Any  # MISSING where the file has to give it
    meaning: str


def configuration_keys(record: type = Configuration, section: str = "") -> Iterator[Key]:
    """Yield all keys, section by section in the order of the records; a section's own keys before its tables."""
    hints = get_type_hints(record, include_extras=True)
    for item in sorted(fields(record), key=lambda item: _record_of(hints[item.name]) is not None):
        inner, path = _record_of(hints[item.name]), f"{section}.{item.name}".lstrip(".")
        if inner:
            wrapped = {dict: f"{path}.NAME", list: f"[{path}]"}
            yield from configuration_keys(inner, wrapped.get(get_origin(hints[item.name]), path))
        elif section:  # the file's own text is a field of the configuration and no key
            yield _key(section, item.name, hints[item.name], item.default)


def _record_of(hint: Any) -> type | None:
    inner = get_args(hint)[-1] if get_origin(hint) in (dict, list) else hint
    inner = DRIVE_TYPES[DEFAULT].parameters if inner is DriveParameters else inner
    return inner if isinstance(inner, type) and is_dataclass(inner) else None


def _key(section: str, name: str, hint: Any, default: Any) -> Key:
    kind, *extras = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    meaning = next((extra for extra in extras if isinstance(extra, Meaning)), Meaning(""))
    bounds = next((extra for extra in extras if isinstance(extra, Bounds)), None)
    unit = unit_of(name, meaning) if bounds else ""
    return Key(section, name, _kind_text(kind), unit, bounds, default, meaning.text)


def _kind_text(kind: Any) -> str:
    if get_origin(kind) is Literal:
        return ", ".join(repr(word) for word in get_args(kind))
    if get_origin(kind) in (dict, tuple):
        return "table" if get_origin(kind) is dict else "array"
    if get_origin(kind) is UnionType:  # a key without default that may be left out
        kind = get_args(kind)[0]
    return "str or list" if kind is object else kind.__name__


def is_required(key: Key) -> bool:
    return key.default is MISSING and key.kind != "table"


def toml_value(value: object) -> str:
    """Return a value as the file states it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else f"{value:.10g}"
