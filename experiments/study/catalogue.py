"""Finds the studies: every module of experiments/studies and verification/studies that has a function `study`.

The name of the file is the name of the command, and the first line of the function's docstring its help. Both are read
from the text, because a study takes long to import.
"""

import ast
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
FOLDERS = {  # by package; the second proves the product and is a layer above
    "experiments.studies": ROOT / "experiments" / "studies",
    "verification.studies": ROOT / "verification" / "studies",
}


class FoundStudy(NamedTuple):
    module: str
    text: str  # the docstring


OWN_COMMANDS = ("calibrate",)  # which 'mudskipper' has itself, not 'mudskipper experiment'


@cache
def find_studies() -> dict[str, FoundStudy]:
    """Return every study by the name of its command."""
    found = {}
    for package, folder in FOLDERS.items():
        for path in folder.glob("*.py"):
            for node in ast.parse(path.read_bytes()).body:
                if isinstance(node, ast.FunctionDef) and node.name == "study":
                    name, text = path.stem.replace("_", "-"), ast.get_docstring(node) or ""
                    found[name] = FoundStudy(f"{package}.{path.stem}", text)
    return dict(sorted(found.items()))


def study_texts() -> dict[str, str]:
    """Return the docstring of every study of 'mudskipper experiment' by the name of its command."""
    return {name: found.text for name, found in find_studies().items() if name not in OWN_COMMANDS}


def load_study(name: str) -> ModuleType:
    """Import the module of a study."""
    return import_module(find_studies()[name].module)
