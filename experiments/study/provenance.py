"""Identifies what computed a result: the version, and a digest of all sources that its study imports.

Equal sources, which include the gaits that ship, give equal digits; equal version numbers need not. The digest is the
same for a checkout and for an installed wheel of the same sources, and a change of the documentation, of a test or of
another study does not change it. Imports are found in the text of the modules, also those within functions; a module
that is imported by a computed name is not found.
"""

import ast
import os
import platform
from collections.abc import Mapping
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
FILES = {"firmware_host.configuration.gait_file": "firmware_host/configuration/gaits/*.toml"}  # that a module reads
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
    texts, left = dict[str, bytes](), list(modules)
    while left:
        module = left.pop()
        if module not in texts and (text := _text_of(module)) is not None:
            texts[module] = text
            if module in FILES:
                texts |= {file.name: file.read_bytes() for file in ROOT.glob(FILES[module])}
            left += [module.rpartition(".")[0], *_imports(module)]
    if unknown := set(modules) - set(texts):
        raise ValueError(f"{', '.join(sorted(unknown))}: no module of {PACKAGE}")
    digest = sha256()
    for module, text in sorted(texts.items()):
        digest.update(f"{module} {len(text)}\n".encode() + text)
    return digest.hexdigest()[:DIGITS]


@cache
def _text_of(module: str) -> bytes | None:
    """Return the text of a module as it was when it was first asked for; None for one of another product."""
    path = ROOT.joinpath(*module.split("."))
    files = (path / "__init__.py", path.with_suffix(".py")) if module.partition(".")[0] in PACKAGES else ()
    return next((file.read_bytes() for file in files if file.is_file()), None)


@cache
def _imports(module: str) -> list[str]:
    """Return every name that may be a module; of `from a import b` that is a, and also a.b."""
    found = []
    for node in ast.walk(ast.parse(_text_of(module) or b"")):
        if isinstance(node, ast.Import):
            found += [each.name for each in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found += [node.module, *(f"{node.module}.{each.name}" for each in node.names)]
    return found
