"""The measurements so far, on the disk before the experiment continues, so that an interrupted one can continue.

The file has JSON lines: the plan first, then one entry per line with its key. A later entry of a key replaces the
earlier one, and a line that was cut off costs only itself. The plan has everything that must be the same where the
experiment continues: options, version and sources, the configuration and the world as they were read.
"""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

NAME = "notebook.jsonl"
SHOWN_DIFFERENCES = 6
Entry = dict[str, Any]


class NotebookError(Exception):
    """The notebook cannot be used; the text says why, and what to do."""


class Notebook:
    """The entries, and their file."""

    def __init__(self, folder: Path, plan: Mapping[str, Any]) -> None:
        """Begin or continue. Raises NotebookError where the folder has another plan, OSError.

        Tables in the plan are flattened, so that a message names only the keys that differ.
        """
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / NAME
        self.plan = json.loads(json.dumps(_flat(plan), default=str))  # as it reads back
        self.entries: dict[str, Entry] = {}
        contents = self.path.read_bytes() if self.path.exists() else b""
        plan_line, _, rest = contents.partition(b"\n")
        # without a line after the plan, or a complete plan, another one may begin
        if not rest.strip() and (not plan_line.strip() or plan_line.startswith(b'{"plan"')):
            self.path.write_bytes(b"")
            self._append({"plan": self.plan})
        else:
            self._read(contents)

    @property
    def left_out(self) -> dict[str, Entry]:
        """The entries of skipped trials."""
        return {key: entry for key, entry in self.entries.items() if entry.get("skipped")}

    def write(self, key: str, entry: Entry) -> None:
        self._append({"key": key, "entry": entry})
        self.entries[key] = json.loads(json.dumps(entry))

    def forget(self, key: str) -> None:
        """Remove an entry; the file keeps its line."""
        self._append({"key": key, "entry": None})
        self.entries.pop(key, None)

    def _append(self, line: Entry) -> None:
        with self.path.open("ab") as file:
            file.write(json.dumps(line).encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())

    def _read(self, contents: bytes) -> None:
        if not contents.endswith(b"\n"):
            with self.path.open("ab") as file:
                file.write(b"\n")  # the next entry begins a line
        first, *lines = [line for line in map(_decode, contents.splitlines()) if line is not None] or [{}]
        if "plan" not in first:
            raise NotebookError(f"{self.path} is no notebook of an experiment: choose another folder with --out")
        self._require_plan(first["plan"])
        for line in lines:
            key, entry = line.get("key"), line.get("entry")
            if isinstance(entry, dict):
                self.entries[str(key)] = entry
            else:
                self.entries.pop(str(key), None)

    def _require_plan(self, earlier: Entry) -> None:
        different = sorted(name for name in {*earlier, *self.plan} if earlier.get(name) != self.plan.get(name))
        if different:
            then, now = (
                ", ".join(f"{name} = {plan.get(name, '(none)')}" for name in different[:SHOWN_DIFFERENCES])
                + ", ..." * (len(different) > SHOWN_DIFFERENCES)
                for plan in (earlier, self.plan)
            )
            raise NotebookError(
                f"{self.path.parent} has measurements with {then}, and now there is {now}: continue with the same, "
                "choose another folder with --out, or begin again with --restart, which renames this folder"
            )


def count_entries(folder: Path) -> int:
    """Count the lines after the plan in all notebooks of a folder; a repeated reading counts again."""
    return sum(max(0, notebook.read_bytes().count(b"\n") - 1) for notebook in folder.rglob(NAME))


def plan_in(folder: Path) -> Entry:
    """Return the plan of a folder's first notebook; nothing where there is none."""
    for notebook in sorted(folder.rglob(NAME)):
        return dict((_decode(notebook.read_bytes().partition(b"\n")[0]) or {}).get("plan", {}))
    return {}


def _decode(line: bytes) -> Entry | None:
    """Return nothing for a line that was cut off."""
    try:
        decoded = json.loads(line)
    except ValueError:
        return None
    return decoded if isinstance(decoded, dict) else None


def _flat(tables: Mapping[str, Any], path: str = "") -> Entry:
    """Return values by dotted key."""
    flat: Entry = {}
    for name, value in tables.items():
        flat |= _flat(value, f"{path}{name}.") if isinstance(value, Mapping) else {f"{path}{name}": value}
    return flat
