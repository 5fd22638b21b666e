"""Imports only point down, between folders and between modules; read from the source with `ast`."""

import ast
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from os.path import commonprefix
from pathlib import Path

import pytest

from drivers.drive_types import DRIVE_TYPES
from tests.folders import ROOT

LAYERS = [
    ("control",),
    ("estimation", "drivers"),
    ("firmware_host",),
    ("operator_client", "logs"),
    ("simulation",),
    ("experiments",),
    ("verification", "mudskipper"),
    ("command_line",),
]
HEIGHT = {package: height for height, layer in enumerate(LAYERS) for package in layer}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
INSTALLED = tuple(each.removesuffix("*") for each in PROJECT["tool"]["setuptools"]["packages"]["find"]["include"])
MOST_MODULES = 15  # in one folder


@cache
def imports(source: str, package: str) -> set[str]:
    """Return every module that a source imports, at module level or inside a function."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            module = package if node.level else node.module or ""
            found |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
    return found


def allowed(package: str, imported: str) -> bool:
    top = imported.split(".")[0]
    if top == package or top in sys.stdlib_module_names:
        return True
    if top not in HEIGHT:  # an external library
        return package != "control"
    if (package, top) == ("simulation", "estimation"):  # the simulated mud must not know the fits that are tested on it
        return False
    return HEIGHT[top] < HEIGHT[package]


@cache
def sources() -> dict[str, str]:
    """Return the source of every module of the product by its dotted name."""
    return {
        ".".join(path.relative_to(ROOT).with_suffix("").parts): path.read_text(encoding="utf-8")
        for package in HEIGHT
        for path in sorted((ROOT / package).rglob("*.py"))
    }


def imported_modules(module: str) -> set[str]:
    """Return the product's own modules that a module imports."""
    return imports(sources()[module], module.split(".")[0]) & sources().keys() - {module}


def circle(edges: dict[str, set[str]]) -> list[str]:
    """Return one cycle of a graph, or an empty list."""
    try:
        TopologicalSorter(edges).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def room(module: str) -> str:
    return module.rpartition(".")[0]


def edges_within_folders() -> dict[str, dict[str, set[str]]]:
    """Return, for each folder, which of its modules and subfolders imports from which other of them."""
    edges: dict[str, dict[str, set[str]]] = {}
    for module in sources():
        for imported in imported_modules(module):
            shared = commonprefix([module.split("."), imported.split(".")])
            below = [name.split(".")[len(shared) :] for name in (module, imported)]
            if all(below):  # no folder's own __init__
                edges.setdefault(".".join(shared), {}).setdefault(below[0][0], set()).add(below[1][0])
    return edges


def folders() -> Iterator[tuple[Path, int]]:
    skipped = {"tests", "build"}
    paths = [path.relative_to(ROOT) for path in ROOT.rglob("*.py") if path.name != "__init__.py"]
    kept = [path for path in paths if path.parts[0] not in skipped and not path.parts[0].startswith(".")]
    yield from Counter(path.parent for path in kept).items()


def test_every_installed_package_has_its_layer() -> None:
    assert {package.partition(".")[0] for package in INSTALLED} == set(HEIGHT)
    assert all((path.parent / "__init__.py").exists() for package in HEIGHT for path in (ROOT / package).rglob("*.py"))


@pytest.mark.parametrize("package", HEIGHT)
def test_imports_only_point_down(package: str) -> None:
    wrong = {
        f"{module} imports {name}"
        for module, source in sources().items()
        if module.split(".")[0] == package
        for name in imports(source, package)
        if not allowed(package, name)
    }
    assert not wrong


def test_no_modules_import_each_other_in_a_circle() -> None:
    assert not circle({module: imported_modules(module) for module in sources()})


def test_within_every_folder_imports_only_point_down() -> None:
    """So the modules and subfolders of each folder have an order, each folder as a whole."""
    assert not {folder: found for folder, edges in edges_within_folders().items() if (found := circle(edges))}


def test_the_robot_s_folder_holds_only_what_its_two_processes_load() -> None:
    reached, found = {"firmware_host.daemon", "firmware_host.log.writer"}, set[str]()
    while reached:
        found |= reached
        reached = {each for module in reached for each in imported_modules(module)} - found
    assert {module for module in sources() if module.startswith("firmware_host.") and "__init__" not in module} <= found


def test_no_import_hides_from_the_interpreter() -> None:
    assert not [module for module, source in sources().items() if "TYPE_CHECKING" in source]


def test_no_folder_is_overfull() -> None:
    assert not {str(folder): count for folder, count in folders() if count > MOST_MODULES}


@pytest.mark.parametrize("protocol", DRIVE_TYPES)
def test_only_its_own_folder_and_the_tables_know_a_protocol(protocol: str) -> None:
    """A new drive protocol changes only drivers/PROTOCOL, drivers/drive_types.py and simulation/devices.

    The folder of a version of a protocol may import from that of the protocol. What is not installed tests them.
    """
    driver = room(type(DRIVE_TYPES[protocol]).__module__)
    device = driver.replace("drivers.", "simulation.devices.")
    assert protocol == driver.removeprefix("drivers.")
    assert any(room(module) == driver for module in sources())
    assert any(module == device or room(module) == device for module in sources())
    knowing = {
        module
        for module in sources()
        if module.startswith(INSTALLED)
        for imported in imported_modules(module)
        if (imported == device or room(imported) in (device, driver)) and not room(module).startswith(driver)
    }
    assert {each for each in knowing if not each.startswith("simulation.devices")} == {"drivers.drive_types"}


@pytest.mark.parametrize("protocol", DRIVE_TYPES)
def test_no_file_of_the_process_names_a_protocol(protocol: str) -> None:
    naming = [
        str(path.relative_to(ROOT))
        for path in (ROOT / "firmware_host").rglob("*.py")
        if re.search(rf"(?<![a-z]){protocol}(?![a-z])", path.read_text(encoding="utf-8").lower())  # not in "limit"
    ]
    assert not naming
