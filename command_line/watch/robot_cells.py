"""The machine and its walk, as cells and texts of the screen: alarm, faults, depth, drives, loop, log and lease."""

from rich.text import Text

from command_line.robot_text import (
    BAD,
    GOOD,
    MODE_STYLES,
    WARNING,
    cause_text,
    cm,
    consequences_text,
    drive_cells,
    lease_text,
    log_part,
    machine_lines,
    mode_word,
    notices,
    style_of,
    supply_text,
    unheard_text,
)
from command_line.screen import clock_text
from command_line.watch.history import History
from command_line.watch.mud_cells import Row
from experiments.reports.counted_nouns import counted
from experiments.reports.text_tables import number

REASONS = {
    "start": "as a walk starts",
    "fixed": "the operator chose it",
    "fastest": "the fastest that comes out of the mud",
    "thrust": "the deepest that comes out: too soft",
    "extraction": "the shallowest: the mud holds flippers",
    "deepest that comes out": "the deepest that comes out of the mud",
    "nothing known of the thrust, depth kept": "kept, the thrust is not known yet",
    "nothing known of the thrust, deeper": "deeper, no mud was felt",
}
SLIPS = ", slips"
SLIPPING = 0.5  # of a full step: then the stride is one that slips
DRIVE_COLUMNS = {  # of the columns that `status` has, with their widths
    "joint": 16, "angle (°)": 10, "current (A)": 12, "limit (A)": 10, "motor (°C)": 11, "age": 9, "torque": 9,
    "errors": 40,
}  # fmt: skip


def badge(mode: str) -> tuple[str, str]:
    style = MODE_STYLES.get(mode, "")
    return f" {mode.upper()} ", f"{style} reverse" if style else "reverse"


def alarm_text(history: History, now_s: float) -> Text:
    """Return the mode, then what is wrong and what to do about it."""
    report, silence_s = history.status, history.silence_s(now_s)
    causes, mode = report["causes"], mode_word(report)
    if silence_s:
        mode = "no answer"
        since = f"since {clock_text(silence_s)} ({silence_s:.0f} s)"
        text = (f"Nothing heard from the daemon {since}: torque unknown.", BAD)
        advice = [f"-> the values below are old; {history.problem or 'the daemon hangs'}."]
    elif causes:
        cause, following = causes[0], consequences_text(causes[0])
        said = f"{history.clock_text(cause['age_s'])} {cause['message']}"
        text = (f"{said} {following}." if following else said, style_of(cause))
        more = f" {counted(len(causes) - 1, 'other cause')}: press f." if len(causes) > 1 else ""
        advice = [f"-> {cause['what_to_do']}.{more}"]
    else:
        unheard = unheard_text(report)
        text = (f"{report['robot']}: {unheard or 'no fault'}", WARNING if unheard else GOOD)
        advice = notices(report, history.clock_text)
    return Text.assemble(badge(mode), " ", text, *((f"\n{each}", WARNING) for each in advice))


def faults_text(history: History) -> Text:
    """Return every fault with its advice in full, each cause before its consequences."""
    report = history.status
    faults = {f"{fault['name']} {fault['subject']}".rstrip(): fault for fault in report["faults"]}
    lines: list[tuple[str, str]] = []
    for cause in report["causes"]:
        lines.append((f"{history.clock_text(cause['age_s'])} {cause_text(cause)}\n", style_of(cause)))
        lines.append((f"-> {cause['what_to_do']}\n", WARNING))
        for fault in map(faults.__getitem__, cause["consequences"]):
            said = f"{history.clock_text(fault['age_s'])} {fault['name']}: {fault['message']}"
            lines.append((f"   {said}\n   -> {fault['what_to_do']}\n", ""))
        lines.append(("\n", ""))
    if report["faults_left_out"]:
        lines.append((f"{counted(report['faults_left_out'], 'other fault')}\n", ""))
    said_too = (f"{each}\n" for each in notices(report, history.clock_text))
    return Text.assemble(*(lines or [("no fault\n\n", "")]), *said_too)


def walk_text(history: History) -> Text:
    """Return depth now and next with its reason, and stride, step, slip, speed and position."""
    report = history.status
    walks = report["mode"] in ("walking", "stopping")
    reason = report["depth_reason"]
    known = reason.removesuffix(SLIPS)
    why = REASONS.get(known, known) + ("; it will slip" if reason.endswith(SLIPS) else "")
    depths = f"{cm(report['depth_m'], 2)} cm now, {cm(report['next_depth_m'], 2)} cm next: " if walks else "-"
    slip = _slip(history)
    stride = f"stride {report['stride']}, {report['phase']}" if walks else "no stride"
    return Text.assemble(
        ("depth   ", "bold"), depths, (why if walks else "", "dim"),
        ("\nwalk    ", "bold"), f"{stride}; step {cm(history.step_m)} cm, slip ",
        (f"{number(None if slip is None else 100.0 * slip, 0)} %", WARNING if slip and slip > SLIPPING else ""),
        f", speed {cm(history.speed_m_s)} cm/s, at {number(report['body_x_m'], 2)} m",
    )  # fmt: skip


def _slip(history: History) -> float | None:
    full_step_m = history.status["full_step_m"]
    return max(0.0, 1.0 - history.step_m / full_step_m) if history.step_m is not None and full_step_m > 0.0 else None


def drive_rows(history: History, silence_s: float) -> list[Row]:
    """Return a row for each drive; `silence_s`: since when the daemon does not answer, 0 while it does."""
    rows = (drive_cells(drive, silence_s) for drive in history.status["drives"])
    return [[Text(*cells[head], justify="left" if head == "joint" else "right") for head in DRIVE_COLUMNS]
            for cells in rows]  # fmt: skip


def machine_text(history: History, roomy: bool) -> Text:
    """Return loop, log, lease and supply in one line, or, where there is room, all that `status` prints of them."""
    report = history.status
    if roomy:
        parts = [[(f"{name:7}", "bold"), part] for name, part in machine_lines(report)]
        return Text("\n").join(Text.assemble(*each) for each in parts)
    loop = report["loop"]
    missed = (f"{loop['missed_ticks']} missed", WARNING if loop["missed_ticks"] else "")
    return Text.assemble(
        f"{loop['rate_hz']:.1f} Hz, 99 % late {loop['wake_late_us']['p99']:.0f} us, ", missed,
        ("  log ", "bold"), log_part(report["log"], brief=True),
        ("  lease ", "bold"), (lease_text(report), WARNING if report["lease"] else "dim"),
        ("  supply ", "bold"), supply_text(report),
    )  # fmt: skip
