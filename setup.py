"""Compiles the modules of a tick and of the simulator's step with mypyc where MUDSKIPPER_COMPILED=1 asks for it.

`tool.mudskipper.compiled` in pyproject.toml has the patterns of their paths; all other metadata is there too. Both
forms give the same digits, so the C compiler must not fuse a product and a sum into one operation with one rounding, as
it otherwise does on ARM. Each compiled build uses a folder of its own: an extension that an earlier build left would be
imported in place of the source.
"""

import os
import sys
import sysconfig
import tomllib
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

from setuptools import Extension, setup

VARIABLE = "MUDSKIPPER_COMPILED"
COMPILER = "mypy>=1.14,<3"  # mypyc comes with it
OPTIONS = ["-ffp-contract=off", "-Wno-error", "-g0"]


def compiled_modules(root: Path) -> list[str]:
    """Return the modules of the patterns, but for those whose fields have bounds, which a compiled class would lose."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    paths = {path for pattern in project["tool"]["mudskipper"]["compiled"] for path in root.glob(pattern)}
    modules = (path for path in paths if path.name != "__init__.py")
    return sorted(
        str(path.relative_to(root)) for path in modules if "Annotated[" not in path.read_text(encoding="utf-8")
    )


def make_extensions(folder: str) -> list[Extension]:
    """Return the extensions, whose C sources are written into the folder."""
    from mypyc.build import mypycify  # only here, since no other installation needs it

    options = ["--config-file=", "--ignore-missing-imports"]  # types of packages that the build does not have
    paths = [*options, *compiled_modules(Path())]
    extensions: list[Extension] = mypycify(paths, opt_level="2", group_name="mudskipper", target_dir=folder)
    for extension in extensions:
        extension.extra_compile_args += OPTIONS
    return extensions


def is_asked_for() -> bool:
    value = os.environ.get(VARIABLE, "")
    if value not in ("", "0", "1"):
        raise SystemExit(f"{VARIABLE}={value}: must be 1 for a compiled tick, or 0")
    if value == "1" and {"editable_wheel", "develop"} & set(sys.argv):
        raise SystemExit(f"{VARIABLE}=1: an editable installation runs the sources; install without --editable")
    return value == "1"


def require_compiler() -> None:
    compiler = (os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc").split()[0]
    if not which(compiler):
        raise SystemExit(
            f"{VARIABLE}=1: there is no C compiler '{compiler}'; 'apt install gcc', or leave {VARIABLE} out"
        )
    header = Path(sysconfig.get_path("include")) / "Python.h"
    if not header.exists():
        raise SystemExit(f"{VARIABLE}=1: there is no {header}; 'apt install python3-dev', or leave {VARIABLE} out")


def build() -> None:
    if not is_asked_for():
        setup()
    elif "bdist_wheel" in sys.argv:
        require_compiler()
        with TemporaryDirectory() as base:
            setup(ext_modules=make_extensions(f"{base}/sources"), options={"build": {"build_base": base}})
    else:  # pip asks for the metadata, and by egg_info for what the build needs
        setup(setup_requires=[COMPILER] if "egg_info" in sys.argv else [])


if __name__ == "__main__":
    build()
