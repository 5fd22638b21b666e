"""The machine and its walk, as cells and texts: alarm, depth, drives, loop, log and lease."""

from math import degrees
from pathlib import PurePath
from typing import Any

from rich.text import Text

from command_line.drive_state import POWER_CUT, is_stale, mode_word, supply_text, torque_state
from command_line.operation.attended_walk import MILD
from command_line.screen import clock_text
from command_line.watch.history import History
from command_line.watch.mud_cells import Row, cm, right
from experiments.reports.counted_nouns import counted
from experiments.reports.text_tables import number

BADGES = {
    **dict.fromkeys(("fault", "damping", "no answer", POWER_CUT), "bold white on red"),
    **dict.fromkeys(("stopping", "arming"), "bold black on yellow"),
    **dict.fromkeys(("walking", "hold"), "bold black on green"),
}
BAD, WARNING, OLD = "bold red", "yellow", "dim italic"
REASONS = {
    "start": "as a walk starts",
    "fixed": "the operator chose it",
    "fastest": "the fastest that comes out of the mud",
    "thrust": "the deepest that comes out: too soft",
    "extraction": "the shallowest: the mud holds flippers",
    "deepest that comes out": "the deepest that comes out of the mud",
    "nothing known of the thrust, depth kept": "kept, the thrust is not known yet",
}
SLIPS = ", slips"
SLIPPING = 0.5  # of a full step: then the stride is one that slips
NEAR_LIMIT = 0.8  # of the current limit
TORQUE_STYLES = {"on": "green", "off": "", "unknown": BAD}


def alarm_text(history: History, now_s: float) -> Text:
    """Return the mode, then what is wrong and what to do about it."""
    report = history.status
    silence_s = history.silence_s(now_s)
    causes = report["causes"]
    if silence_s:
        mode = "no answer"
        since = f"since {clock_text(silence_s)} ({silence_s:.0f} s)"
        text = (f"Nothing heard from the daemon {since}: torque unknown.", BAD)
        advice = [f"-> the values below are old; {history.problem or 'the daemon hangs'}."]
    elif causes:
        mode, cause = mode_word(report), causes[0]
        following = len(cause["consequences"])
        consequence = f" {counted(following, 'fault')} as its consequence." if following else ""
        style = WARNING if cause["reaction"] in MILD else BAD
        text = (f"{history.clock_text(cause['age_s'])} {cause['message']}{consequence}", style)
        more = f" {counted(len(causes) - 1, 'other cause')}: press f." if len(causes) > 1 else ""
        advice = [f"-> {cause['what_to_do']}.{more}"]
    else:
        mode = report["mode"]
        text, advice = _quiet(history)
    badge = (f" {mode.upper()} ", BADGES.get(mode, "reverse"))
    return Text.assemble(badge, " ", text, *((f"\n{each}", WARNING) for each in advice))


def _quiet(history: History) -> tuple[tuple[str, str], list[str]]:
    """Return the first line without a fault, and the notices below it."""
    report = history.status
    unheard = [drive["joint"] for drive in report["drives"] if drive["heartbeat_age_s"] is None]
    if unheard:
        text = f"{report['robot']}: not heard yet: {', '.join(unheard)}; 'mudskipper check' says what to do"
        return (text, WARNING), notices(history)
    return (f"{report['robot']}: no fault", "green"), notices(history)


def notices(history: History) -> list[str]:
    """Return what the operator should know besides the faults, the stop first."""
    report = history.status
    stopped = f"{history.clock_text(report['notice_age_s'])} {report['notice']}" if report["notice"] else ""
    forced = "armed by force: see 'mudskipper check'" if report["forced"] else ""
    return [*filter(None, [stopped, forced, report["pose"]["trouble"], *report["warnings"]])]


def faults_text(history: History) -> Text:
    """Return every fault with its advice in full, each cause before its consequences."""
    report = history.status
    faults = {f"{fault['name']} {fault['subject']}".rstrip(): fault for fault in report["faults"]}
    lines: list[tuple[str, str]] = []
    for cause in report["causes"]:
        style = WARNING if cause["reaction"] in MILD else BAD
        heading = f"{history.clock_text(cause['age_s'])} {cause['name']} ({cause['reaction'].replace('_', ' ')})"
        lines += [(f"{heading}: {cause['message']}\n", style), (f"-> {cause['what_to_do']}\n", WARNING)]
        for name in cause["consequences"]:
            fault = faults[name]
            time_of_day = history.clock_text(fault["age_s"])
            lines.append((f"   {time_of_day} {fault['name']}: {fault['message']}\n   -> {fault['what_to_do']}\n", ""))
        lines.append(("\n", ""))
    if report["faults_left_out"]:
        lines.append((f"{counted(report['faults_left_out'], 'other fault')}\n", ""))
    return Text.assemble(*(lines or [("no fault\n\n", "")]), *(f"{each}\n" for each in notices(history)))


def walk_text(history: History) -> Text:
    """Return depth now and next with its reason, and stride, step, slip, speed and position."""
    report = history.status
    walks = report["mode"] in ("walking", "stopping")
    reason = report["depth_reason"]
    known = reason.removesuffix(SLIPS)
    why = REASONS.get(known, known) + ("; it will slip" if reason.endswith(SLIPS) else "")
    depths = f"{cm(report['depth_m'], 2)} cm now, {cm(report['next_depth_m'], 2)} cm next: " if walks else "-"
    slip, step_m = None, history.step_m
    if step_m is not None and report["full_step_m"] > 0.0:
        slip = max(0.0, 1.0 - step_m / report["full_step_m"])
    stride = f"stride {report['stride']}, {report['phase']}" if walks else "no stride"
    return Text.assemble(
        ("depth   ", "bold"), depths, (why if walks else "", "dim"),
        ("\nwalk    ", "bold"), f"{stride}; step {cm(step_m, 1)} cm, slip ",
        (f"{number(None if slip is None else 100.0 * slip, 0)} %", WARNING if slip and slip > SLIPPING else ""),
        f", speed {cm(history.speed_m_s, 1)} cm/s, at {number(report['body_x_m'], 2)} m",
    )  # fmt: skip


def drive_rows(history: History, silence_s: float) -> list[Row]:
    """Return a row for each drive; `silence_s`: since when the daemon does not answer, 0 while it does."""
    return [_drive(drive, silence_s) for drive in history.status["drives"]]


def _drive(drive: dict[str, Any], silence_s: float) -> Row:
    stale, age_s = silence_s > 0.0 or is_stale(drive), drive["angle_age_s"]
    values = OLD if stale else ""
    current_a, limit_a, measured_c = drive["current_a"], drive["current_limit_a"], drive["temperature_c"]
    near = current_a is not None and abs(current_a) > NEAR_LIMIT * limit_a
    temperature = f"~{number(drive['winding_c'], 0)}" if measured_c is None else f"{measured_c:.0f}"
    angle = number(None if drive["angle_rad"] is None else degrees(drive["angle_rad"]), 1)
    torque = "unknown" if silence_s else torque_state(drive)
    return [
        Text(drive["joint"], "bold"),
        right(f"{angle}°", values),
        right(f"{number(current_a, 2)} / {limit_a:3g} A", values or (WARNING if near else "")),
        right(f"{temperature} °C", values),
        right(_age(None if age_s is None else age_s + silence_s), BAD if stale else "dim"),
        right(torque, TORQUE_STYLES[torque]),
        Text(f"  {drive['errors']}", BAD),
    ]


def _age(age_s: float | None) -> str:
    if age_s is None:
        return "never"
    if age_s >= 100.0:
        return f"{age_s:.0f} s"
    return f"{1e3 * age_s:.0f} ms" if age_s < 1.0 else f"{age_s:.1f} s"


def machine_text(history: History, roomy: bool) -> Text:
    """Return loop, log, lease and supply in one line, or, where there is room, more of them in four."""
    report, apart = history.status, "\n" if roomy else "  "
    loop, late, tick = report["loop"], report["loop"]["wake_late_us"], report["loop"]["tick_us"]
    times = f"late {late['p50']:.0f}, 99 % {late['p99']:.0f} us, tick {tick['p50']:.0f}, 99 % {tick['p99']:.0f} us"
    lease = f"{report['lease']}, {number(report['lease_left_s'], 1)} s more" if report["lease"] else "free"
    return Text.assemble(
        ("loop  " if roomy else "", "bold"),
        f"{loop['rate_hz']:.1f} Hz, {times if roomy else f'''99 % late {late['p99']:.0f} us'''}, ",
        (f"{loop['missed_ticks']} missed", WARNING if loop["missed_ticks"] else ""),
        (f"{apart}log ", "bold"), _log(report["log"], roomy),
        (f"{apart}lease ", "bold"), (lease, WARNING if report["lease"] else "dim"),
        (f"{apart}supply ", "bold"), supply_text(report),
    )  # fmt: skip


def _log(log: dict[str, Any], roomy: bool) -> Text:
    if not log["path"]:
        return Text("off", WARNING)
    if log["problem"] or not log["writer_alive"]:
        return Text(log["problem"] or "its writer has died", BAD)
    free = "ok" if log["free_fraction"] is None else f"{100.0 * log['free_fraction']:.0f} % free"
    name = f" {PurePath(log['path']).name}, " if roomy else ""
    return Text.assemble(name, free, (f", {log['dropped']} rows lost" if log["dropped"] else "", WARNING))
