"""Reads gait files: TOML with the keys of control/parameters/gait_path.py. The folder `gaits` has those that ship.

On the way to the daemon a gait is the same tables as JSON, on one line and without comments.
"""

import json
from errno import ENOENT
from pathlib import Path
from typing import Any

from control.computing.suggestion import suggestion
from control.gait.stride_table import crutching_parameters
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import LONGEST_JSON, GaitPath
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.toml_records import RecordReader, parse_document, read_text, shown

SHIPPED = Path(__file__).parent / "gaits"

_READER = RecordReader(GaitPath)


def gait_document(gait: str, *, adaptive: bool = False) -> dict[str, Any]:
    """Return the tables of a gait: a file, or the name of one that ships. Raises ConfigurationError, OSError.

    `adaptive`: without its depths, so that they adapt to the mud.
    """
    shipped = {path.stem: path for path in SHIPPED.glob("*.toml")}
    path = shipped.get(gait, Path(gait))
    if not path.exists():
        message = f"there is no such file or shipped gait; {suggestion(gait, sorted(shipped))}"
        raise FileNotFoundError(ENOENT, message, gait)
    document = {"name": path.name} | parse_document(read_text(path), path)
    if not isinstance(document["name"], str):
        raise ConfigurationError([f"{path.name}: name = {shown(document['name'])}: must be a text, in quotes"])
    if (length := len(as_json(document))) > LONGEST_JSON:
        most = f"must be at most {LONGEST_JSON}: leave out way-points or digits"
        raise ConfigurationError([f"{path.name}: {length} characters as JSON, {most}"])
    if adaptive:
        document.pop("depths_m", None)
    return document


def read_gait(document: dict[str, Any]) -> GaitPath:
    """Return the gait of these tables. Raises ConfigurationError with a message for each wrong key."""
    try:
        return GaitPath(**_READER.read(document))
    except ConfigurationError as problem:
        name = document.get("name")
        raise problem.of(name if name and isinstance(name, str) else "gait") from None


def as_json(document: dict[str, Any]) -> str:
    return json.dumps(document, separators=(",", ":"), default=_plain)


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else str(value)  # of numpy, or a date of TOML


def _protocol(name: str) -> GaitParameters:
    parameters = crutching_parameters(read_gait(gait_document(name)))
    assert parameters, name
    return parameters


PROTOCOLS = {name: _protocol(name) for name in ("walking", "measuring", "single_flipper")}
