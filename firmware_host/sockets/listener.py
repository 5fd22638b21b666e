"""One listening socket of the daemon with places of its own, which clients of another listener cannot take.

When all places are in use, the user with the most connections loses one, so that no user can exclude another; the
holder of the lease keeps its own.
"""

from collections import Counter
from collections.abc import Callable

from firmware_host.sockets.connection import Caller, Client
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.socket_file import SocketFile


class Listener:
    """Owns the clients of one listening socket, and the order in which they are answered."""

    def __init__(self, file: SocketFile, most_clients: int) -> None:
        self.file = file
        self.most_clients = most_clients
        self.clients: dict[int, Client] = {}  # ordered by their last message, oldest first
        self.waiting: dict[int, None] = {}  # clients that may have an unanswered request, in turn
        self._connections: Counter[int] = Counter()  # of every user

    def add(self, descriptor: int, client: Client) -> None:
        self.clients[descriptor] = client
        self._connections[client.caller.peer.uid] += 1

    def remove(self, descriptor: int) -> Client:
        client = self.clients.pop(descriptor)
        self.waiting.pop(descriptor, None)
        uid = client.caller.peer.uid
        self._connections[uid] -= 1
        if not self._connections[uid]:
            del self._connections[uid]
        return client

    @property
    def is_full(self) -> bool:
        return len(self.clients) >= self.most_clients

    def choose_victim(self, newcomer: Peer, is_protected: Callable[[Caller], bool]) -> tuple[int, bool]:
        """Return the longest silent client of the user with the most connections, and whether it is the only one.

        Of users with equally many, the less privileged one loses.
        """
        chosen, most = next(iter(self.clients)), (0, 0, False)  # where every client is protected
        for descriptor, client in self.clients.items():
            uid, level = client.caller.peer.uid, client.caller.level
            claim = (self._connections[uid] + (uid == newcomer.uid), -level, descriptor not in self.waiting)
            if claim > most and not is_protected(client.caller):
                chosen, most = descriptor, claim
        return chosen, most[0] == 1

    def next_to_answer(self, now_s: float) -> int | None:
        """Remove and return the first client in turn whose request rate permits an answer."""
        for descriptor in self.waiting:
            if self.clients[descriptor].may_request(now_s):
                del self.waiting[descriptor]
                return descriptor
        return None
