"""The top-level names `control`, `drivers` and the like are ours alone, although python-control has one of them too."""

import sys
from importlib.metadata import packages_distributions
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.folders import ROOT

NAMES = ["control", "estimation", "drivers", "firmware_host", "simulation", "command_line"]


def foreign_owners(name: str) -> set[str]:
    """Other distributions in this environment that bring a top-level package of this name."""
    return set(packages_distributions().get(name, [])) - {"mudskipper"}


@pytest.mark.parametrize("name", NAMES)
def test_the_package_that_is_imported_lies_in_this_repository(name: str) -> None:
    spec = find_spec(name)
    assert spec is not None
    assert spec.origin is not None
    assert Path(spec.origin).resolve() == ROOT / name / "__init__.py"


@pytest.mark.parametrize("name", NAMES)
def test_no_other_distribution_owns_the_import_name(name: str) -> None:
    assert foreign_owners(name) == set()


def test_python_control_in_the_same_environment_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "control-0.10.2.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: control\nVersion: 0.10.2\n")
    (folder / "RECORD").write_text("control/__init__.py,,\ncontrol-0.10.2.dist-info/METADATA,,\n")
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    assert foreign_owners("control") == {"control"}
    assert foreign_owners("drivers") == set()
