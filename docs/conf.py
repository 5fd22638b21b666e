"""Configures Sphinx: MyST Markdown and notebooks, the furo theme, and the reference pages that the code describes."""

import os
import sys
from importlib.metadata import version as installed_version
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent))
os.environ.pop("MUDSKIPPER_SOCKET", None)  # a default of the command line, which the pages show

from docs.generate.pages import write_tables  # noqa: E402 - it needs the path above
from verification.claims.pages import fill  # noqa: E402
from verification.claims.results import load_results  # noqa: E402

write_tables(DOCS / "reference" / "generated")

project = "mudskipper"
author = "the mudskipper project"
release = version = installed_version("mudskipper")
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx_copybutton"]
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # seconds of one cell: the slowest takes 11 s of processor time, and 136 s on a busy machine
nb_merge_streams = True
nitpick_ignore_regex = [("py:.*", ".*")]  # the standard library's types, and internal ones
myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 4
exclude_patterns = ["generate", "reference/generated"]
html_theme = "furo"
html_title = f"mudskipper {release}"
copybutton_prompt_text = "$ "
man_pages = [("reference/command_line", "mudskipper", "operates a robot that crawls over mud", "", 1)]
linkcheck_anchors = False  # GitHub renders its anchors with scripts


def fill_figures(app: Any, page: str, source: list[str]) -> None:
    """Show the figures of the results in a page, without their templates."""
    source[0] = fill(source[0], load_results(), markers=False)


def setup(app: Any) -> None:
    app.connect("source-read", fill_figures)
