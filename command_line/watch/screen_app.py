"""Shows the lines on a terminal with textual, and takes the keys.

One widget draws everything, and only lines that changed are drawn again: ten times a second costs little.
"""

import threading
import time
from collections.abc import Callable
from contextlib import suppress

from rich.segment import Segment
from rich.style import Style
from textual.app import App, ComposeResult
from textual.events import Key
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from command_line import exit_codes
from command_line.watch.feed import Feed
from command_line.watch.lines import STYLES, Line
from command_line.watch.screen_lines import Footer, screen_lines

MESSAGE_S = 15.0  # how long the answer to a key is shown
AT_ONCE = {"space": "stop", "d": "disarm"}
ASKED = {
    "a": ("arm", "Arm the robot? It holds its pose with torque."),
    "w": ("walk", "Let the robot walk until it is stopped?"),
    "c": ("clear", "Clear the faults whose cause is gone?"),
}
ENDING_KEYS = {"q": exit_codes.OK, "ctrl+q": exit_codes.OK, "ctrl+c": exit_codes.INTERRUPTED}
RICH_STYLES = {name: Style.parse(style) for name, style in STYLES.items()}


class Panels(Widget):
    """Owns the lines on the screen."""

    DEFAULT_CSS = "Panels { width: 100%; height: 100%; }"
    lines: list[Line] = []

    def show(self, lines: list[Line]) -> None:
        before, self.lines = self.lines, lines
        if len(before) != len(lines):
            self.refresh()
            return
        changed = [y for y, (old, new) in enumerate(zip(before, lines, strict=True)) if old != new]
        if changed:
            self.refresh(*(Region(0, y, self.size.width, 1) for y in changed))

    def render_line(self, y: int) -> Strip:
        if y >= len(self.lines):
            return Strip.blank(self.size.width)
        return Strip([Segment(text, RICH_STYLES[style]) for text, style in self.lines[y]], self.size.width)


class WatchApp(App[int]):
    """Owns the feed, and what the operator is asked."""

    ENABLE_COMMAND_PALETTE = False
    CSS = "Screen { background: ansi_default; } Panels { background: ansi_default; }"
    BINDINGS = []

    def __init__(self, feed: Feed, period_s: float, send: Callable[[str], str]) -> None:
        super().__init__(ansi_color=True)
        self.feed, self._period_s, self._send = feed, period_s, send
        self.panels = Panels()
        self.footer = Footer()
        self.help_shown = False
        self._asked = ""  # the order that waits for an answer
        self._message_until_s = 0.0

    def compose(self) -> ComposeResult:
        yield self.panels

    def on_mount(self) -> None:
        self.feed.start()
        self.set_interval(self._period_s, self.redraw)
        self.redraw()

    def on_unmount(self) -> None:
        self.feed.stop()

    def on_resize(self) -> None:
        self.redraw()

    def redraw(self) -> None:
        now_s = time.monotonic()
        if now_s > self._message_until_s:
            self.footer.message = ""
        width, height = self.size
        with self.feed.lock:
            lines = screen_lines(self.feed.history, now_s, width, height, self.footer, self.help_shown)
        self.panels.show(lines)

    def on_key(self, event: Key) -> None:
        event.prevent_default()
        event.stop()
        if event.key in ENDING_KEYS:
            self.exit(ENDING_KEYS[event.key])
            return
        asked, self._asked, self.footer.question = self._asked, "", ""
        if event.key in AT_ONCE:
            self.order(AT_ONCE[event.key])
        elif asked:
            if event.key == "y":
                self.order(asked)
        elif event.key in ASKED:
            self._asked, self.footer.question = ASKED[event.key]
        else:
            self.help_shown = event.character == "?" and not self.help_shown
        self.redraw()

    def order(self, method: str) -> None:
        """Send an order in a thread of its own: the screen goes on, and the next order need not wait."""
        self.say(f"{method} ...")
        threading.Thread(target=self._deliver, args=(method,), name=method, daemon=True).start()

    def _deliver(self, method: str) -> None:
        answer = self._send(method)
        with suppress(RuntimeError):  # the operator has left meanwhile
            self.call_from_thread(self.say, answer)

    def say(self, message: str) -> None:
        self.footer.message = message
        self._message_until_s = time.monotonic() + MESSAGE_S
        self.redraw()
