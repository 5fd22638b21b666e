"""The status as one line of text after another, for pipes and for terminals that cannot show the screen."""

import time

from command_line.robot_text import at_depth, consequences_text, mode_word, position_text, stride_text
from command_line.watch.feed import Feed
from command_line.watch.history import History
from control.records import COEFFICIENTS
from experiments.reports.counted_nouns import counted


def print_lines(feed: Feed, period_s: float) -> None:
    """Print a line every `period_s` until a signal ends the program."""
    due_s = time.monotonic()
    while True:
        feed.poll(time.monotonic())
        print(f"{time.strftime('%H:%M:%S')} {plain_line(feed.history, time.monotonic())}", flush=True)
        now_s = time.monotonic()
        due_s = max(due_s + period_s, now_s)
        time.sleep(due_s - now_s)


def plain_line(history: History, now_s: float) -> str:
    if history.problem:
        return f"nothing heard for {history.silence_s(now_s):.1f} s, torque unknown: {history.problem}"
    report = history.status
    known = [f"{name} {at_depth(report['mud'][name])}" for name in COEFFICIENTS if report["mud"][name]]
    line = ", ".join([mode_word(report), stride_text(report), position_text(report), *known])
    if not report["causes"]:
        return line
    cause, *others = report["causes"]
    notes = [consequences_text(cause), counted(len(others), "other cause") if others else ""]
    rest = ", ".join(filter(None, notes))
    return f"{line} | {cause['message']}{f' ({rest})' if rest else ''} -> {cause['what_to_do']}"
