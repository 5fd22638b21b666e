"""The first lines: the mode, and the alarm with what to do about it."""

import time

from command_line.operation.attended_walk import MILD
from command_line.watch.history import History
from command_line.watch.lines import Line, Piece, length, wrapped
from experiments.reports.counted_nouns import counted

HEIGHT = 3
BADGES = {
    "fault": "alarm",
    "damping": "alarm",
    "stopping": "busy",
    "arming": "busy",
    "walking": "ready",
    "hold": "ready",
}


def header(history: History, now_s: float, width: int) -> list[Line]:
    """Return HEIGHT lines."""
    silence_s = history.silence_s(now_s)
    if silence_s:
        lines = _silence(history, silence_s, width)
    else:
        lines = _alarm(history, width) if history.status["causes"] else _quiet(history, width)
    return [*lines, *((),) * HEIGHT][:HEIGHT]


def _badge(text: str, style: str) -> tuple[Piece, Piece]:
    return (f" {text.upper()} ", style), (" ", "")


def _mode(history: History) -> tuple[Piece, Piece]:
    mode = history.status["mode"]
    return _badge(mode, BADGES.get(mode, "plain"))


def _message(badge: tuple[Piece, ...], texts: list[Piece], width: int) -> list[Line]:
    """Put the first text after the badge, and each further one on a new line; the first may take two lines."""
    (first, style), *others = texts
    lines = wrapped(first, style, width, length(badge))
    lines[0] = (*badge, *lines[0])
    for text, other_style in others:
        lines += wrapped(text, other_style, width, longest=max(1, HEIGHT - len(lines)))
    return lines


def _silence(history: History, silence_s: float, width: int) -> list[Line]:
    since = time.strftime("%H:%M:%S", time.localtime(time.time() - silence_s))
    text = f"Nothing heard from the daemon since {since}, for {silence_s:.0f} s. Torque is unknown."
    advice = f"-> {history.problem or 'the daemon hangs'}. All values below are old."
    return _message(_badge("no answer", "alarm"), [(text, "bad"), (advice, "warn")], width)


def _alarm(history: History, width: int) -> list[Line]:
    causes = history.status["causes"]
    cause = causes[0]
    mild = cause["reaction"] in MILD
    following = len(cause["consequences"])
    text = cause["message"] + (f" {counted(following, 'fault')} as its consequence." if following else "")
    more = f" {counted(len(causes) - 1, 'other cause')}: 'mudskipper status'." if len(causes) > 1 else ""
    advice = f"-> {cause['what_to_do']}.{more}"
    return _message(_mode(history), [(text, "warn" if mild else "bad"), (advice, "warn")], width)


def _quiet(history: History, width: int) -> list[Line]:
    report = history.status
    unheard = [drive["joint"] for drive in report["drives"] if drive["heartbeat_age_s"] is None]
    forced = "armed by force: see 'mudskipper check'" if report["forced"] else ""
    notices = [report["notice"], forced, report["pose"]["trouble"], *report["warnings"]]
    first: Piece = (f"{report['robot']}: no fault", "good")
    if unheard:
        first = (f"{report['robot']}: not heard yet: {', '.join(unheard)}; 'mudskipper check' says what to do", "warn")
    texts = [first]
    return _message(_mode(history), [*texts, *((notice, "warn") for notice in notices if notice)], width)
