"""Options that several commands have: the daemon's socket, the configuration, JSON."""

import os
from pathlib import Path
from typing import Annotated, TypeAlias

from drivers.can.run_folder import find_run_folder
from experiments.study.option import Option, OptionError

DEFAULT_SOCKET = "/run/mudskipper/mudskipper.sock"
DEFAULT_CONFIG = "/etc/mudskipper/mudskipper.toml"
SIMULATED = "robot"  # the name that `mudskipper simulate` has without --bus


def default_socket() -> Path:
    """Return $MUDSKIPPER_SOCKET, else the service's socket; where no service runs, that of `mudskipper simulate`."""
    given = os.environ.get("MUDSKIPPER_SOCKET")
    return Path(given) if given else _of_service_or_simulation(Path(DEFAULT_SOCKET))


def default_configuration() -> Path:
    """Return the daemon's configuration; where there is none, that of `mudskipper simulate`."""
    return _of_service_or_simulation(Path(DEFAULT_CONFIG))


def _of_service_or_simulation(path: Path) -> Path:
    folder = None if path.exists() else find_run_folder()
    simulated = folder / SIMULATED / path.name if folder else path
    return simulated if simulated.exists() else path


def interface_name(text: str) -> str:
    """Accept an interface of python-can. Raises argparse.ArgumentTypeError for another one."""
    from drivers.can.can_port import interface_problem  # slow to import

    if problem := interface_problem(text):
        raise OptionError(f"{text}: {problem}")
    return text


Json: TypeAlias = Annotated[bool, Option("print JSON for programs")]
Socket: TypeAlias = Annotated[
    Path,
    Option(
        "Unix socket of the daemon (default: $MUDSKIPPER_SOCKET, else that of the service or the simulated robot)",
        metavar="PATH",
        default=default_socket,
    ),
]
RobotConfiguration: TypeAlias = Annotated[
    Path,
    Option("of the robot (default: that of the daemon, or of the simulated robot)", default=default_configuration),
]
Seed: TypeAlias = Annotated[int, Option("of the simulation's noise")]
