"""Turns a configuration into that of the same robot with another type of drive, for benchmarks, tests and experiments.

Only what the types differ in changes: node ids that the other type does not have are shifted, keys that it does not
know are left out, buses get a data bit rate where its frames need one, and drives that answer only when asked get lower
gains.
"""

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any, get_type_hints

import tomlkit

from control.bounds import Bounds
from control.parameters.joint_gains import GAINS_OF_ASKED_DRIVES
from drivers.drive_types import DEFAULT, DRIVE_TYPES

DRIVES = (  # types of drive, and models of motor
    *DRIVE_TYPES,
    *(f"{name}:{model}" for name, each in DRIVE_TYPES.items() for model in each.parameters.models),
)
DATA_BIT_RATE_KBIT_S = 5000
CALIBRATED = "2026-11-28"  # the date of every emulated drive's record


def with_drive_type(text: str, drive: str, **settings: float) -> str:
    """Return the text of the configuration with this type for every joint: "mit", or with a model "mit:AK80-9".

    The default type returns it unchanged. `settings` are keys of the drives, for a type that knows them.
    """
    if drive == DEFAULT:
        return text
    name, _, model = drive.partition(":")
    document: dict[str, Any] = tomlkit.parse(text)
    parameters = DRIVE_TYPES[name].parameters
    known = {field.name for field in fields(parameters)} - {"torque_constant_nm_a"}
    hints = get_type_hints(parameters, include_extras=True)
    bounds = next(extra for extra in hints["node_id"].__metadata__ if isinstance(extra, Bounds))
    for joint, table in document["drive"].items():
        for key in [key for key in table if key not in known]:
            del document["drive"][joint][key]
        table["type"] = name
        if model:
            table["model"] = model
        table["node_id"] += round(bounds.minimum)
        table.update((key, value) for key, value in settings.items() if key in known)
    if DRIVE_TYPES[name].kind.is_fd:
        for bus in document["bus"].values():
            bus["data_bit_rate_kbit_s"] = DATA_BIT_RATE_KBIT_S
    if parameters.answers_only:
        gains = document.setdefault("gains", tomlkit.table())
        for key, gain in asdict(GAINS_OF_ASKED_DRIVES).items():
            gains.setdefault(key, gain)
    if any("calibrated" in table for table in document["drive"].values()):
        mark_calibrated(document)
    return tomlkit.dumps(document)


def calibrated(text: str) -> str:
    """Return the text of a configuration whose emulated drives are those that it was calibrated for."""
    document: dict[str, Any] = tomlkit.parse(text)
    mark_calibrated(document)
    return tomlkit.dumps(document)


def mark_calibrated(document: Mapping[str, Any]) -> None:
    """Write the record of a calibration for every drive: emulated drives are built as the configuration says."""
    for table in document["drive"].values():
        given = {key: table[key] for key in ("bus", "node_id", "serial_number", "model") if key in table}
        record = tomlkit.inline_table()
        identity = DRIVE_TYPES[table.get("type", DEFAULT)].parameters(**given).identity
        record.update({"date": CALIBRATED, "drive": identity})
        table["calibrated"] = record
