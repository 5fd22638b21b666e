"""Builds the wheel, compares its files with the repository's, and walks the demo from it in an empty environment.

    .venv/bin/python -m verification.wheel

`make wheel` runs it. The environment has the locked dependencies alone, and the demo runs in an empty folder.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from zipfile import ZipFile

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "wheel"
PIP = ("-m", "pip", "--disable-pip-version-check", "--quiet")
INSTALLED = (
    *("command_line", "control", "drivers", "estimation", "experiments", "firmware_host", "logs", "mudskipper"),
    *("operator_client", "simulation", "verification/faults", "verification/studies"),
)
WORLD = "[[segment]]\nstart_m = 0.0\nend_m = 0.4\nwater_percent = 48.5\n"


def build() -> Path:
    """Return the new wheel. A module that was deleted since an earlier build must not come back out of build/lib."""
    shutil.rmtree(ROOT / "build" / "lib", ignore_errors=True)
    shutil.rmtree(FOLDER, ignore_errors=True)
    _run(sys.executable, *PIP, "wheel", "--no-deps", "--no-index", "--no-build-isolation", "-w", FOLDER, ROOT)
    return next(FOLDER.glob("*.whl"))


def wrong_files(wheel: Path) -> list[str]:
    """Return the files that the wheel lacks, and those that nobody put into the repository."""
    listed = subprocess.run(["git", "ls-files", *INSTALLED, "systemd"], cwd=ROOT, check=True, capture_output=True)
    wanted = {PurePosixPath(name) for name in listed.stdout.decode().splitlines()}
    with ZipFile(wheel) as files:
        names = [PurePosixPath(name) for name in files.namelist() if ".dist-info/" not in name]
    found = {PurePosixPath("systemd", name.name) if ".data" in name.parts[0] else name for name in names}
    return [str(name) for name in sorted(wanted ^ found)]


def walk_demo(wheel: Path) -> None:
    """Install the wheel into an empty environment, and walk over a short track from it."""
    environment = FOLDER / "environment"
    _run(sys.executable, "-m", "venv", environment)
    python = environment / "bin" / "python"
    locked = ("--require-hashes", "--only-binary=:all:", "-r", ROOT / "requirements" / "robot.txt")
    _run(python, *PIP, "install", "--no-deps", "--no-compile", *locked)
    _run(python, *PIP, "install", "--no-deps", "--no-index", wheel)
    _run(python, *PIP, "check")
    with tempfile.TemporaryDirectory(prefix="mud-") as folder:
        Path(folder, "world.toml").write_text(WORLD, encoding="utf-8")
        _run(environment / "bin" / "mudskipper", "demo", "--world", "world.toml", folder=folder)
        _run(environment / "bin" / "mudskipper", "install", "--dry-run", "--root", folder, folder=folder)


def _run(*words: str | Path, folder: str | Path = ROOT) -> None:
    bare = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    subprocess.run(words, cwd=folder, env=bare, check=True)


def main(arguments: Sequence[str] = ()) -> int:
    wheel = build()
    if wrong := wrong_files(wheel):
        print(f"{wheel.name} and the repository differ in {', '.join(wrong)}", file=sys.stderr)
        return 1
    walk_demo(wheel)
    print(f"{wheel.relative_to(ROOT)} is whole; 'pipx install ./{wheel.relative_to(ROOT)}' installs it")
    return 0


if __name__ == "__main__":
    sys.exit(main())
