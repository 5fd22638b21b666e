"""`mudskipper log open`: opens a log in a viewer with the project's layout, or says what is missing."""

import argparse
import shlex
import subprocess
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from shutil import which

from mcap.exceptions import McapError
from mcap.reader import make_reader

from command_line import exit_codes
from command_line.logs.refusals import explain_errors
from command_line.screen import complain
from firmware_host.log.log_file import is_being_written
from firmware_host.log.log_folder import why_not_read
from logs.files.log_error import DAMAGE, LogError

LAYOUTS = Path(__file__).parent / "layouts"
FOXGLOVE_PROGRAMS = ("lichtblick", "foxglove-studio", "foxglove")  # the first one that is installed
STANDARD_TOPIC = "/joint_states"


@explain_errors
def open_log(options: argparse.Namespace) -> int:
    has_standard = STANDARD_TOPIC in _topics(options.file)
    if not has_standard and options.viewer != "plotjuggler":
        complain(f"the 3D view and Rerun's plots need an export: mudskipper log export --ros {options.file}")
    start = {"foxglove": _foxglove, "plotjuggler": _plotjuggler, "rerun": _rerun}[options.viewer]
    return start(options.file)


def _topics(path: Path) -> set[str]:
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
        raise LogError(f"{path}: not a finished log, which viewers refuse: 'mudskipper log recover' repairs it")
    return {channel.topic for channel in summary.channels.values()}


def _foxglove(log: Path) -> int:
    layout = LAYOUTS / "foxglove.json"
    program = next(filter(None, map(which, FOXGLOVE_PROGRAMS)), None)
    print(f"the layout: menu View, 'Import layout from file', {layout}")
    if program:
        return _start([program, str(log)])
    complain(f"neither Lichtblick (free) nor Foxglove is installed here: install one and open {log} in it")
    return exit_codes.UNHEALTHY


def _plotjuggler(log: Path) -> int:
    command = ["plotjuggler", "-d", str(log), "-l", str(LAYOUTS / "plotjuggler.xml")]
    if program := which("plotjuggler"):
        return _start([program, *command[1:]])
    complain(f"PlotJuggler is not installed here: install it, then: {shlex.join(command)}")
    return exit_codes.UNHEALTHY


def _rerun(log: Path) -> int:
    if find_spec("rerun") is None or not (program := which("rerun")):
        complain("Rerun is not installed here: pip install rerun-sdk, in the environment of mudskipper")
        return exit_codes.UNHEALTHY
    from command_line.viewers.rerun_blueprint import write_recording

    recording = Path(f"{log.name.removesuffix('.mcap')}.rrd")
    write_recording(log, recording)
    print(f"written  {recording}")
    return _start([program, str(recording)])


def _start(command: Sequence[str]) -> int:
    """Starts a viewer that outlives this command."""
    subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    print(f"started  {shlex.join(command)}")
    return exit_codes.OK
