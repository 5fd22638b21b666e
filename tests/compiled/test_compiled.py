"""The compiled form of the program does the same as its sources, to the last digit."""

import json
import os
from pathlib import Path
from typing import Any

import pytest

from firmware_host.configuration.configuration import Configuration
from simulation.harness.drive_presets import DRIVES
from tests.compiled.compiled_installation import install_compiled, run_module
from tests.recorded_walks import record_walks

pytestmark = pytest.mark.compiled
FOLDER = "MUDSKIPPER_COMPILED_FOLDER"  # an installation that compiled_installation.py built before


@pytest.fixture(scope="session")
def compiled_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the compiled form, which takes minutes to build."""
    given = os.environ.get(FOLDER)
    if given:
        return Path(given)
    folder = tmp_path_factory.mktemp("compiled")
    install_compiled(folder)
    return folder


def in_both_forms(compiled_folder: Path, module: str, *arguments: str) -> tuple[Any, Any]:
    """Return what the module prints as JSON: from the sources, and compiled."""
    interpreted, compiled = (run_module(folder, module, *arguments) for folder in (None, compiled_folder))
    return json.loads(interpreted), json.loads(compiled)


def test_every_drive_gets_the_same_frames_and_every_log_the_same_rows(compiled_folder: Path) -> None:
    interpreted, compiled = in_both_forms(compiled_folder, "tests.compiled.walk_hashes")
    assert (interpreted["compiled"], compiled["compiled"]) == (False, True)
    assert interpreted["walks"].keys() == {*DRIVES, "one flipper", "over a stone"}
    assert compiled["walks"] == interpreted["walks"]


def test_the_same_values_are_refused_with_the_same_messages(compiled_folder: Path) -> None:
    interpreted, compiled = in_both_forms(compiled_folder, "tests.compiled.refused_bounds")
    assert [key for key, refused in interpreted.items() if not all(refused)] == []
    assert compiled == interpreted


def test_a_replay_has_the_same_digits(compiled_folder: Path, configuration: Configuration, tmp_path: Path) -> None:
    log = tmp_path / "walk.mcap"
    record_walks(log, configuration, 3, 2)
    for method in ("default", "paper"):
        command = ("command_line.main", "replay", str(log), "--method", method, "--json")
        interpreted, compiled = in_both_forms(compiled_folder, *command)
        assert len(interpreted["strides"]) >= 8
        assert compiled == interpreted
