"""The file with the settings of drives before and after they are written, from which they can be restored."""

import os
import tomllib
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit

from command_line.drives.joint_setup import JointSetup
from drivers.bench.drive_setup import same
from firmware_host.configuration.file_problems import ConfigurationError, UnreadableFileError
from firmware_host.log.log_folder import synchronise_folder
from logs.files.whole_files import whole_file

HEAD = "Settings of the drives, written by 'mudskipper drives setup' at {}. Restore the old ones with --restore."


class Backup(NamedTuple):
    """The settings of one joint's drive."""

    type: str
    node_id: int
    serial_number: str
    old: dict[str, float]
    new: dict[str, float]

    def state(self, values: Mapping[str, float]) -> str:
        """Name which of both settings these are."""
        for name, expected in (("new", self.new), ("old", self.old)):
            if all(key in values and same(values[key], value) for key, value in expected.items()):
                return f"the {name} settings"
        return "neither the old nor the new settings"


def default_path() -> Path:
    return Path(f"drives-{datetime.now(UTC):%Y%m%d-%H%M%S}.toml")


def write_backup(path: Path, setups: list[JointSetup], changes: Mapping[str, Mapping[str, float]]) -> None:
    """Write the file whole, and wait until the disk has it. Raises OSError."""
    document = tomlkit.document()
    document.add(tomlkit.comment(HEAD.format(f"{datetime.now(UTC):%Y-%m-%d %H:%M:%S} UTC")))
    document.update({setup.joint: _drive_table(setup, changes[setup.joint]) for setup in setups})
    with whole_file(path) as hidden, hidden.open("w", encoding="utf-8") as file:
        file.write(tomlkit.dumps(document))
        file.flush()
        os.fsync(file.fileno())
    synchronise_folder(path.parent)  # which has its new name


def _drive_table(setup: JointSetup, new: Mapping[str, float]) -> dict[str, Any]:
    found = setup.found
    return {
        "type": found.type,
        "node_id": found.node_id,
        "serial_number": found.serial_number,
        "firmware": found.firmware,
        "old": {key: setup.values[key] for key in new},
        "new": dict(new),
    }


def read_backup(path: Path) -> dict[str, Backup]:
    """Return the settings by joint. Raises ConfigurationError."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
        if document:
            return {joint: _backup(each) for joint, each in document.items()}
    except OSError as problem:
        raise UnreadableFileError([f"{path}: {problem.strerror}"]) from None
    except (ValueError, KeyError, TypeError, AttributeError):
        pass
    raise ConfigurationError([f"{path}: is no file of 'mudskipper drives setup --write'"])


def _backup(table: Mapping[str, Any]) -> Backup:
    old, new = ({str(key): float(value) for key, value in table[name].items()} for name in ("old", "new"))
    return Backup(str(table["type"]), int(table["node_id"]), str(table["serial_number"]), old, new)
