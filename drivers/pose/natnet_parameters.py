"""Where the motion capture's NatNet frames come from, as it is configured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds
from drivers.pose.natnet_codec import NEWEST, OLDEST, NatNetVersion


@dataclass(frozen=True)
class NatNetParameters:
    server: str = ""  # address of the computer that runs the motion capture; empty: nothing is asked from it
    interface: str = ""  # on which frames arrive, by name or address; empty: any
    group: str = "239.255.42.99"  # that the server multicasts to; empty: it sends to this computer alone
    port: Annotated[int, Bounds(1, 65535)] = 1511  # of the multicast frames
    command_port: Annotated[int, Bounds(1, 65535)] = 1510  # at which the server takes requests
    version: str = ""  # of the protocol, such as "4.1"; empty: the server tells it
    body: str = ""  # name of the rigid body; empty: by its id
    body_id: Annotated[int, Bounds(0, 2**31 - 1)] = 0  # its streaming id; 0: the first one
    latency_s: Annotated[float, Bounds(0.0, 0.2)] = 0.0  # of every frame, besides what it tells itself


def parse_version(text: str) -> NatNetVersion | None:
    """None for what is no version that is read here."""
    major, dot, minor = text.partition(".")
    if not (dot and major.isdecimal() and minor.isdecimal() and len(text) < 8):
        return None
    version = NatNetVersion(int(major), int(minor))
    return version if OLDEST <= version <= NEWEST else None
