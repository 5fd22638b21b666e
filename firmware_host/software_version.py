"""The version and the git commit of this software, which every log carries."""

import json
from contextlib import suppress
from importlib.machinery import ExtensionFileLoader
from importlib.metadata import PackageNotFoundError, distribution, version
from importlib.util import find_spec
from pathlib import Path

PACKAGE = "mudskipper"
MODULE_OF_TICK = "firmware_host.loop"


def software_version() -> str:
    try:
        return version(PACKAGE)
    except PackageNotFoundError:
        return "not installed"


def software_commit() -> str:
    """Return the commit of the checkout, or the one that pip recorded at installation; empty if neither is known.

    It reads git's files, since a process of git would delay the start.
    """
    root = Path(__file__).parents[1]
    return _checkout_commit(root / ".git") or _installed_commit()


def is_compiled() -> bool:
    """Return whether the modules of a tick run compiled: setup.py compiles all of them or none."""
    spec = find_spec(MODULE_OF_TICK)
    return spec is not None and isinstance(spec.loader, ExtensionFileLoader)


def build_metadata() -> dict[str, str]:
    """Return the metadata of a log that says which software wrote it."""
    return {"version": software_version(), "commit": software_commit()}


def _checkout_commit(folder: Path) -> str:
    with suppress(OSError):
        if folder.is_file():  # of a worktree: "gitdir: PATH"
            folder = folder.parent / folder.read_text(encoding="utf-8").partition(":")[2].strip()
        head = (folder / "HEAD").read_text(encoding="utf-8").strip()
        name = head.removeprefix("ref: ")
        if name == head:
            return head
        common = folder / "commondir"
        main = folder / common.read_text(encoding="utf-8").strip() if common.exists() else folder
        with suppress(OSError):
            return (main / name).read_text(encoding="utf-8").strip()
        packed = (main / "packed-refs").read_text(encoding="utf-8").splitlines()
        return next((line.split(" ")[0] for line in packed if line.endswith(f" {name}")), "")
    return ""


def _installed_commit() -> str:
    with suppress(PackageNotFoundError, KeyError, ValueError, TypeError):
        record = json.loads(distribution(PACKAGE).read_text("direct_url.json") or "{}")
        return str(record["vcs_info"]["commit_id"])
    return ""
