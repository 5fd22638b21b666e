"""Writes the tables of the reference pages that follow from the code, before Sphinx reads the folder.

They are not checked in: a command, a configuration key, a fault or a log field is described where it is defined, and
nowhere else. The pages of docs/reference include them.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import MISSING
from itertools import groupby
from pathlib import Path

from command_line.init.key_reference import Key, configuration_keys, is_required, toml_value
from control.parameters.gait_path import GaitPath, GaitPhase, WayPoint
from docs.generate.command_line import commands, exit_statuses
from docs.generate.faults import energies, failures, faults, modes, reactions
from docs.generate.markdown import code, table
from drivers.drive_types import DEFAULT, DRIVE_TYPES
from firmware_host.configuration.gait_file import PROTOCOLS, SHIPPED
from firmware_host.log.rows import ROW_KINDS
from firmware_host.log.schema import Field
from firmware_host.sockets.socket_methods import METHODS, Level, Parameter, SocketMethod

EXAMPLE = Path(__file__).parents[2] / "systemd" / "mudskipper.toml"
SECTION = re.compile(r"^(?=\[)", re.MULTILINE)
COMMENTED = re.compile(r"^# (?=\[|\w+ =)", re.MULTILINE)  # sections and keys
COMMENTS_OF_NEXT = re.compile(r"(\n(#.*)?)*\Z")
KEY_HEAD = ("key", "unit", "bounds", "default", "meaning")
TOML_VALUES = (bool, int, float, str, tuple)
RIGHTS = {Level.ANYONE: "every user who may connect", Level.READ: "`read_group`", Level.DRIVE: "`drive_group`"}


def sections() -> Iterator[str]:
    for section, group in groupby(configuration_keys(), lambda key: key.section):
        keys = list(group)
        yield f"## [{section}]"
        rows = [_key_row(key) for key in keys]
        if section == "gait":
            names = " or ".join(f'"{name}"' for name in PROTOCOLS)
            rows.insert(0, (code("protocol"), "", names, '`"walking"`', "preset that the other keys change"))
        yield from table(KEY_HEAD, rows)
        yield from ("", "```toml", example(section, keys), "```", "")
        if section == "drive.NAME":
            yield from other_drives()


def other_drives() -> Iterator[str]:
    """Yield, for each other type of drive, the keys that it lacks and those that differ from the default type's."""
    keys_of = {name: list(configuration_keys(each.parameters, "drive.NAME")) for name, each in DRIVE_TYPES.items()}
    usual = keys_of.pop(DEFAULT)
    for name, keys in keys_of.items():
        names = {key.name for key in keys}
        absent = ", ".join(code(key.name) for key in usual if key.name not in names)
        yield f'`type = "{name}"` has other keys{f", and no {absent}" if absent else ""}:'
        own = [key for key in keys if key not in usual and key.name != "type"]
        named = [key._replace(name=f"{key.section}.{key.name}".removeprefix("drive.NAME.")) for key in own]
        yield from table(KEY_HEAD, map(_key_row, named))


def gaits() -> Iterator[str]:
    for record, place in ((GaitPath, "the file"), (GaitPhase, "each `[[phase]]`"), (WayPoint, "each of `way_points`")):
        yield f"Keys of {place}:"
        yield from table(KEY_HEAD, map(_key_row, configuration_keys(record, place)))
    texts = {path.stem: path.read_text(encoding="utf-8") for path in sorted(SHIPPED.glob("*.toml"))}
    first_lines = [(code(name), text.splitlines()[0].lstrip("# ")) for name, text in texts.items()]
    yield from table(("gait", "what it is"), first_lines)


def example(section: str, keys: Sequence[Key]) -> str:
    """Return a section to copy: of the example configuration, where it may be a comment, or one with every default."""
    head = re.compile(re.escape(f"[{section}]").replace("NAME", r"\w+"))
    text = EXAMPLE.read_text(encoding="utf-8")
    for part in (*SECTION.split(text), *SECTION.split(COMMENTED.sub("", text))):
        if head.match(part):
            return COMMENTS_OF_NEXT.sub("", part).strip()
    known = [key for key in keys if key.default is not MISSING and isinstance(key.default, TOML_VALUES)]
    return "\n".join([f"[{section}]", *(f"{key.name} = {toml_value(key.default)}" for key in known)])


def _key_row(key: Key) -> tuple[str, str, str, str, str]:
    bounds = f"{key.bounds.minimum:.10g} to {key.bounds.maximum:.10g}" if key.bounds else key.kind
    has_default = key.default is not MISSING and key.default is not None
    default = "required" if is_required(key) else code(toml_value(key.default)) if has_default else ""
    return code(key.name), key.unit, bounds, default, key.meaning


def topics() -> Iterator[str]:
    for kind in ROW_KINDS:
        yield f"## {kind.topic}"
        yield ""
        yield f"Message type `{kind.schema_name}`."
        yield from table(("field", "type", "meaning"), map(_field_row, kind.fields))


def _field_row(field: Field) -> tuple[str, str, str]:
    return code(field.name), f"{field.kind}[{field.length}]" if field.length else field.kind, field.meaning


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
        yield from table(
            ("parameter", "type", "unit", "bounds", "default", "meaning"), map(_parameter_row, method.parameters)
        )
    else:
        yield ""


def _parameter_row(parameter: Parameter) -> tuple[str, str, str, str, str, str]:
    default = "required" if parameter.required else "" if parameter.default is None else code(parameter.default)
    return code(parameter.name), str(parameter.type), parameter.unit, parameter.bounds, default, parameter.meaning


TABLES: dict[str, Callable[[], Iterator[str]]] = {
    "commands": commands,
    "exit_statuses": exit_statuses,
    "configuration": sections,
    "gaits": gaits,
    "modes": modes,
    "reactions": reactions,
    "faults": faults,
    "energies": energies,
    "failures": failures,
    "log": topics,
    "socket": methods,
}


def write_tables(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for name, lines in TABLES.items():
        (folder / f"{name}.md").write_text("\n".join(lines()) + "\n", encoding="utf-8")
