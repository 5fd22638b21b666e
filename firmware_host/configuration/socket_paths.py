"""The sockets next to the status socket: one for operators alone, and one that sends the log's rows."""

from pathlib import Path

OPERATORS = "-operators"


def operators_path(status_socket: Path) -> Path:
    return status_socket.with_name(f"{status_socket.stem}{OPERATORS}{status_socket.suffix}")


def rows_path(status_socket: Path) -> Path:
    return status_socket.with_name(f"{status_socket.stem}-rows.sock")
