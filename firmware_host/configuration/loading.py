"""Reads a configuration file into its records.

A file is read in four steps: keys of version 0.1 get their present names, a gait protocol is replaced by its values,
each value is checked against its own bounds, and then the values are checked against each other.
"""

from collections.abc import Iterable, Iterator
from dataclasses import asdict
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any

from control.computing.suggestion import suggestion
from drivers.can.can_port import interface_problem
from drivers.drive import DriveParameters
from drivers.drive_types import DEFAULT, DRIVE_TYPES
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.consistency import contradictions, gait_warnings
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.gait_file import PROTOCOLS
from firmware_host.configuration.toml_records import (
    OneOf,
    RecordReader,
    parse_document,
    read_text,
    rename_former_keys,
    shown,
)
from firmware_host.configuration.weakened_protection import require_reason

FORMER_KEYS = {  # key of version 0.1: present key in the same section; version 0.2 accepts both
    "faults.lag_share": "lag_fraction",
    "faults.disk_free_share": "disk_free_fraction",
    "adaptation.lifting_share": "lifting_fraction",
    "adaptation.insertion_share": "insertion_fraction",
    "adaptation.acceleration_s": "paper.acceleration_s",
    "adaptation.min_sweep_deg": "gait.min_sweep_deg",
    "adaptation.max_sweep_deg": "gait.max_sweep_deg",
    "adaptation.swing_duration_s": "gait.swing_duration_s",
    "estimation.paper_compensation": "paper.compensation",
    "log.min_free_share": "min_free_fraction",
}
PATHS = ("log.directory", "status.socket", "pose.socket", "pose.rail_encoder.device", "emergency_stop.device")
NO_KEYS = frozenset({"text", "warnings"})  # fields of the record that are no keys of the file

_DRIVE = OneOf("type", {name: each.parameters for name, each in DRIVE_TYPES.items()}, DEFAULT)
_READER = RecordReader(Configuration, without=NO_KEYS, hints={"drive": dict[str, Annotated[DriveParameters, _DRIVE]]})


def load_configuration(path: Path) -> Configuration:
    """Read the file of a robot that is to run. Raises ConfigurationError, also for a file that cannot be read.

    Unlike the text in a log, which may be of an earlier version or another computer, it needs a reason for weakened
    protection, interfaces that are installed, and paths that every account reads alike.
    """
    configuration = parse_configuration(read_text(path), path)
    if problems := list(_problems_here(configuration)):
        raise ConfigurationError(problems)
    return require_reason(configuration)


def _problems_here(configuration: Configuration) -> Iterator[str]:
    for name, bus in configuration.bus.items():
        if problem := interface_problem(bus.interface):
            yield f"bus.{name}.interface = {bus.interface!r}: {problem}"
    for key in PATHS:
        if (path := attrgetter(key)(configuration)).startswith("~"):
            yield f"{key} = {path!r}: must be written out, since ~ is another folder for the daemon than for you"


def parse_configuration(text: str, file: Path | None = None) -> Configuration:
    """Read a text. Raises ConfigurationError as `read_configuration`; one about its syntax names the file."""
    return read_configuration(parse_document(text, file), text)


def read_configuration(document: dict[str, Any], text: str = "") -> Configuration:
    """Read the tables of a file, and change them. Raises ConfigurationError with all problems of one step."""
    warnings = rename_former_keys(document, FORMER_KEYS)
    _apply_protocol(document)
    _require_known_types(document)
    _require_one_shape(document)
    fields = _READER.read(document)
    warnings += gait_warnings(fields["gait"])
    configuration = Configuration(**fields, text=text, warnings=tuple(warnings))
    problems = list(contradictions(configuration))
    if problems:
        raise ConfigurationError(problems)
    return configuration


def _require_known_types(document: dict[str, Any]) -> None:
    """Raise ConfigurationError if the type of a drive is unknown."""
    drives = document.get("drive")
    tables = drives if isinstance(drives, dict) else {}
    types = {joint: table.get("type", DEFAULT) for joint, table in tables.items() if isinstance(table, dict)}
    known = tuple(DRIVE_TYPES)  # not the dictionary: a malformed type may not be hashable
    problems = [
        f"drive.{joint}.type = {shown(name)}: there is no such type; {_others(name, known)}"
        for joint, name in types.items()
        if name not in known
    ]
    if problems:
        raise ConfigurationError(problems)


def _others(name: object, known: Iterable[str]) -> str:
    """Return the suggestion for a word of the file, which may be no text."""
    return suggestion(name if isinstance(name, str) else "", known)


def _require_one_shape(document: dict[str, Any]) -> None:
    """Raise ConfigurationError if a plate has both corners and the sides of a rectangle."""
    geometry = document.get("geometry")
    if not isinstance(geometry, dict) or not geometry.get("plate_corners_m"):
        return
    sides = [name for name in ("plate_width_m", "plate_height_m") if name in geometry]
    if sides:
        must_be = "must be left out where geometry.plate_corners_m gives the plate"
        raise ConfigurationError([f"geometry.{name} = {shown(geometry[name])}: {must_be}" for name in sides])


def _apply_protocol(document: dict[str, Any]) -> None:
    """Replace `gait.protocol` by the values of that preset; the other keys of [gait] overrule them."""
    gait = document.get("gait")
    if not isinstance(gait, dict) or "protocol" not in gait:
        return
    name = gait.pop("protocol")
    if not isinstance(name, str) or name not in PROTOCOLS:
        raise ConfigurationError(
            [f"gait.protocol = {shown(name)}: there is no such protocol; {_others(name, PROTOCOLS)}"]
        )
    document["gait"] = asdict(PROTOCOLS[name]) | gait
