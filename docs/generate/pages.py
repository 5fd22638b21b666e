"""Writes the tables of the reference pages that follow from the code, before Sphinx reads the folder.

They are not checked in: a command, a configuration key, a fault or a log field is described where it is defined, and
nowhere else. The pages of docs/reference include them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from docs.generate.command_line import commands, exit_statuses
from docs.generate.configuration import sections
from docs.generate.faults import failures, faults, modes, reactions
from docs.generate.log import topics
from docs.generate.socket import methods

TABLES: dict[str, Callable[[], Iterator[str]]] = {
    "commands": commands,
    "exit_statuses": exit_statuses,
    "configuration": sections,
    "modes": modes,
    "reactions": reactions,
    "faults": faults,
    "failures": failures,
    "log": topics,
    "socket": methods,
}


def write_tables(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for name, lines in TABLES.items():
        (folder / f"{name}.md").write_text("\n".join(lines()) + "\n", encoding="utf-8")
