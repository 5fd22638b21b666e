"""`mudskipper log open`: opens a log in a viewer with the project's layout, or says what is missing.

The viewers read a log as it is: Rerun shows every field of every row by itself, the others have a layout here.
"""

import shlex
import subprocess
from collections.abc import Sequence
from pathlib import Path
from shutil import which
from typing import Annotated, Literal

from mcap.exceptions import McapError
from mcap.reader import make_reader

from command_line import exit_codes
from command_line.screen import complain
from experiments.study.option import Option
from logs.files.log_error import DAMAGE, LogError
from logs.files.stored_logs import is_being_written, why_not_read

LAYOUTS = Path(__file__).parent / "layouts"
FOXGLOVE_PROGRAMS = ("lichtblick", "foxglove-studio", "foxglove")  # the first one that is installed


Viewer = Annotated[
    Literal["foxglove", "plotjuggler", "rerun"], Option("foxglove: Lichtblick or Foxglove", name="--with")
]


def open_log(log: Annotated[Path, Option("log of this project")], *, viewer: Viewer) -> int:
    _require_finished(log)
    programs: Sequence[str] = (viewer,)
    arguments, install = [str(log)], "install Rerun (pip install rerun-sdk)"
    if viewer == "foxglove":
        programs, install = FOXGLOVE_PROGRAMS, "install Lichtblick (free) or Foxglove"
        print(f"the layout: menu View, 'Import layout from file', {LAYOUTS / 'foxglove.json'}")
    if viewer == "plotjuggler":
        arguments, install = ["-d", str(log), "-l", str(LAYOUTS / "plotjuggler.xml")], "install PlotJuggler"
    program = next(filter(None, map(which, programs)), None)
    return _start(program, arguments, f"{install}, then: {shlex.join([programs[0], *arguments])}")


def _require_finished(path: Path) -> None:
    """Raises LogError for a file that viewers cannot open."""
    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
    except OSError as problem:
        raise LogError(why_not_read(path, problem)) from None
    except (*DAMAGE, McapError):
        summary = None
    if summary is None and is_being_written(path):
        raise LogError(f"{path}: still being written, which viewers refuse: 'mudskipper live' shows it meanwhile")
    if summary is None:
        raise LogError(f"{path}: not a finished log, which viewers refuse: 'mudskipper log recover FILE' repairs it")


def _start(program: str | None, arguments: Sequence[str], advice: str) -> int:
    """Start a viewer that outlives this command."""
    if program is None:
        complain(f"no viewer of this kind is found here: {advice}")
        return exit_codes.UNHEALTHY
    subprocess.Popen(
        [program, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    print(f"started  {shlex.join([program, *arguments])}")
    return exit_codes.OK
