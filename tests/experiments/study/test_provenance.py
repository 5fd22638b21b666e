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


def digest_of(folder: Path, module: str = STUDY) -> str:
    command = [sys.executable, "-c", PRINT, module]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout.strip()


def test_only_what_a_study_computes_with_changes_its_digest(tmp_path: Path) -> None:
    """The product's folders are copied to another location, as a wheel installs them."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))

    def change(*paths: str) -> None:
        for path in paths:
            with (tmp_path / path).open("a", encoding="utf-8") as file:
                file.write("ANOTHER = 1\n")

    change("experiments/actuator/plan.py", "command_line/main.py", "experiments/studies/mud_fit.py", "control/new.py")
    digests = [digest_of(tmp_path)]
    assert digests == [identity(STUDY)["sources"]]
    for used in ("simulation/mud/clay.py", "firmware_host/configuration/gaits/measuring.toml"):
        change(used)
        digests.append(digest_of(tmp_path))
    imports_within_a_function = "command_line.experiments.studies"
    digests.append(digest_of(tmp_path, imports_within_a_function))
    change("experiments/study/cluster_workers.py")
    digests.append(digest_of(tmp_path, imports_within_a_function))
    assert len(set(digests)) == 5


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
