"""Values of a configuration file changed in place: comments, order and everything else stay as a person wrote them.

What comes of it is shown as a difference first, must be a configuration that the daemon accepts before it replaces the
file, and leaves the old one beside it as `.before`. The file is replaced at once, so a daemon or a power cut meets the
old or the new one, never a half.
"""

from __future__ import annotations

import os
import tempfile
import tomllib
from collections.abc import Mapping, MutableMapping
from difflib import unified_diff
from itertools import takewhile
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Table

from experiments.robot.bench_robot import BenchError
from firmware_host.configuration.file_problems import why_not
from firmware_host.configuration.loading import parse_configuration
from firmware_host.configuration.toml_records import ConfigurationError, read_text

Changes = Mapping[tuple[str, ...], float]  # the key's path, and its new value
BACKUP = ".before"


def changed_text(text: str, changes: Changes) -> str:
    """Raises BenchError where it would not be a configuration, or would say anything else than before."""
    try:
        document = tomlkit.parse(text)
        for path, value in changes.items():
            _set(document, path, value)
        changed = tomlkit.dumps(document)
        parse_configuration(changed)
    except TOMLKitError as problem:
        raise BenchError(f"the configuration cannot be changed: {problem}") from problem
    except ConfigurationError as problem:
        raise BenchError(
            f"the configuration stays as it is, since changed it would be wrong: {problem}. Mend that, restart the "
            "daemon, and run the same command again: what was measured is kept"
        ) from problem
    if tomllib.loads(changed) != _expected(text, changes):
        raise BenchError(
            "the configuration stays as it is: its tables are written in a way that cannot be changed here"
        )
    return changed


def _expected(text: str, changes: Changes) -> dict[str, Any]:
    document = tomllib.loads(text)
    for path, value in changes.items():
        table = document
        for name in path[:-1]:
            table = table.setdefault(name, {})
        table[path[-1]] = value
    return document


def _set(document: MutableMapping[str, Any], path: tuple[str, ...], value: float) -> None:
    """A new key goes below the last one of its table, above what is said of the next table."""
    table = document
    for depth, name in enumerate(path[:-1]):
        if name not in table:
            table[name] = tomlkit.table(is_super_table=depth < len(path) - 2)
        table = table[name]
    body = table.value.body if isinstance(table, Table) and path[-1] not in table else []
    trailing = list(reversed([*takewhile(lambda item: item[0] is None, reversed(body))]))
    del body[len(body) - len(trailing) :]
    table[path[-1]] = value
    body.extend(trailing)


def difference(before: str, after: str, name: str) -> str:
    """As `diff -u` shows it."""
    lines = unified_diff(before.splitlines(), after.splitlines(), name, f"{name}, changed", lineterm="")
    return "\n".join(lines)


def replace_file(path: Path, before: str, after: str) -> Path:
    """The backup's path. Raises BenchError where it may not be written, or was changed in the meantime."""
    try:
        path = path.resolve(strict=True)  # a link stays one
        if read_text(path) != before:
            raise BenchError(f"{path} was changed by somebody else just now; run the command again")
        backup = path.with_name(path.name + BACKUP)
        _write(backup, before, path)
        _write(path, after, path)
    except OSError as problem:
        raise BenchError(
            f"{why_not(problem, path)}; nothing was changed. Run the same command as somebody who may write it, such as"
            " root: what was measured is kept"
        ) from problem
    return backup


def _write(path: Path, text: str, like: Path) -> None:
    """At once, with the owner and the rights of another file."""
    status = like.stat()
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="") as file:
            file.write(text)
            os.fchmod(file.fileno(), status.st_mode & 0o777)
            if (os.geteuid(), os.getegid()) != (status.st_uid, status.st_gid):
                os.fchown(file.fileno(), status.st_uid, status.st_gid)
            file.flush()
            os.fsync(file.fileno())
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise
