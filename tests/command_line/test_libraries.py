"""Commands load no library that they do without, and name the extra that brings a missing one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.main import main
from firmware_host.log.log_folder import DONE
from tests.folders import ROOT
from tests.waiting import LONGEST_S

LARGE = ("numpy", "can", "pydantic", "matplotlib")
SLOW = ("pathlib", "socket", "locale", "json", "shutil", "inspect", "tempfile", "shtab", "mcap")
MOST_OWN = 13  # modules of `status`: each takes a hundredth of the time that a bare interpreter takes to start


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / DONE).mkdir()
    (tmp_path / DONE / "walk.mcap").write_bytes((ROOT / "tests/fixtures/walk_0_1.mcap").read_bytes())
    return tmp_path


def ended(program: str, folder: Path) -> subprocess.CompletedProcess[str]:
    text = f"import sys; from command_line.main import main; {program}"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", text]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=LONGEST_S, check=True, cwd=folder, env=environment
    )


def modules_of(words: str, folder: Path) -> set[str]:
    return set(ended(f"main({words.split()}); print(*sys.modules)", folder).stdout.splitlines()[-1].split())


def test_a_quick_command_loads_no_large_library(folder: Path) -> None:
    """Half a second of imports is longer than a listing takes."""
    assert main(["log", "index", str(folder)]) == exit_codes.OK
    assert modules_of("log list .", folder).isdisjoint(LARGE)


def test_status_loads_what_it_shows_and_nothing_else(folder: Path) -> None:
    """It starts in less than three times the time of a bare interpreter, which loads what an editable install needs."""
    bare = subprocess.run([sys.executable, "-c", "import sys; print(*sys.modules)"], capture_output=True, check=True)
    loaded = modules_of("status --socket /none", folder) - set(bare.stdout.decode().split())
    assert loaded.isdisjoint(LARGE + SLOW)
    own = [name for name in loaded if name.startswith("command_line.")]
    assert len(own) <= MOST_OWN and [name for name in own if name.count(".") > 1] == ["command_line.operation.status"]
    others = {name for name in loaded if name.startswith(("firmware_host.", "operator_client."))}
    assert {name.split(".")[1] for name in others} == {
        "sockets",
        "status_client",
        "default_paths",
    }  # what asks the daemon


def test_without_a_library_the_extra_is_named_that_brings_it(folder: Path) -> None:
    log = str(folder / DONE / "walk.mcap")
    needed = {
        ("plot", log): "plots",
        ("film", log): "plots",
        ("film", log, "--out", "x.gif"): "plots",
        ("log", "export", "--parquet", log): "data",
        ("log", "query", "select 1", "."): "data",
        ("experiment", "trackway", "--simulated"): "plots",
        ("experiment", "loadcell", "--simulated"): "plots",
        ("ros2",): "ros2",
        ("log", "list", "."): "",
    }
    program = (
        "sys.modules.update(dict.fromkeys(('matplotlib', 'scipy', 'pyarrow', 'duckdb', 'zenoh')))\n"
        f"print([main(command) for command in {[*needed]}])"
    )
    found = ended(program, folder)
    statuses = [exit_codes.UNHEALTHY if extra else exit_codes.OK for extra in needed.values()]
    assert "walk.mcap" in found.stdout and found.stdout.splitlines()[-1] == str(statuses)
    assert [found.stderr.count(f"extra '{extra}'") for extra in ("plots", "data", "ros2")] == [5, 2, 1]
    assert "Traceback" not in found.stderr


def test_pictures_of_a_walk_need_the_extra_plots_alone(folder: Path) -> None:
    log = str(folder / DONE / "walk.mcap")
    commands = [["plot", log, "--out", "walk.png"], ["film", log, "--out", "film.png"]]
    program = (
        "sys.modules.update(dict.fromkeys(('pandas', 'pyarrow', 'duckdb')))\n"
        f"print([main(command) for command in {commands}])"
    )
    assert ended(program, folder).stdout.splitlines()[-1] == str([exit_codes.OK] * len(commands))
