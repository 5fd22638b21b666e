"""Imports only point down: the folders' layers, read from the source with `ast`."""

import ast
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.folders import ROOT

LAYERS = [
    ("control",),
    ("estimation", "drivers"),
    ("firmware_host",),
    ("simulation",),
    ("experiments",),
    ("command_line",),
]
HEIGHT = {package: height for height, layer in enumerate(LAYERS) for package in layer}


def imports(source: str, package: str) -> set[str]:
    """The top-level packages that a module names in any import, wherever in the file it stands."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(package if node.level else (node.module or "").split(".")[0])
    return found


def allowed(package: str, imported: str) -> bool:
    if imported == package or imported in sys.stdlib_module_names:
        return True
    if imported not in HEIGHT:  # a library
        return package != "control"
    if (package, imported) == ("simulation", "estimation"):  # made-up mud must not be judged by what fits it
        return False
    return HEIGHT[imported] < HEIGHT[package]


def modules() -> Iterator[tuple[str, Path]]:
    for package in HEIGHT:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield package, path


def test_every_installed_package_has_its_layer() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    included = project["tool"]["setuptools"]["packages"]["find"]["include"]
    assert {pattern.removesuffix("*") for pattern in included} == set(HEIGHT)
    assert all((path.parent / "__init__.py").exists() for _, path in modules())


def test_what_experiments_share_knows_none_of_them() -> None:
    shared = {path.stem for path in (ROOT / "experiments").glob("*.py")}
    wrong = {
        f"{path.name} imports {node.module}"
        for path in (ROOT / "experiments").glob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("experiments.")
        if (node.module or "").split(".")[1] not in shared
    }
    assert not wrong


@pytest.mark.parametrize("package", HEIGHT)
def test_imports_only_point_down(package: str) -> None:
    paths = [path for owner, path in modules() if owner == package]
    assert paths
    wrong = {
        f"{path.relative_to(ROOT)} imports {name}"
        for path in paths
        for name in imports(path.read_text(encoding="utf-8"), package)
        if not allowed(package, name)
    }
    assert not wrong


@pytest.mark.parametrize(
    ("package", "line"),
    [
        ("control", "import numpy as np"),
        ("control", "from drivers.can.frames import Frame"),
        ("estimation", "import drivers.can.frames"),
        ("drivers", "from estimation import mud"),
        ("drivers", "def late() -> None:\n    import firmware_host"),
        ("firmware_host", "from simulation.harness.robot import SimulatedRobot"),
        ("firmware_host", "import command_line.main"),
        ("simulation", "import json, estimation.mud"),
        ("simulation", "import command_line"),
    ],
)
def test_an_import_that_points_up_is_noticed(package: str, line: str) -> None:
    assert any(not allowed(package, name) for name in imports(line, package))


@pytest.mark.parametrize(
    ("package", "line"),
    [
        ("control", "from math import pi"),
        ("control", "from . import records"),
        ("estimation", "import numpy as np"),
        ("drivers", "from control.records import JOINTS"),
        ("simulation", "from firmware_host.ticker import PERIOD_S"),
        ("command_line", "import estimation.mud"),
    ],
)
def test_an_import_that_points_down_is_allowed(package: str, line: str) -> None:
    assert all(allowed(package, name) for name in imports(line, package))
