"""The configuration of a NatNet client."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds, Meaning
from drivers.pose.natnet_codec import NEWEST, OLDEST, NatNetVersion


@dataclass(frozen=True)
class NatNetParameters:
    server: Annotated[str, Meaning("address of the motion-capture computer; empty: no request is sent to it")] = ""
    interface: Annotated[str, Meaning("where frames arrive, by name or address; empty: any")] = ""
    group: Annotated[str, Meaning("multicast address of the frames; empty: unicast to this computer")] = "239.255.42.99"
    port: Annotated[int, Bounds(1, 65535), Meaning("of the multicast frames", "UDP port")] = 1511
    command_port: Annotated[int, Bounds(1, 65535), Meaning("at which the server takes requests", "UDP port")] = 1510
    version: Annotated[str, Meaning("of the protocol, such as 4.1; empty: the server reports it")] = ""
    body: Annotated[str, Meaning("name of the rigid body; empty: chosen by body_id")] = ""
    body_id: Annotated[int, Bounds(0, 2**31 - 1), Meaning("streaming id of the rigid body; 0: the first one", "id")] = 0
    latency_s: Annotated[float, Bounds(0.0, 0.2), Meaning("of every frame, in addition to what the frame reports")] = (
        0.0
    )


def parse_version(text: str) -> NatNetVersion | None:
    """Returns None for a text that is no version, and for unsupported versions."""
    major, dot, minor = text.partition(".")
    if not (dot and major.isdecimal() and minor.isdecimal() and len(text) < 8):
        return None
    version = NatNetVersion(int(major), int(minor))
    return version if OLDEST <= version <= NEWEST else None
