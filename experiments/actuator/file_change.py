"""Changes values of the configuration file, and leaves its comments, order and everything else unchanged.

The new text must be a configuration that the daemon accepts. The file is replaced atomically, so a power cut leaves the
old or the new one, and the old one stays next to it as `.before`.
"""

import os
from collections.abc import Callable, Mapping, MutableMapping
from difflib import unified_diff
from itertools import takewhile
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Item, Table

from experiments.robot.bench_errors import BenchError
from firmware_host.configuration.file_problems import ConfigurationError, why_not
from firmware_host.configuration.loading import parse_configuration
from firmware_host.configuration.toml_records import read_text
from logs.files.whole_files import whole_file

BACKUP = ".before"
Changes = Mapping[tuple[str, ...], Any]  # the key's path, and its new value


class FileChangeError(BenchError):
    """The file stays as it is; the text says why, and what to do."""


def changed_text(text: str, changes: Changes) -> str:
    """Raises FileChangeError where the result is no configuration."""
    try:
        document = tomlkit.parse(text)
        for path, value in changes.items():
            _set(document, path, value)
        changed = tomlkit.dumps(document)
        parse_configuration(changed)
    except TOMLKitError as problem:
        raise FileChangeError(f"the configuration cannot be changed: {problem}") from problem
    except ConfigurationError as problem:
        text = f"the configuration stays as it is, since changed it would be invalid: {problem}"
        raise FileChangeError(f"{text}; correct that first") from problem
    return changed


def _set(document: MutableMapping[str, Any], path: tuple[str, ...], value: Any) -> None:
    """Put a new key below the last one of its table, above comments on the next table."""
    table = document
    for depth, name in enumerate(path[:-1]):
        if name not in table:
            table[name] = tomlkit.table(is_super_table=depth < len(path) - 2)
        table = table[name]
    body = table.value.body if isinstance(table, Table) and path[-1] not in table else []
    trailing = list(reversed([*takewhile(lambda item: item[0] is None, reversed(body))]))
    del body[len(body) - len(trailing) :]
    table[path[-1]] = _item(value)
    body.extend(trailing)


def _item(value: Any) -> Item:
    if isinstance(value, Mapping):
        inline = tomlkit.inline_table()
        inline.update(value)
        return inline
    item: Item = tomlkit.item(value)
    return item


def lines_of(changes: Changes) -> str:
    """Return the keys with their new values, as they may stand in the file."""
    return "\n".join(f"{'.'.join(path)} = {_item(value).as_string()}" for path, value in changes.items())


def change_file(path: Path, before: str, changes: Changes, agrees: Callable[[str], bool]) -> str:
    """Replace the file where `agrees` accepts the difference, and return a message. Raises FileChangeError."""
    after = changed_text(before, changes)
    if after == before:
        return f"{path} needs no change"
    shown = unified_diff(before.splitlines(), after.splitlines(), str(path), f"{path}, changed", lineterm="")
    if not agrees("\n".join(shown)):
        return f"{path} was left as it is"
    return f"{path} is changed; the old file is {replace_file(path, before, after).name}"


def replace_file(path: Path, before: str, after: str) -> Path:
    """Return the path of the backup. Raises FileChangeError where the file changed meanwhile, or may not be written."""
    try:
        path = path.resolve(strict=True)  # a link stays one
        if read_text(path) != before:
            raise FileChangeError(f"{path} was changed during this command, and stays as it is")
        backup = path.with_name(path.name + BACKUP)
        _write(backup, before, path)
        _write(path, after, path)
    except OSError as problem:
        raise FileChangeError(
            f"{why_not(problem, path)}; nothing was changed. It needs a user who may write it, such as root"
        ) from problem
    return backup


def _write(path: Path, text: str, like: Path) -> None:
    """Write atomically, with the owner and the permissions of another file."""
    status = like.stat()
    with whole_file(path) as hidden, hidden.open("w", encoding="utf-8", newline="") as file:
        os.fchmod(file.fileno(), status.st_mode & 0o777)
        if (os.geteuid(), os.getegid()) != (status.st_uid, status.st_gid):
            os.fchown(file.fileno(), status.st_uid, status.st_gid)
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
