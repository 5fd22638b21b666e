"""Which version of this software runs."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def software_version() -> str:
    try:
        return version("mudskipper")
    except PackageNotFoundError:
        return "not installed"
