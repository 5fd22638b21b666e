"""Lets one program alone command the drives of a bus, and one alone simulate them, on one computer.

The lock is a Unix socket with an abstract name that is made of role, interface and channel. The kernel frees the name
when its owner dies in any way, every user and a service with a private /tmp or a read-only disk see the same names, and
like CAN interfaces they belong to one network namespace. No file remains, and no folder needs permissions. A
program on another computer of the bus is detected by its commands: see drivers/drive_axis.py.
"""

import errno
import os
import socket
import struct
from enum import StrEnum
from hashlib import blake2b

CREDENTIALS = struct.Struct("3i")  # pid, uid and gid of SO_PEERCRED
NAME_BYTES = 16
LOCAL_INTERFACE = "mudskipper_local"  # whose plain channel names belong to one user


class BusRole(StrEnum):
    COMMANDS = "commands"  # of the daemon, or of the bench
    DRIVES = "drives"  # of a simulated robot


DOES = {BusRole.COMMANDS: "commands", BusRole.DRIVES: "simulates"}


class BusTakenError(Exception):
    """Another program has this role on the bus."""


class BusLock:
    """Owns the role on one bus until it is closed."""

    def __init__(self, role: BusRole, interface: str, channel: str) -> None:
        """Raises BusTakenError where another program has the role."""
        name = _lock_name(role, interface, channel)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.bind(name)
            self._socket.listen(socket.SOMAXCONN)  # each question for the owner stays in the queue: none is accepted
        except OSError as problem:
            self._socket.close()
            if problem.errno != errno.EADDRINUSE:
                raise
            pid = _owner_of(name)
            owner = f"process {pid}" if pid else "another program"
            raise BusTakenError(f"{owner} {DOES[role]} its drives already; end it first") from None

    def close(self) -> None:
        self._socket.close()


def _lock_name(role: BusRole, interface: str, channel: str) -> bytes:
    """Return the same name for every path to one device, and another one for other users' local buses."""
    if "/" in channel:
        channel = os.path.realpath(channel.split("@")[0])  # slcan: device@bit rate
    elif interface == LOCAL_INTERFACE:
        channel = f"{channel} of {os.geteuid()} in {os.environ.get('XDG_RUNTIME_DIR')}"
    digest = blake2b(f"{interface} {channel}".encode(), digest_size=NAME_BYTES).hexdigest()
    return b"\0" + f"mudskipper-{role}-{digest}".encode()


def bus_owner(role: BusRole, interface: str, channel: str) -> int:
    """Return the process that has the role on a bus; 0 where none has it."""
    return _owner_of(_lock_name(role, interface, channel))


def _owner_of(name: bytes) -> int:
    """Return the process that owns a lock, or 0. The kernel reports who listens without its help."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.setblocking(False)
        try:
            probe.connect(name)
            pid, _, _ = CREDENTIALS.unpack(probe.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size))
        except OSError:  # its queue is full, or there is none
            return 0
    return int(pid)
