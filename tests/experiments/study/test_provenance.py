"""The digest of a study's sources changes with what the study computes with, and with nothing else."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from experiments.study.provenance import PACKAGES, identity
from tests.folders import ROOT

STUDY = "experiments.studies.sweep"
PRINT = "import sys; from experiments.study.provenance import source_digest; print(source_digest(sys.argv[1]))"


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Provide the product's folders at another location, as a wheel installs them."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def digest_of(folder: Path, module: str = STUDY) -> str:
    command = [sys.executable, "-c", PRINT, module]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout.strip()


def test_another_location_has_the_same_digest_and_a_changed_constant_another_one(copy: Path) -> None:
    here = identity(STUDY)["sources"]
    assert digest_of(copy) == here
    for unused in ("experiments/actuator/plan.py", "command_line/main.py", "experiments/studies/mud_fit.py"):
        with (copy / unused).open("a") as module:
            module.write("ANOTHER = 1\n")
    (copy / "simulation" / "another.py").write_text("ANOTHER = 1\n")
    assert digest_of(copy) == here
    clay = copy / "simulation" / "mud" / "clay.py"
    changed = clay.read_text(encoding="utf-8").replace("ADHESION = 0.25", "ADHESION = 0.26")
    clay.write_text(changed, encoding="utf-8")
    assert digest_of(copy) != here


def test_a_gait_that_ships_counts(copy: Path) -> None:
    before = digest_of(copy)
    with (copy / "firmware_host" / "configuration" / "gaits" / "measuring.toml").open("a") as gait:
        gait.write("# another\n")
    assert digest_of(copy) != before


def test_an_import_within_a_function_counts(copy: Path) -> None:
    before = digest_of(copy, "command_line.experiments.studies")
    with (copy / "experiments/study/cluster_workers.py").open("a") as module:
        module.write("ANOTHER = 1\n")
    assert digest_of(copy, "command_line.experiments.studies") != before


def test_two_modules_have_the_digest_of_all_that_they_import() -> None:
    one, two = identity(STUDY)["sources"], identity("experiments.studies.actuator")["sources"]
    both = identity(STUDY, "experiments.studies.actuator")["sources"]
    assert len({one, two, both}) == 3
    assert identity(STUDY, "experiments.trackway.walk")["sources"] == one  # the study imports it


def test_a_module_that_is_not_of_the_product_is_refused() -> None:
    for module in ("numpy", "simulation.none", "__main__", "tests.folders"):
        with pytest.raises(ValueError, match=module):
            identity(STUDY, module)


def test_every_package_of_the_product_is_searched() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    installed = project["tool"]["setuptools"]["packages"]["find"]["include"]
    assert {name.partition(".")[0].removesuffix("*") for name in installed} == set(PACKAGES)
