"""Runs `mudskipper upgrade`: says what another version would change, and installs its Debian package.

The other version speaks for itself: its package is unpacked into a temporary folder, and its own programs read the
present configuration and list its keys. An earlier package is the way back.
"""

import os
import sys
from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

from command_line import exit_codes
from command_line.errors import CommandError
from command_line.init.key_reference import configuration_keys
from command_line.install.installation import run_command
from command_line.install.service_plan import (
    DEFAULT_PREFIX,
    MANIFEST,
    Run,
    System,
    WriteFile,
    plan_installation,
)
from command_line.shared_options import Socket
from control.computing.suggestion import similar_name
from control.modes import ENERGISED
from experiments.study.option import Option
from firmware_host.configuration.service_file import service_configuration
from operator_client.status_client import DroppedError, NoDaemonError, StatusClient

PATIENT: Run = partial(run_command, timeout_s=None)  # a dpkg that is ended leaves half a package
PRINT_KEYS = """\
from command_line.init.key_reference import configuration_keys
print(*(f"{key.section}.{key.name}" for key in configuration_keys()), sep="\\n")
"""


def upgrade(
    package: Annotated[Path, Option("mudskipper_….deb of the other version, also of an earlier one", metavar="FILE")],
    *,
    check: Annotated[bool, Option("only say what would change")] = False,
    socket: Socket,
    run: Run = PATIENT,
    root: Path = Path("/"),
) -> int:
    """Install the package, unless a drive has torque or the other version does not accept the configuration."""
    installed = run(("dpkg-query", "--show", "--showformat=${Version}", "mudskipper"))
    before = installed.text if installed.status == 0 else "no package"
    print(f"version        {before} -> {_output(run, 'dpkg-deb', '--field', str(package), 'Version')}")
    with TemporaryDirectory() as folder:
        _output(run, "dpkg-deb", "--extract", str(package), folder)
        environment = Path(folder) / DEFAULT_PREFIX.lstrip("/")
        problems = _describe(environment, root, run)
    if mode := energised_mode(socket):
        raise CommandError(f"the robot is in mode {mode}: 'mudskipper disarm' first", status=exit_codes.REFUSED)
    if problems:
        raise CommandError(*problems, status=exit_codes.CONFIGURATION)
    if not check:
        if installed.status != 0:
            raise CommandError("what is installed is no package: docs/how-to/install.md says how one replaces it")
        if os.geteuid() != 0:
            raise CommandError("this changes the system: run it with sudo", status=exit_codes.NOT_PERMITTED)
        print(_output(run, "dpkg", "--install", str(package)))
        print(f"The way back is 'mudskipper upgrade' with the package of {before}.")
    return exit_codes.OK


def _describe(environment: Path, root: Path, run: Run) -> list[str]:
    """Print what the version in this environment changes; return why it does not accept the configuration."""
    python, configuration = str(environment / "bin" / "python"), service_configuration(root)
    for line in key_changes(
        [f"{key.section}.{key.name}" for key in configuration_keys()],
        _output(run, python, "-I", "-c", PRINT_KEYS).splitlines(),
    ):
        print(f"keys           {line}")
    plan = plan_installation(System(root, Path(sys.prefix), run, live=True), environment / "share" / "mudskipper")
    written = [step for step in plan.steps if isinstance(step, WriteFile) and step.path != root / MANIFEST]
    for text in [*map(str, written), *plan.notes]:
        print(f"files          {text}")
    if not configuration.exists():
        print(f"configuration  there is no {configuration} yet")
        return []
    checked = run((python, "-I", "-m", "firmware_host.daemon", "--check-config", "--config", str(configuration)))
    print(f"configuration  {configuration} is {'accepted' if checked.status == 0 else 'not accepted'}")
    return checked.text.strip().splitlines() if checked.status else []


def key_changes(before: Collection[str], after: Collection[str]) -> Iterator[str]:
    """Yield one line for each key that is gone or new. A key that is gone may have another name."""
    new = [key for key in after if key not in before]
    for key in before:
        if key not in after:
            similar = similar_name(key, new)
            yield f"{key} is gone{f'; perhaps it is now {similar}' if similar else ''}"
    yield from (f"{key} is new" for key in new)


def energised_mode(socket: Socket) -> str:
    """Return the mode in which drives have torque; empty where they have none, or no daemon runs."""
    try:
        with StatusClient(socket) as client:
            mode = str(client.call("status")["mode"])
    except DroppedError:  # it runs, in a mode that it does not say
        raise
    except NoDaemonError:
        return ""
    return mode if mode in {each.name.lower() for each in ENERGISED} else ""


def _output(run: Run, *words: str) -> str:
    """Return what a command prints. Raises CommandError where it fails."""
    outcome = run(words)
    if outcome.status != 0:
        last_line = outcome.text.strip().rpartition("\n")[2]
        raise CommandError(last_line or f"{words[0]}: exit status {outcome.status}")
    return outcome.text.strip()
