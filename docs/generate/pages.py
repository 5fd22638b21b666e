"""Writes every reference page that follows from the code, before Sphinx reads the folder.

The pages are not checked in: a command, a configuration key, a fault or a log field is described where it is defined,
and nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from docs.generate.command_line import command_line_page

PAGES: dict[str, Callable[[], Iterator[str]]] = {
    "command_line": command_line_page,
}


def write_pages(folder: Path) -> None:
    """Writes the pages that changed, so that Sphinx rebuilds no other."""
    for name, page in PAGES.items():
        path, text = folder / f"{name}.md", "\n".join(page()) + "\n"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
