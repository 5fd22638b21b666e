"""Options of commands that read a robot's configuration or open its buses."""

from pathlib import Path
from typing import Annotated, TypeAlias

from experiments.study.option import Option, OptionError
from firmware_host.configuration.service_file import service_configuration
from operator_client.default_paths import service_or_simulated


def default_configuration() -> Path:
    """Return the daemon's configuration; where there is none, that of `mudskipper simulate`."""
    return Path(service_or_simulated(str(service_configuration())))


def interface_name(text: str) -> str:
    """Accept an interface of python-can. Raises argparse.ArgumentTypeError for another one."""
    from drivers.can.can_port import interface_problem  # slow to import

    if problem := interface_problem(text):
        raise OptionError(f"{text}: {problem}")
    return text


RobotConfiguration: TypeAlias = Annotated[
    Path,
    Option("of the robot (default: that of the daemon, or of the simulated robot)", default=default_configuration),
]
