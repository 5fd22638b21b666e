"""The status as one line of text after another, for pipes and for terminals that cannot show the screen."""

import time
from typing import Any

from command_line.watch.feed import Feed
from command_line.watch.history import History
from experiments.reports.counted_nouns import counted
from experiments.reports.text_tables import number
from experiments.reports.value_text import N_CM3, value_text


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
    texts = [report["mode"]]
    if report["mode"] in ("walking", "stopping"):
        texts += [f"stride {report['stride']}", report["phase"], f"depth {100.0 * report['depth_m']:.1f} cm"]
    texts.append(f"body {number(report['body_x_m'])} m")
    texts += [_coefficient(report, name) for name in ("k_p", "k_s", "k_e") if report["mud"][name]]
    return f"{', '.join(texts)}{_alarm(report['causes'])}"


def _coefficient(report: dict[str, Any], name: str) -> str:
    estimate = report["mud"][name]
    bound = "≥ " if estimate["at_least"] else ""
    value = value_text(estimate["value"], estimate["std_error"], per=N_CM3)
    return f"{name} {bound}{value} at {100.0 * estimate['depth_m']:.1f} cm"


def _alarm(causes: list[dict[str, Any]]) -> str:
    if not causes:
        return ""
    following = counted(len(causes[0]["consequences"]), "consequence")
    more = f", {counted(len(causes) - 1, 'other cause')}" if causes[1:] else ""
    return f" | {causes[0]['message']} ({following}{more}) -> {causes[0]['what_to_do']}"
