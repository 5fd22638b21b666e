"""Runs `mudskipper watch`: a live screen on a terminal, plain lines elsewhere."""

import argparse
import os
import sys
from functools import partial
from importlib.util import find_spec

from command_line import exit_codes
from command_line.operation.operation import with_daemon
from command_line.screen import complain
from command_line.watch.feed import Feed
from command_line.watch.orders import send_order
from command_line.watch.plain_lines import print_lines
from operator_client.status_client import StatusClient

SCREEN_PERIOD_S, LINES_PERIOD_S = 0.1, 1.0


def watch(options: argparse.Namespace) -> int:
    """Begins only with a daemon that answers; later it survives its restart."""
    return with_daemon(options, lambda client: _begin(client, options))


def _begin(client: StatusClient, options: argparse.Namespace) -> int:
    client.call("status")
    client.close()
    if _can_show_screen(options.lines):
        from command_line.watch.screen_app import WatchApp  # textual takes half a second to import

        feed = Feed(options.socket, options.period or SCREEN_PERIOD_S)
        app = WatchApp(feed, options.period or SCREEN_PERIOD_S, partial(send_order, options.socket))
        return app.run(mouse=False) or exit_codes.OK
    period_s = options.period or LINES_PERIOD_S
    print_lines(Feed(options.socket, period_s), period_s)
    return exit_codes.OK


def _can_show_screen(lines: bool) -> bool:
    terminal = sys.stdin.isatty() and sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb"
    if lines or not terminal:
        return False
    if find_spec("textual") is None:
        complain("the screen needs textual: install mudskipper with its extra 'screen'; until then, plain lines")
        return False
    return True
