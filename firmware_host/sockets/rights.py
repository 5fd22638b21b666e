"""Who may use which method of the status socket, by the credentials that the kernel reports for a connection.

SO_PEERCRED and SO_PEERGROUPS (unix(7), Linux 4.13) give user, process and groups of the other end at the time when it
connected; a client cannot forge them. There are three levels: every user may stop the robot, readers see its state,
operators move it. Operators also read; root and the daemon's own user may do everything. The file of the socket is open
to every user, since one group cannot own it for readers and operators; unauthorised users are refused here.
"""

import socket
import struct
from typing import NamedTuple

from firmware_host.sockets.rpc import FOR_MEMBERS, NOT_PERMITTED
from firmware_host.sockets.socket_methods import METHODS, Level

CREDENTIALS = struct.Struct("iII")  # struct ucred: pid, uid, gid
SO_PEERGROUPS = 59  # asm-generic/socket.h; Python has no name for it
GROUP_BYTES, LONGEST_ANSWER = 4, 1024  # as much as Python's getsockopt fetches: 256 groups


class Peer(NamedTuple):
    """The process at the other end of a connection."""

    pid: int
    uid: int
    groups: frozenset[int]


class Group(NamedTuple):
    name: str
    gid: int


class Rights(NamedTuple):
    readers: Group
    operators: Group
    own_uid: int
    anyone_may_stop: bool = True

    def level(self, peer: Peer) -> Level:
        if peer.uid in (0, self.own_uid) or self.operators.gid in peer.groups:
            return Level.DRIVE
        return Level.READ if self.readers.gid in peer.groups else Level.ANYONE

    def refusal(self, method: str, level: Level) -> str | None:
        needed = METHODS[method].level if method in METHODS else Level.DRIVE
        if level >= needed:
            return None
        return _for_members(method, self.operators if needed is Level.DRIVE else self.readers)

    def refusal_to_connect(self, level: Level) -> str | None:
        if self.anyone_may_stop or level > Level.ANYONE:
            return None
        return _for_members("this robot", self.readers)


def _for_members(what: str, group: Group) -> str:
    join = f"Have root run 'adduser YOU {group.name}', then log in again"
    advice = join if group.gid else "Use sudo, or name another group in [status] of the configuration"
    return f"{NOT_PERMITTED}{what} is {FOR_MEMBERS}{group.name}. {advice}"


def read_peer(connection: socket.socket) -> Peer:
    """Read the credentials of a connection's other end; raises OSError."""
    pid, uid, gid = CREDENTIALS.unpack(connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size))
    return Peer(pid, uid, frozenset((gid, *_supplementary_groups(connection))))


def _supplementary_groups(connection: socket.socket) -> tuple[int, ...]:
    """Return the supplementary groups; none if they do not fit, or with an old kernel.

    Such a peer counts with its primary group alone: a name service could block a tick for seconds.
    """
    try:
        answer = connection.getsockopt(socket.SOL_SOCKET, SO_PEERGROUPS, LONGEST_ANSWER)
    except OSError:
        return ()
    return struct.unpack(f"{len(answer) // GROUP_BYTES}I", answer)
