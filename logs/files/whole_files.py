"""Atomic files: written under a hidden name in the same folder, then renamed.

A disk that fills up while a report is written again leaves the earlier one.
"""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path


def hidden_path(path: Path) -> Path:
    """Return where a file is written first: a device or a pipe, such as /dev/null, itself."""
    return path if path.exists() and not path.is_file() else path.with_name(f".{path.name}")


def is_hidden(path: Path, folder: Path) -> bool:
    """Return whether a file below a folder is not whole yet, such as one that `log pull` still copies."""
    return "/." in f"/{path.relative_to(folder).as_posix()}"


@contextmanager
def whole_files(paths: Sequence[Path]) -> Iterator[list[Path]]:
    """Yield paths with the same endings to write to; rename all where nothing was raised. Raises OSError."""
    hidden = [hidden_path(path) for path in paths]
    try:
        yield hidden
        for written, path in zip(hidden, paths, strict=True):
            written.replace(path)
    except BaseException:
        for written, path in zip(hidden, paths, strict=True):
            with suppress(OSError):
                if written != path:
                    written.unlink()
        raise


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a path with the same ending to write to; rename it where nothing was raised. Raises OSError."""
    with whole_files([path]) as (hidden,):
        yield hidden


def copy_whole(file: Path, copy: Path) -> None:
    """Raises OSError."""
    with whole_file(copy) as hidden:
        shutil.copyfile(file, hidden)
