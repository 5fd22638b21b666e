"""Identifies the program that computes trials: equal sources give equal digits, equal version numbers need not."""

from functools import cache
from hashlib import sha256
from pathlib import Path

from firmware_host.software_version import PACKAGE, software_version

ROOT = Path(__file__).parents[2]
FOLDERS = ("control", "estimation", "drivers", "firmware_host", "simulation", "experiments")
DIGITS = 12


@cache
def program_text() -> str:
    """Return version and digest of the sources, such as "mudskipper 0.2.0 (sources 0f3a…)"."""
    digest = sha256()
    for path in sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")):
        contents = path.read_bytes()
        digest.update(f"{path.relative_to(ROOT).as_posix()} {len(contents)}\n".encode() + contents)
    return f"{PACKAGE} {software_version()} (sources {digest.hexdigest()[:DIGITS]})"
