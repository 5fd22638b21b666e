"""Tells systemd how the service is: READY=1, WATCHDOG=1, STATUS=…, by one datagram each (man 3 sd_notify).

Without NOTIFY_SOCKET in the environment, as when started by hand, it does nothing.
"""

from __future__ import annotations

import os
import socket


class SystemdNotifier:
    def __init__(self, address: str | None = None) -> None:
        address = address if address is not None else os.environ.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket: socket.socket | None = None
        if self._address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)

    def send(self, *lines: str) -> None:
        """Never waits: a notice that systemd does not take in time is lost, and the watchdog's next one follows."""
        if self._socket is None:
            return
        try:
            self._socket.sendto("\n".join(lines).encode(), self._address)
        except OSError:  # systemd is gone or its queue is full; the loop must not care
            return

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
