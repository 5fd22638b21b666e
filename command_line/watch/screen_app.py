"""The screen of `mudskipper watch`, of textual's tables and sparklines, with the keys that operate the robot.

Space and d act at once, whatever else is open; the other orders ask first. Each order is sent in a thread of its own.
"""

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from rich.text import Text
from textual.app import App, ComposeResult, ScreenStackError
from textual.binding import Binding
from textual.containers import Vertical, VerticalScroll
from textual.css.query import NoMatches
from textual.events import Key
from textual.widgets import ContentSwitcher, DataTable, Footer, RichLog, Static

from command_line import exit_codes
from command_line.operation.confirmation import TORQUE_UNKNOWN
from command_line.watch.feed import Feed
from command_line.watch.history import History
from command_line.watch.joint_plots import SIGNALS, View
from command_line.watch.mud_cells import coefficient_rows, force_text, stride_rows, strip_text
from command_line.watch.robot_cells import (
    DRIVE_COLUMNS,
    alarm_text,
    badge,
    drive_rows,
    faults_text,
    machine_text,
    walk_text,
)
from control.records import COEFFICIENTS

ALARM_S = 15.0
ROOMY_ROWS = 42  # from here on the panels are apart
QUESTIONS = {
    "arm": "Arm the robot? It holds its pose with torque.",
    "walk": "Let the robot walk until it is stopped?",
    "clear": "Clear the faults whose cause is gone?",
}
NOTES = ("good", "slipped", "stuck", "stone", "touched by hand", "re-mixed", "look here")  # by digit
NOTE_OF_KEY = {str(digit): note for digit, note in enumerate(NOTES, 1)}
NOTE_QUESTION = ", ".join(f"{digit} {note}" for digit, note in NOTE_OF_KEY.items())
HELP = """
space   stop: end the walk, raise the flippers, hold the pose
d       disarm: switch torque off at once; the joints sink
a       arm: switch torque on; the robot holds its pose
w       walk with a depth that adapts to the mud, until a stop
c       clear faults whose cause is gone
m       mark this moment in the log, such as a clap on a film
n       write a note into the log, one of a few by its digit;
        'mudskipper note' takes any text
f       every fault with its advice in full; up and down scroll
j       plots of the joints' angles, then currents, then torques:
        left and right scroll by half a screen, up and down zoom,
        home and end go to the oldest and to now
?       this help
q       leave; the robot goes on with what it does

Space and d act at once; the others ask first.
No key is an emergency stop: that is the switch of the motors' power.

≥ marks a lower bound: the mud did not yield.
↗ ↘ →  the last stride against the one before, beyond their errors
▁▄█    forces of the last seconds; k of the last strides;
       mud along the path on a logarithmic scale, ▲ is the robot
Values in italics are old. Torque is unknown where a drive is silent."""
STRIDE_COLUMNS = (
    ("no", 3), ("flipper", 8), *((name, 17) for name in COEFFICIENTS), ("depth", 6), ("next", 6), ("step", 6),
)  # fmt: skip


class Rows(DataTable[Any]):
    """A table without a cursor that draws only the cells that changed."""

    def __init__(self, columns: Sequence[tuple[str, int]], name: str) -> None:
        """Make a table of columns with their heads and widths."""
        super().__init__(cursor_type="none", cell_padding=0, id=name)
        self.can_focus = False
        for head, width in columns:
            self.add_column(Text(head, justify="left" if head == "joint" else "right"), width=width)

    def show(self, rows: Sequence[Sequence[Any]]) -> None:
        if len(rows) != self.row_count:
            self.clear()
            self.add_rows(rows)
            self.call_after_refresh(self.refresh, layout=True)  # a busy screen measures the table before its rows
            return
        for y, row in enumerate(rows):
            for x, cell in enumerate(row):
                if self.get_cell_at((y, x)) != cell:  # type: ignore[arg-type]
                    self.update_cell_at((y, x), cell)  # type: ignore[arg-type]


class WatchApp(App[int]):
    """Owns the feed, and what the operator is asked."""

    ENABLE_COMMAND_PALETTE = False
    CSS = """
    * { background: ansi_default; }
    #alarm { height: auto; max-height: 3; }
    ContentSwitcher { height: 1fr; }
    #help, #joints { height: 1fr; }
    #fault_list { height: auto; }
    #forces, #walk, #strip, #machine { height: auto; }
    .old { text-style: dim italic; }
    Rows { height: auto; scrollbar-size: 0 0; overflow: hidden; }
    Rows > .datatable--header { text-style: dim; background: ansi_default; }
    #strides { height: 1fr; min-height: 3; }
    #messages, #question { height: 1; scrollbar-size: 0 0; }
    .roomy #messages { height: 4; }
    .roomy #body > * { margin-bottom: 1; }
    """
    BINDINGS = [
        Binding("space", "order('stop')", "stop", priority=True),
        Binding("d", "order('disarm')", "disarm", priority=True),
        Binding("a", "ask('arm')", "arm"),
        Binding("w", "ask('walk')", "walk"),
        Binding("c", "ask('clear')", "clear"),
        Binding("m", "order('mark')", "mark"),
        Binding("n", "ask('note')", "note"),
        Binding("f", "show('faults')", "faults"),
        Binding("j", "plot", "joints"),
        Binding("y", "confirm", show=False),
        Binding("left", "scroll(-0.5)", show=False),
        Binding("right", "scroll(0.5)", show=False),
        Binding("home", "scroll(-1e9)", show=False),
        Binding("end", "scroll(1e9)", show=False),
        Binding("up", "zoom(0.5)", show=False),
        Binding("down", "zoom(2.0)", show=False),
        Binding("question_mark", "show('help')", "help"),
        Binding("q", f"exit({exit_codes.OK})", "leave"),
        Binding("ctrl+q", f"exit({exit_codes.OK})", show=False, priority=True),
        Binding("ctrl+c", f"exit({exit_codes.INTERRUPTED})", show=False, priority=True),
    ]

    def __init__(self, feed: Feed, flippers: Sequence[str], period_s: float, send: Callable[..., str]) -> None:
        super().__init__(ansi_color=True)
        self.feed, self._flippers, self._period_s, self._send = feed, flippers, period_s, send
        self._asked = ""  # the order that waits for an answer
        self._view = View(period_s)

    def compose(self) -> ComposeResult:
        yield Static(id="alarm")
        with ContentSwitcher(initial="body"):
            yield Static(HELP, id="help")
            yield VerticalScroll(Static(id="fault_list"), id="faults")
            yield Static(id="joints")
            yield from self._body()
        yield Static(id="question")
        yield RichLog(id="messages", min_width=0, max_lines=100)
        yield Footer(compact=True)

    def _body(self) -> ComposeResult:
        with Vertical(id="body"):
            yield Static(id="walk")
            columns = [((f"{flipper} (N/cm³)", 26), ("", 3), ("", 9)) for flipper in self._flippers]
            yield Rows([("", 4), *(column for each in columns for column in each)], "mud")
            yield Static(id="forces")
            yield Static(id="strip")
            yield Rows(STRIDE_COLUMNS, "strides")
            yield Rows(list(DRIVE_COLUMNS.items()), "drives")
            yield Static(id="machine")

    def on_mount(self) -> None:
        self.query_one("#messages").can_focus = False
        self.query_one("#question").display = False
        self.feed.start()
        self.set_interval(self._period_s, self.redraw)

    def on_unmount(self) -> None:
        self.feed.stop()

    def redraw(self) -> None:
        """Show the newest history."""
        history, now_s = self.feed.history, time.monotonic()
        with self.feed.lock, suppress(NoMatches, ScreenStackError):  # a closing screen loses its widgets, then itself
            if history.status:
                self._show(history, now_s)

    def _show(self, history: History, now_s: float) -> None:
        silence_s, roomy = history.silence_s(now_s), self.size.height >= ROOMY_ROWS
        self.screen.set_class(roomy, "roomy")
        self.query_one("#body").set_class(silence_s > 0.0, "old")
        self.query_one("#alarm", Static).update(alarm_text(history, now_s))
        self.query_one("#walk", Static).update(walk_text(history))
        self.query_one("#mud", Rows).show(coefficient_rows(history, self._flippers))
        self.query_one("#forces", Static).update(force_text(history, self.size.width))
        self.query_one("#strip", Static).update(
            strip_text(history, self.size.width, COEFFICIENTS if roomy else ("k_s",))
        )
        self.query_one("#strides", Rows).show(stride_rows(history))
        self.query_one("#drives", Rows).show(drive_rows(history, silence_s))
        self.query_one("#machine", Static).update(machine_text(history, roomy))
        self.query_one("#fault_list", Static).update(faults_text(history))
        plots = self.query_one("#joints", Static)
        if plots.display:
            plots.update(self._view.text(history, plots.size.width, plots.size.height))

    def on_key(self, event: Key) -> None:
        """Take a digit as a note, and any key but y as a no to a question; the actions of keys follow this."""
        if self._asked == "note" and event.key in NOTE_OF_KEY:
            self.action_order("note", text=NOTE_OF_KEY[event.key])
        elif event.key != "y":
            self._ask("")

    def action_ask(self, method: str) -> None:
        self._ask(method)

    def _ask(self, method: str) -> None:
        """Show the question of an order in place of the messages, or the messages again."""
        self._asked = method
        question, messages = self.query_one("#question", Static), self.query_one("#messages")
        question.display, messages.display = bool(method), not method
        text = f"{QUESTIONS[method]} y: yes, any other key: no" if method in QUESTIONS else NOTE_QUESTION
        question.update(Text(text, badge("arming")[1]))

    def action_confirm(self) -> None:
        if self._asked in QUESTIONS:
            self.action_order(self._asked)

    def action_show(self, panel: str) -> None:
        """Show a panel in place of the body, or the body again."""
        self._ask("")
        switcher = self.query_one(ContentSwitcher)
        switcher.current = "body" if switcher.current == panel else panel
        self.query_one("#faults").focus() if switcher.current == "faults" else self.set_focus(None)
        self.redraw()

    def action_plot(self) -> None:
        """Show the first signal of the joints, then the others, then the body again."""
        shown = self.query_one(ContentSwitcher).current == "joints"
        self._view.signal = (self._view.signal + shown) % len(SIGNALS)
        if not shown or self._view.signal == 0:
            self.action_show("joints")
        self.redraw()

    def action_scroll(self, screens: float) -> None:
        with self.feed.lock:
            if self.feed.history.samples:
                self._view.scroll(screens, self.feed.history, self.size.width)
        self.redraw()

    def action_zoom(self, factor: float) -> None:
        self._view.zoom(factor)
        self.redraw()

    def action_exit(self, status: int) -> None:
        self.exit(status)

    def action_order(self, method: str, **params: str) -> None:
        """Send an order in a thread of its own: the screen goes on, and the next order need not wait."""
        self._ask("")
        self.say(f"{method} ...")
        threading.Thread(target=self._deliver, args=(method,), kwargs=params, name=method, daemon=True).start()

    def _deliver(self, method: str, **params: str) -> None:
        answer = self._send(method, **params)
        with suppress(RuntimeError, NoMatches):  # the operator has left meanwhile
            self.call_from_thread(self.say, answer)

    def say(self, message: str) -> None:
        """Write a message to the log; one that asks the operator to act also stays above the screen for a while."""
        is_alarm = message.startswith(TORQUE_UNKNOWN)
        if is_alarm:
            self.notify(message, severity="error", timeout=ALARM_S)
        style = badge("fault")[1] if is_alarm else ""
        line = Text.assemble((f"{time.strftime('%H:%M:%S')} ", "dim"), (message, style))
        self.query_one(RichLog).write(line, shrink=False)  # a log that a question hides is 0 columns wide
