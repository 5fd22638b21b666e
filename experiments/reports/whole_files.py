"""Atomic files: written under a hidden name in the same folder, then renamed.

A disk that fills up while a report is written again leaves the earlier one.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a path with the same ending to write to; rename it where nothing was raised. Raises OSError."""
    hidden = path.with_name(f".{path.name}")
    try:
        yield hidden
        hidden.replace(path)
    except BaseException:
        with suppress(OSError):
            hidden.unlink()
        raise


def copy_whole(file: Path, copy: Path) -> None:
    """Raises OSError."""
    with whole_file(copy) as hidden:
        shutil.copyfile(file, hidden)
