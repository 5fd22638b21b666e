"""The patterns of the modules to compile find all that have to be compiled."""

import ast
import tomllib
from collections.abc import Iterator
from runpy import run_path

from tests.folders import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
MODULES: list[str] = run_path(str(ROOT / "setup.py"))["compiled_modules"](ROOT)
PACKAGES = [pattern.rstrip("*") for pattern in PROJECT["tool"]["setuptools"]["packages"]["find"]["include"]]
INTERPRETED_BASES = {"NamedTuple", "Enum", "IntEnum", "Exception", "ValueError", "RuntimeError"}  # compiled or not


def classes_of(module: str) -> Iterator[tuple[str, set[str]]]:
    """Yield the name of each class of a module, and the names of its bases."""
    for node in ast.walk(ast.parse((ROOT / module).read_text(encoding="utf-8"))):
        if isinstance(node, ast.ClassDef):
            yield node.name, {ast.unparse(base).partition("[")[0].rpartition(".")[2] for base in node.bases}


def test_every_pattern_finds_a_module() -> None:
    assert [pattern for pattern in PROJECT["tool"]["mudskipper"]["compiled"] if not any(ROOT.glob(pattern))] == []


def test_no_interpreted_class_has_a_compiled_base() -> None:
    """Python refuses to create an object of such a class."""
    compiled = {name for module in MODULES for name, bases in classes_of(module) if not bases & INTERPRETED_BASES}
    paths = (path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    interpreted = {str(path.relative_to(ROOT)) for path in paths} - set(MODULES)
    found = [f"{module}: {name}" for module in interpreted for name, bases in classes_of(module) if bases & compiled]
    assert found == []
