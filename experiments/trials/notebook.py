"""What was measured so far, on the disk before anything goes on: an experiment that is interrupted continues there.

A file of JSON lines: the plan first, then an entry a line, each a key and what belongs to it. A later entry of the same
key counts, so what is measured again replaces what was, and a line that was cut off in its middle costs itself alone.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

NAME = "notebook.jsonl"
Entry = dict[str, Any]


class NotebookError(Exception):
    """It cannot be used; the text says why, and what to do."""


class Notebook:
    """Owns the entries, and the file that they are in."""

    def __init__(self, folder: Path, plan: Entry) -> None:
        """New, or as it was left. Raises NotebookError where another plan was begun there, OSError."""
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / NAME
        self.plan = json.loads(json.dumps(plan))  # as it reads back
        self.entries: dict[str, Entry] = {}
        contents = self.path.read_bytes() if self.path.exists() else b""
        if _is_unbegun(contents):
            self.path.write_bytes(b"")
            self._append({"plan": self.plan})
        else:
            self._read(contents)

    @property
    def begun(self) -> bool:
        """Something was measured already."""
        return bool(self.entries)

    @property
    def left_out(self) -> dict[str, Entry]:
        """What somebody did not want, or did not want to count."""
        return {key: entry for key, entry in self.entries.items() if entry.get("skipped")}

    def write(self, key: str, entry: Entry) -> None:
        self._append({"key": key, "entry": entry})
        self.entries[key] = json.loads(json.dumps(entry))

    def forget(self, key: str) -> None:
        """As if it had not been measured; the file keeps it."""
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
                file.write(b"\n")  # what comes next begins a line
        lines = [line for line in map(_decode, contents.splitlines()) if line is not None]
        if not lines or "plan" not in lines[0]:
            raise NotebookError(f"{self.path} is no notebook of an experiment; choose another folder with --out")
        self._require_plan(lines[0]["plan"])
        for line in lines[1:]:
            self._take(line)

    def _require_plan(self, begun: Entry) -> None:
        different = sorted(name for name in {*begun, *self.plan} if begun.get(name) != self.plan.get(name))
        if different:
            then, now = ({name: plan.get(name) for name in different} for plan in (begun, self.plan))
            raise NotebookError(
                f"{self.path.parent} holds measurements with {_reported(then)}, and {_reported(now)} was asked for: "
                "go on with the same options, or choose another folder with --out"
            )

    def _take(self, line: Entry) -> None:
        key, entry = line.get("key"), line.get("entry")
        if isinstance(key, str) and isinstance(entry, dict):
            self.entries[key] = entry
        elif isinstance(key, str):
            self.entries.pop(key, None)


def anything_measured(folder: Path) -> bool:
    """In a notebook of the folder or below: behind its plan there is a line."""
    return any(notebook.read_bytes().count(b"\n") > 1 for notebook in folder.rglob(NAME))


def _is_unbegun(contents: bytes) -> bool:
    """No line behind a plan, nor a whole one where the disk was full: it may as well be another plan's."""
    plan, _, rest = contents.partition(b"\n")
    return not rest.strip() and (not plan.strip() or plan.startswith(b'{"plan"'))


def _decode(line: bytes) -> Entry | None:
    """None for one that was cut off."""
    try:
        decoded = json.loads(line)
    except ValueError:
        return None
    return decoded if isinstance(decoded, dict) else None


def _reported(values: Entry) -> str:
    return ", ".join(f"{name} = {value}" for name, value in values.items())
