"""Options that several commands have: the daemon's socket, JSON, a seed."""

from os import PathLike
from typing import Annotated, TypeAlias

from experiments.study.option import Option
from operator_client.default_paths import default_socket

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
