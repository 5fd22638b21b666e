"""Writes the methods of the operator's socket from the table by which the daemon reads requests."""

from __future__ import annotations

from collections.abc import Iterator

from docs.generate.markdown import code, table
from firmware_host.operator.socket_methods import METHODS, Level, Parameter, SocketMethod

RIGHTS = {Level.ANYONE: "every user who may connect", Level.READ: "`read_group`", Level.DRIVE: "`drive_group`"}


def methods() -> Iterator[str]:
    for name, method in METHODS.items():
        yield f"## {name}"
        yield ""
        yield f"{method.meaning} Permitted to: {RIGHTS[method.level]}."
        yield from _parameters(method)
        yield f"Answer: {method.answer}."
        if method.answer_keys:
            rows = [(", ".join(map(code, keys.split(", "))), text) for keys, text in method.answer_keys.items()]
            yield from table(("key", "meaning"), rows)
        yield ""


def _parameters(method: SocketMethod) -> Iterator[str]:
    if method.parameters:
        yield from table(("parameter", "type", "unit", "bounds", "default", "meaning"), map(_row, method.parameters))
    else:
        yield ""


def _row(parameter: Parameter) -> tuple[str, str, str, str, str, str]:
    default = "required" if parameter.required else "" if parameter.default is None else code(parameter.default)
    return code(parameter.name), str(parameter.type), parameter.unit, parameter.bounds, default, parameter.meaning
