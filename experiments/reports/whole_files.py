"""Files that are there whole or not at all: written beside their place under a hidden name, and then renamed.

A disk that fills up while a report is made again leaves the one that was there before.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Where to write it to, with the same ending; it takes its place where nothing was raised. Raises OSError."""
    beside = path.with_name(f".{path.name}")
    try:
        yield beside
        beside.replace(path)
    except BaseException:
        with suppress(OSError):
            beside.unlink()
        raise


def copy_whole(file: Path, copy: Path) -> None:
    """Raises OSError."""
    with whole_file(copy) as beside:
        shutil.copyfile(file, beside)
