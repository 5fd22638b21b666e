"""`mudskipper live`: passes a running robot's rows on to viewers, in a process of its own.

The daemon has no network. This program subscribes to its rows (operator_client/row_subscription.py) and
serves them to Foxglove and Lichtblick by WebSocket, or as a page for a browser with `--page`. It waits for a daemon
that is not there yet, and for one that restarts.
"""

import errno
import signal
import socket as socket_module  # `socket` is an option
import time
from collections.abc import Sequence
from pathlib import Path
from socket import AF_INET, AF_INET6
from typing import Annotated, NoReturn, Protocol

from command_line import exit_codes
from command_line.errors import CommandError, usage_error
from command_line.screen import complain
from command_line.shared_options import Socket
from experiments.study.option import Option
from firmware_host.configuration.socket_paths import rows_path
from operator_client.live_rows import LiveRow, LiveRows
from operator_client.row_subscription import RowSubscription

READ_S = 0.2


class Audience(Protocol):
    """Takes the rows for its viewers."""

    def begin(self, source: LiveRows) -> None:
        """A daemon answers; called again after each restart."""

    def take(self, rows: Sequence[LiveRow], lost: int) -> None:
        """Rows have come; `lost` counts those that this program did not read in time."""


def live(
    *,
    socket: Socket,
    page: Annotated[bool, Option("serve a page for a browser in place of a viewer's WebSocket")] = False,
    host: Annotated[str, Option("to listen on", metavar="ADDRESS")] = "127.0.0.1",
    name: Annotated[
        tuple[str, ...], Option("with --page: under which browsers open it, such as robot.local", metavar="NAME")
    ] = (),
    port: Annotated[int, Option("0: a free one (default: 8765)", low=0, high=65535)] = 8765,
) -> int:
    if name and not page:
        raise usage_error("--name belongs to --page: viewers open any address")
    _require_address(host, port)
    try:
        audience, address = _open_page(host, port, Path(socket), name) if page else _open_viewers(host, port)
    except ModuleNotFoundError:
        raise CommandError(
            "viewers need foxglove-sdk and rosbags: install mudskipper with its extra 'live', or use --page"
        ) from None
    except OSError as problem:
        raise CommandError(f"{host}:{port}: {problem.strerror or problem}") from None
    print(f"Serving on {address}. Ctrl-C ends.", flush=True)
    try:
        pass_on(RowSubscription(rows_path(Path(socket))), audience)
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second Ctrl-C would interrupt the end of the server's threads
        return exit_codes.OK


def _require_address(host: str, port: int) -> None:
    """Raise CommandError where this computer cannot listen there; the servers' own errors do not say which is wrong."""
    try:
        with socket_module.create_server((host, port), family=AF_INET6 if ":" in host else AF_INET):
            return
    except OSError as problem:
        wrong_host = problem.errno == errno.EADDRNOTAVAIL or (problem.errno or 0) < 0  # EAI_NONAME
        what = f"--host {host}: no address of this computer" if wrong_host else f"{host}:{port}: {problem.strerror}"
        other = (
            "127.0.0.1 is only this computer, 0.0.0.0 all of its networks" if wrong_host else "choose another --port"
        )
        raise CommandError(
            f"{what}; {other}", status=exit_codes.USAGE if wrong_host else exit_codes.UNHEALTHY
        ) from None


def _open_page(host: str, port: int, socket: Path, names: Sequence[str]) -> tuple[Audience, str]:
    from command_line.live.page_server import PageServer

    page = PageServer(host, port, socket, names)
    return page, f"http://{_in_url(host)}:{page.port}/"


def _open_viewers(host: str, port: int) -> tuple[Audience, str]:
    from command_line.live.viewer_server import ViewerServer

    viewers = ViewerServer(host, port)
    url = f"ws://{_in_url(host)}:{viewers.port}"
    return viewers, f"{url}; open it in Foxglove or Lichtblick as a Foxglove WebSocket"


def _in_url(host: str) -> str:
    return f"[{host}]" if ":" in host else host  # an address of IPv6


def pass_on(rows: RowSubscription, audience: Audience) -> NoReturn:
    """Pass rows on for ever. Raises NotPermittedError."""
    served, reported = 0, ""
    while True:
        received = rows.read(READ_S, time.monotonic())
        if rows.problem != reported:
            reported = rows.problem
            complain(*[f"{reported}; waiting for it"] * bool(reported))
        if rows.source is not None:
            if rows.daemons > served:
                served = rows.daemons
                audience.begin(rows.source)
            audience.take(received, rows.source.lost)
