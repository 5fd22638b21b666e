"""The robot of this computer where none is named: the service's, else the one that `mudskipper simulate` simulates."""

from os import environ
from os.path import basename, exists

DEFAULT_SOCKET = "/run/mudskipper/mudskipper.sock"
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
