"""Decides whether a request comes from the page of this server, under an address that is its own.

A page of the internet reaches a robot in two ways through a browser in the robot's network. It sends requests to the
robot's address: those have its own Origin. Or its name begins to mean the robot's address (DNS rebinding): then Host
has that name. So Host must be the address at which the connection arrived, or a name that the operator gave, and
Origin, where there is one, the same.
"""

from collections.abc import Collection
from typing import NamedTuple
from urllib.parse import urlsplit

LOOPBACK = ("127.0.0.1", "localhost", "::1")


class OwnPage(NamedTuple):
    """The names under which a server's page may be opened, besides the address at which a connection arrives."""

    names: frozenset[str]

    def refusal(self, host: str, origin: str | None, arrived_at: str) -> str | None:
        """Return why a request with these headers is refused, or None; `arrived_at` is the connection's own address."""
        name = _host_name(f"//{host}")
        if name is None or not self._is_own(name, arrived_at):
            return (
                f"the page is not served under the name {host!r:.80}: open it by the robot's address,"
                " or start 'mudskipper live' with --name NAME"
            )
        if origin is not None and origin != f"http://{host}":
            return f"only the page of this server may do that, not one of {origin!r:.80}"
        return None

    def _is_own(self, name: str, arrived_at: str) -> bool:
        return name == arrived_at or name in self.names or (arrived_at in LOOPBACK and name in LOOPBACK)


def own_page(host: str, names: Collection[str]) -> OwnPage:
    """Return the check for a server that listens on `host`, which is one of its names."""
    return OwnPage(frozenset(name.lower() for name in (host, *names)))


def _host_name(address: str) -> str | None:
    """Return the name in lower case, without its port; None where it is malformed."""
    try:
        parts = urlsplit(address)
        return parts.hostname if not (parts.path or parts.username or parts.query) else None
    except ValueError:
        return None
