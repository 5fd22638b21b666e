"""Every parameter that a configuration or world file may contain, with its bounds, taken from the records."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from control.bounds import Bounds, Meaning
from drivers.drive import DriveParameters
from drivers.drive_types import DEFAULT, DRIVE_TYPES
from firmware_host.configuration.toml_records import ChangesOf


class Parameter(NamedTuple):
    """One value that a file may contain."""

    path: tuple[str | int, ...]
    kind: type
    bounds: Bounds | None
    default: Any

    @property
    def key(self) -> str:
        """The name of the parameter in a refusal."""
        return "".join(f" {part + 1}" if isinstance(part, int) else f".{part}" for part in self.path)[1:]


def parameters_of(hint: Any, document: Any, default: Any, path: tuple[str | int, ...]) -> Iterator[Parameter]:
    """Yields all parameters under an annotation; of tables with free names and arrays, those of the document."""
    extras = get_args(hint)[1:] if get_origin(hint) is Annotated else ()
    changes = next((extra for extra in extras if isinstance(extra, ChangesOf)), None)
    if changes:
        yield from fields_of(changes.record, document, None, path, changes.without)
    elif extras and isinstance(extras[0], Bounds):
        kinds = [kind for kind in (get_args(get_args(hint)[0]) or get_args(hint)) if kind in (int, float)]
        yield Parameter(path, kinds[0], extras[0], default)
    elif extras and isinstance(extras[-1], Meaning):
        yield from parameters_of(get_args(hint)[0], document, default, path)
    elif is_dataclass(hint) and isinstance(hint, type):
        yield from fields_of(hint, document, default, path)
    elif get_origin(hint) is Literal or hint in (str, bool):
        yield Parameter(path, hint if hint is bool else str, None, default)
    elif get_origin(hint) is dict and is_dataclass(get_args(hint)[1]):
        record = get_args(hint)[1]
        record = DRIVE_TYPES[DEFAULT].parameters if record is DriveParameters else record
        for name in document or {}:
            yield from parameters_of(record, document[name], None, (*path, name))
    elif get_origin(hint) is list:
        for number in range(len(document or [])):
            yield from parameters_of(get_args(hint)[0], document[number], None, (*path, number))


def fields_of(
    record: Any, document: Any, default: Any, path: tuple[str | int, ...], without: Any = ("text", "warnings")
) -> Iterator[Parameter]:
    hints = get_type_hints(record, include_extras=True)
    for item in fields(record):
        if item.name not in without:
            inner = (document or {}).get(item.name)
            usual = None if item.default is MISSING else item.default
            usual = getattr(default, item.name, usual) if inner is None else inner
            yield from parameters_of(hints[item.name], inner, usual, (*path, item.name))
