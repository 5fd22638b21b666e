"""Which interfaces carry CAN FD frames: by name for those that never do, by the kernel's MTU for the others.

Linux gives a CAN interface an MTU of 72 bytes, the size of `struct canfd_frame`, where it was set up for CAN FD (linux/
can.h). Elsewhere a socket accepts the option for CAN FD, and the kernel refuses each frame.
"""

from contextlib import suppress
from pathlib import Path
from typing import Any

import can

FD_MTU = 72  # 16 without CAN FD
# python-can's interfaces to hardware or protocols without CAN FD, or whose CAN FD is out of the standard.
CLASSIC_INTERFACES = frozenset(
    {"cantact", "gs_usb", "iscan", "nican", "robotell", "seeedstudio", "serial", "slcan", "usb2can"}
)


def carries_fd(folder: Path) -> bool | None:
    """Return whether the interface of a folder of /sys/class/net carries CAN FD; None where that is unknown."""
    with suppress(OSError, ValueError):
        return int((folder / "mtu").read_text()) >= FD_MTU
    return None


def fd_options(interface: str, channel: str, root: Path = Path("/")) -> dict[str, Any]:
    """Return the options that open an interface for CAN FD; raises ValueError where it carries none."""
    if interface in CLASSIC_INTERFACES:
        raise ValueError(
            f"{interface} carries no CAN FD, which its drives need; use an adapter with SocketCAN and CAN FD"
        )
    if interface == "socketcan" and carries_fd(root / "sys/class/net" / channel) is False:
        raise ValueError(
            f"{channel} is set up without CAN FD, which its drives need: set FDMode=yes, see docs/how-to/moteus.md"
        )
    return {"protocol": can.CanProtocol.CAN_FD} if interface == "virtual" else {"fd": True}
