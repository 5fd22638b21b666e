"""Viewers of a running robot as processes: the screen on a terminal, `mudskipper live`, and three WebSocket clients."""

import fcntl
import json
import os
import pty
import socket
import struct
import subprocess
import sys
import termios
import threading
import time
from contextlib import suppress
from pathlib import Path

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

CLIENTS = 3
SIZE = struct.pack("HHHH", 24, 80, 0, 0)  # rows and columns of the terminal
SUBPROTOCOL = "foxglove.sdk.v1"
LONGEST_S = 30.0  # until `live` serves
CLOCK_TICKS = os.sysconf("SC_CLK_TCK")


class Viewers:
    """Owns the processes."""

    def __init__(self, status_socket: Path) -> None:
        self._master, terminal = pty.openpty()
        fcntl.ioctl(terminal, termios.TIOCSWINSZ, SIZE)
        command = [sys.executable, "-m", "command_line.main"]
        environment = os.environ | {"TERM": "xterm-256color", "MUDSKIPPER_SOCKET": str(status_socket)}
        self.watch = subprocess.Popen(
            [*command, "watch"], stdin=terminal, stdout=terminal, stderr=terminal, env=environment
        )
        os.close(terminal)
        threading.Thread(target=self._drain, daemon=True).start()
        port, quiet = free_port(), subprocess.DEVNULL
        self._live = subprocess.Popen([*command, "live", "--port", str(port)], env=environment, stdout=quiet)
        self._clients = subprocess.Popen([sys.executable, "-m", __name__, str(port)])

    def _drain(self) -> None:
        with suppress(OSError):  # the screen has ended
            while os.read(self._master, 65536):
                pass

    def end(self) -> None:
        for process in (self._clients, self._live, self.watch):
            process.terminate()
            process.wait()
        os.close(self._master)

    @property
    def all_run(self) -> bool:
        return all(process.poll() is None for process in (self.watch, self._live, self._clients))


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def cpu_s(process: subprocess.Popen[bytes]) -> float:
    """Return the processor time that a process has used."""
    fields = Path(f"/proc/{process.pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / CLOCK_TICKS


def view(port: int) -> None:
    """Subscribes to every channel and reads until the server ends."""
    deadline_s = time.monotonic() + LONGEST_S
    while time.monotonic() < deadline_s:
        try:
            _read_all(port)
            return
        except ConnectionRefusedError:
            time.sleep(0.1)


def _read_all(port: int) -> None:
    with (
        suppress(WebSocketException, ConnectionResetError),
        connect(f"ws://127.0.0.1:{port}", subprotocols=[SUBPROTOCOL]) as viewer,  # type: ignore[list-item]
    ):
        for message in viewer:
            if isinstance(message, str) and (found := json.loads(message))["op"] == "advertise":
                wanted = [{"id": each["id"], "channelId": each["id"]} for each in found["channels"]]
                viewer.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


if __name__ == "__main__":
    threads = [threading.Thread(target=view, args=(int(sys.argv[1]),), daemon=True) for _ in range(CLIENTS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
