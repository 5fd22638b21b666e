"""Identifies what computed a result: the version, and a digest of all sources that its study imports.

Equal sources give equal digits; equal version numbers need not. The digest is the same for a checkout and for an
installed wheel of the same sources, and a change of the documentation, of a test or of another study does not change
it. Imports are found in the text of the modules, also those within functions; a module that is imported by a computed
name is not found.
"""

import ast
import os
import platform
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from functools import cache
from hashlib import sha256
from pathlib import Path

from firmware_host.software_version import PACKAGE, build_metadata, software_version

ROOT = Path(__file__).parents[2]
PACKAGES = (
    "command_line", "control", "drivers", "estimation", "experiments", "firmware_host", "logs", "mudskipper",
    "operator_client", "simulation", "verification",
)  # fmt: skip
DIGITS = 16
Record = dict[str, str]


def provenance(*modules: str) -> Record:
    """Return the record of a result that these modules compute now. Raises ValueError for an unknown module."""
    return identity(*modules) | {
        "commit": build_metadata()["commit"],  # empty where it is not known; local changes are in the digest only
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors",
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def identity(*modules: str) -> Record:
    """Return what must be the same for equal digits. Raises ValueError for an unknown module."""
    return {"version": software_version(), "sources": source_digest(*modules)}


def program_text(record: Mapping[str, str]) -> str:
    """Return version and digest of a record, such as "mudskipper 0.2.0 (sources 0f3a…)"."""
    return f"{PACKAGE} {record.get('version', 'of an unknown version')} (sources {record.get('sources', 'unknown')})"


@cache
def source_digest(*modules: str) -> str:
    """Return a digest of these modules and of all that they import. Raises ValueError for an unknown module."""
    texts: dict[str, bytes] = {}
    left = list(modules)
    while left:
        module = left.pop()
        source = None if module in texts else _source(module)
        if source is not None:
            texts[module] = source[0]
            left += source[1]
    if unknown := set(modules) - set(texts):
        raise ValueError(f"{', '.join(sorted(unknown))}: no module of {PACKAGE}")
    digest = sha256()
    for module, text in sorted(texts.items()):
        digest.update(f"{module} {len(text)}\n".encode() + text)
    return digest.hexdigest()[:DIGITS]


@cache
def _source(module: str) -> tuple[bytes, list[str]] | None:
    """Return text and imports of a module as it was when it was first asked for; None for one of another product."""
    if module.partition(".")[0] not in PACKAGES:
        return None
    path = ROOT.joinpath(*module.split("."))
    for file in (path / "__init__.py", path.with_suffix(".py")):
        if file.is_file():
            text = file.read_bytes()
            return text, [module.rpartition(".")[0], *_imports(text)]
    return None


def _imports(text: bytes) -> Iterator[str]:
    """Yield every name that may be a module; of `from a import b` that is a, and also a.b."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (node.module, *(f"{node.module}.{each.name}" for each in node.names))
