"""The sockets next to the status socket: one for operators alone, and one that sends the log's rows."""

from pathlib import Path

OPERATORS, ROWS = "-operators", "-rows"


def operators_path(status_socket: Path) -> Path:
    return _next_to(status_socket, OPERATORS)


def rows_path(status_socket: Path) -> Path:
    return _next_to(status_socket, ROWS)


def _next_to(status_socket: Path, added: str) -> Path:
    return status_socket.with_name(f"{status_socket.stem}{added}{status_socket.suffix}")
