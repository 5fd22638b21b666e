"""`mudskipper live`: passes a running robot's rows on to viewers, in a process of its own.

The daemon has no network. This program subscribes to its rows (operator_client/row_subscription.py) and
serves them to Foxglove and Lichtblick by WebSocket, or as a page for a browser with `--page`. It waits for a daemon
that is not there yet, and for one that restarts.
"""

import argparse
import signal
import time
from collections.abc import Sequence
from typing import NoReturn, Protocol

from command_line import exit_codes
from command_line.screen import complain
from firmware_host.log.row_stream import stream_path
from operator_client.live_rows import LiveRow, LiveRows
from operator_client.row_subscription import RowSubscription
from operator_client.status_client import NotPermittedError

READ_S = 0.2


class Audience(Protocol):
    """Takes the rows for its viewers."""

    def begin(self, source: LiveRows) -> None:
        """A daemon answers; called again after each restart."""

    def take(self, rows: Sequence[LiveRow], lost: int) -> None:
        """Rows have come; `lost` counts those that this program did not read in time."""


def live(options: argparse.Namespace) -> int:
    try:
        audience, address = (_open_page if options.page else _open_viewers)(options)
    except ModuleNotFoundError:
        complain("viewers need foxglove-sdk: install mudskipper with its extra 'live', or use --page")
        return exit_codes.UNHEALTHY
    except OSError as problem:
        complain(f"{options.host}:{options.port}: {problem.strerror or problem}; choose another --port")
        return exit_codes.UNHEALTHY
    print(f"Serving on {address}. Ctrl-C ends.", flush=True)
    try:
        pass_on(RowSubscription(stream_path(options.socket)), audience)
    except NotPermittedError as problem:
        complain(str(problem))
        return exit_codes.NOT_PERMITTED
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second Ctrl-C would interrupt the end of the server's threads
        return exit_codes.OK


def _open_page(options: argparse.Namespace) -> tuple[Audience, str]:
    from command_line.live.page_server import PageServer

    page = PageServer(options.host, options.port, options.socket)
    return page, f"http://{options.host}:{page.port}/"


def _open_viewers(options: argparse.Namespace) -> tuple[Audience, str]:
    from command_line.live.viewer_server import ViewerServer

    viewers = ViewerServer(options.host, options.port)
    return viewers, f"ws://{options.host}:{viewers.port}; open it in Foxglove or Lichtblick as a Foxglove WebSocket"


def pass_on(rows: RowSubscription, audience: Audience) -> NoReturn:
    """Passes rows on for ever. Raises NotPermittedError."""
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
