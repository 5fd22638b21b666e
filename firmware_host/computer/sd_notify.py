"""Reports the state of the service to systemd: READY=1, WATCHDOG=1, STATUS=…, in one datagram each (sd_notify(3)).

It does nothing where NOTIFY_SOCKET is not in the environment, as when the daemon is started from a terminal.
"""

import os
import socket
from contextlib import suppress


class SystemdNotifier:
    """Owns the socket to systemd."""

    def __init__(self, address: str | None = None) -> None:
        address = address if address is not None else os.environ.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket: socket.socket | None = None
        if self._address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)

    def send(self, *lines: str) -> None:
        """Send without waiting: a lost notice does no harm, since the watchdog's next one follows."""
        if self._socket is not None:
            with suppress(OSError):  # systemd is gone or its queue is full, which must not stop the loop
                self._socket.sendto("\n".join(lines).encode(), self._address)

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
