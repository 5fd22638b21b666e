"""The locked requirements of installations as root, and of CI, fit pyproject.toml, completely and by hashes."""

import re
import tomllib
from importlib.metadata import PackageNotFoundError, requires
from itertools import chain
from typing import NamedTuple

import pytest
from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from tests.folders import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
EXTRAS = PROJECT["project"]["optional-dependencies"]
NOT_ON_A_ROBOT = {"test", "docs", "cluster", "gym"}
BUILD = PROJECT["build-system"]["requires"]
ALWAYS = [*BUILD, *PROJECT["project"]["dependencies"]]
DIRECT = {
    "robot.txt": [*ALWAYS, *EXTRAS["serial"], *EXTRAS["screen"]],
    "robot_with_extras.txt": [*ALWAYS, *chain(*(EXTRAS[name] for name in EXTRAS.keys() - NOT_ON_A_ROBOT))],
    "development.txt": [*ALWAYS, *chain(*(EXTRAS[name] for name in EXTRAS.keys() - {"live"}))],  # "test" has it
    "compiler.txt": [*BUILD, *(text for text in EXTRAS["test"] if text.startswith("mypy>"))],
}
PYTHONS = ("3.11", "3.12", "3.13")
ADVICE = "run 'make lock'"


class Pin(NamedTuple):
    version: Version
    marker: Marker | None
    hashes: int


def pins(file: str) -> dict[str, list[Pin]]:
    text = (ROOT / "requirements" / file).read_text(encoding="utf-8").replace("\\\n", " ")
    found: dict[str, list[Pin]] = {}
    for line in text.splitlines():
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        requirement = Requirement(line.partition("--hash")[0].strip())
        ((operator, version),) = [(each.operator, each.version) for each in requirement.specifier]
        assert operator == "==", line
        hashes = len(re.findall(r"--hash=sha256:[0-9a-f]{64}\b", line))
        found.setdefault(canonicalize_name(requirement.name), []).append(
            Pin(Version(version), requirement.marker, hashes)
        )
    return found


def applying(pinned: list[Pin], python: str) -> list[Version]:
    environment = {"python_version": python, "python_full_version": f"{python}.1"}
    return [pin.version for pin in pinned if pin.marker is None or pin.marker.evaluate(environment)]


@pytest.mark.parametrize("file", DIRECT)
@pytest.mark.parametrize("python", PYTHONS)
def test_every_requirement_of_the_project_is_pinned_to_a_permitted_version(file: str, python: str) -> None:
    pinned = pins(file)
    for requirement in map(Requirement, DIRECT[file]):
        versions = applying(pinned.get(canonicalize_name(requirement.name), []), python)
        assert len(versions) == 1, f"{requirement}: {ADVICE}"
        assert requirement.specifier.contains(versions[0], prereleases=True), f"{requirement}: {ADVICE}"


@pytest.mark.parametrize("file", DIRECT)
def test_every_pin_has_hashes(file: str) -> None:
    assert all(pin.hashes for each in pins(file).values() for pin in each), ADVICE


@pytest.mark.parametrize("file", DIRECT)
def test_what_the_pinned_packages_need_is_pinned_too(file: str) -> None:
    """The metadata of the installed packages lists what they need."""
    pinned = pins(file)
    for name in pinned:
        try:
            needed = [Requirement(text) for text in requires(name) or []]
        except PackageNotFoundError:
            continue
        for requirement in needed:
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                assert canonicalize_name(requirement.name) in pinned, f"{name} needs {requirement}: {ADVICE}"
