"""Runs `mudskipper watch`: a live screen on a terminal, plain lines elsewhere."""

import os
import sys
from codecs import getincrementaldecoder
from collections.abc import Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from command_line import exit_codes
from command_line.operation.confirmation import send_order
from command_line.screen import complain
from command_line.shared_options import Socket
from command_line.watch.feed import Feed
from command_line.watch.plain_lines import print_lines
from experiments.study.option import Option
from operator_client.status_client import StatusClient

SCREEN_PERIOD_S, LINES_PERIOD_S = 0.1, 1.0


def watch(
    *,
    lines: Annotated[bool, Option("plain lines, as in a pipe, also on a terminal")] = False,
    period: Annotated[
        float | None, Option("seconds between two (default: 0.1; lines: 1)", unit="s", low=0.05, high=3600.0)
    ] = None,
    socket: Socket,
) -> int:
    """Begin only with a daemon that answers; later the screen survives its restart."""
    with StatusClient(socket) as client:
        flippers = list(client.call("status")["loads"])
    if _can_show_screen(lines):
        return _show_screen(socket, flippers, period or SCREEN_PERIOD_S)
    period_s = period or LINES_PERIOD_S
    print_lines(Feed(Path(socket), period_s), period_s)
    return exit_codes.OK


def _show_screen(socket: str | os.PathLike[str], flippers: Sequence[str], period_s: float) -> int:
    from textual.drivers import linux_driver  # textual takes half a second to import

    from command_line.watch.screen_app import WatchApp

    # a byte that is no UTF-8, as of a disturbed serial line, is no key, and does not end the screen
    vars(linux_driver)["getincrementaldecoder"] = lambda name: partial(getincrementaldecoder(name), "replace")
    app = WatchApp(Feed(Path(socket), period_s), flippers, period_s, partial(send_order, socket))
    return app.run(mouse=False) or exit_codes.OK


def _can_show_screen(lines: bool) -> bool:
    terminal = sys.stdin.isatty() and sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb"
    if lines or not terminal:
        return False
    if find_spec("textual") is None:
        complain("the screen needs textual: install mudskipper with its extra 'screen'; until then, plain lines")
        return False
    return True
