"""Options that several commands have: the daemon's socket, JSON, a seed."""

from os import PathLike, environ
from os.path import basename, exists
from typing import Annotated, TypeAlias

from experiments.study.option import Option

DEFAULT_SOCKET = "/run/mudskipper/mudskipper.sock"
DEFAULT_CONFIG = "/etc/mudskipper/mudskipper.toml"
SIMULATED = "robot"  # the name that `mudskipper simulate` has without --bus


def default_socket() -> str:
    """Return $MUDSKIPPER_SOCKET, else the service's socket; where no service runs, that of `mudskipper simulate`."""
    return environ.get("MUDSKIPPER_SOCKET") or service_or_simulated(DEFAULT_SOCKET)


def service_or_simulated(path: str) -> str:
    """Return the path of a service's file; where there is none, that of `mudskipper simulate` if that exists."""
    if not exists(path):
        from drivers.can.run_folder import find_run_folder  # a robot's own computer does without it

        simulated = f"{find_run_folder()}/{SIMULATED}/{basename(path)}"
        return simulated if exists(simulated) else path
    return path


Json: TypeAlias = Annotated[bool, Option("print JSON for programs")]
Socket: TypeAlias = Annotated[
    str | PathLike[str],
    Option(
        "Unix socket of the daemon (default: $MUDSKIPPER_SOCKET, else that of the service or the simulated robot)",
        metavar="PATH",
        parse=str,
        default=default_socket,
    ),
]
Seed: TypeAlias = Annotated[int, Option("of the simulation's noise")]
