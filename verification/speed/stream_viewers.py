"""Viewers of a running robot as processes: the screen on a terminal, `mudskipper live`, and three WebSocket clients."""

import json
import os
import pty
import subprocess
import sys
import termios
import threading
from contextlib import suppress
from pathlib import Path

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

CLIENTS = 3
SIZE = (24, 80)  # rows and columns of the terminal
SUBPROTOCOL = "foxglove.sdk.v1"
CLOCK_TICKS = os.sysconf("SC_CLK_TCK")


def start_stream_viewers(status_socket: Path) -> list[subprocess.Popen[bytes]]:
    """Start the processes, the screen first."""
    master, terminal = pty.openpty()
    termios.tcsetwinsize(terminal, SIZE)
    command = [sys.executable, "-m", "command_line.main"]
    environment = os.environ | {"TERM": "xterm-256color", "MUDSKIPPER_SOCKET": str(status_socket)}
    watch = subprocess.Popen([*command, "watch"], stdin=terminal, stdout=terminal, stderr=terminal, env=environment)
    os.close(terminal)
    threading.Thread(target=_drain, args=(master,), daemon=True).start()
    live = subprocess.Popen([*command, "live", "--port", "0"], env=environment, stdout=subprocess.PIPE)
    assert live.stdout is not None
    address = live.stdout.readline().decode().split()[2].rstrip(";")
    return [watch, live, subprocess.Popen([sys.executable, "-m", __name__, address])]


def _drain(terminal: int) -> None:
    """Read what a screen draws until it ends."""
    with suppress(OSError):
        while os.read(terminal, 65536):
            pass
    os.close(terminal)


def cpu_s(process: subprocess.Popen[bytes]) -> float:
    """Return the processor time that a process has used."""
    fields = Path(f"/proc/{process.pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / CLOCK_TICKS


def view(address: str) -> None:
    """Subscribe to every channel, and read until the server ends."""
    with (
        suppress(WebSocketException, ConnectionResetError),
        connect(address, subprotocols=[SUBPROTOCOL]) as viewer,  # type: ignore[list-item]
    ):
        for message in viewer:
            if isinstance(message, str) and (found := json.loads(message))["op"] == "advertise":
                wanted = [{"id": each["id"], "channelId": each["id"]} for each in found["channels"]]
                viewer.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


if __name__ == "__main__":
    threads = [threading.Thread(target=view, args=(sys.argv[1],)) for _ in range(CLIENTS)]
    for thread in threads:
        thread.start()
