"""Writes the keys of the configuration file from the records that the reader fills."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING
from itertools import groupby

from control.gait.gait import PROTOCOLS
from docs.generate.markdown import code, table
from firmware_host.configuration.key_reference import Key, configuration_keys, is_required


def sections() -> Iterator[str]:
    for section, keys in groupby(configuration_keys(), lambda key: key.section):
        yield f"## [{section}]"
        rows = [_row(key) for key in keys]
        if section == "gait":
            names = " or ".join(f'"{name}"' for name in PROTOCOLS)
            rows.insert(0, (code("protocol"), "", names, '`"walking"`', "preset that the other keys change"))
        yield from table(("key", "unit", "bounds", "default", "meaning"), rows)


def _row(key: Key) -> tuple[str, str, str, str, str]:
    bounds = f"{key.bounds.minimum:.10g} to {key.bounds.maximum:.10g}" if key.bounds else key.kind
    default = "required" if is_required(key) else "" if key.default is MISSING else code(_toml(key.default))
    return code(key.name), key.unit, bounds, default, key.meaning


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else f"{value:.10g}"
