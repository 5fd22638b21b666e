"""Builds the compiled form of the program into a folder, and runs modules of this repository in either form.

`python -m tests.compiled.compiled_installation FOLDER` builds it for other uses, such as the whole suite of tests.
"""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from tests.folders import ROOT

LONGEST_BUILD_S = 3600.0
LONGEST_RUN_S = 1200.0


def install_compiled(folder: Path) -> None:
    """Build a wheel from this environment's packages and install it into the folder, without network."""
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
    wheels = folder / "wheels"
    build = ["wheel", "--no-build-isolation", "--no-deps", "--no-index", "--wheel-dir", str(wheels), str(ROOT)]
    run([*pip, *build], os.environ | {"MUDSKIPPER_COMPILED": "1"}, LONGEST_BUILD_S)
    (wheel,) = wheels.glob("*.whl")
    run([*pip, "install", "--no-deps", "--no-index", "--target", str(folder), str(wheel)], os.environ, LONGEST_BUILD_S)


def run_module(folder: Path | None, module: str, *arguments: str) -> str:
    """Run a module with the program in that folder, or with the sources, and return its output."""
    packages = [str(folder)] if folder else []
    path = os.pathsep.join([*packages, str(ROOT)])
    environment = os.environ | {"PYTHONPATH": path, "PYTHONSAFEPATH": "1"}
    return run([sys.executable, "-m", module, *arguments], environment, LONGEST_RUN_S)


def run(command: list[str], environment: Mapping[str, str], longest_s: float) -> str:
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=longest_s)
    assert ended.returncode == 0, f"{' '.join(command)}\n{ended.stdout[-2000:]}\n{ended.stderr[-2000:]}"
    return ended.stdout


if __name__ == "__main__":
    install_compiled(Path(sys.argv[1]).absolute())
