"""Finds the studies: every module of experiments/studies that has a function `study`.

The name of the file is the name of the command, and the first line of the function's docstring its help. Both are read
from the text, because a study takes long to import.
"""

import ast
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType

FOLDER = Path(__file__).parents[1] / "studies"
PACKAGE = "experiments.studies"


@cache
def study_texts() -> dict[str, str]:
    """Return the docstring of every study by the name of its command."""
    texts = {}
    for path in sorted(FOLDER.glob("*.py")):
        for node in ast.parse(path.read_bytes()).body:
            if isinstance(node, ast.FunctionDef) and node.name == "study":
                texts[path.stem.replace("_", "-")] = ast.get_docstring(node) or ""
    return texts


def load_study(name: str) -> ModuleType:
    """Import the module of a study."""
    return import_module(f"{PACKAGE}.{name.replace('-', '_')}")
