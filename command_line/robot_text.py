"""The daemon's status as text: for `status`, for the line of a walk that is attended, and for the screen of `watch`.

A part is a text with its style, by rich's name of the style; a plain terminal has fewer. Values of a drive that fell
silent are not those of now, and it may have torque even if it last reported none.
"""

from collections.abc import Callable, Iterable
from math import degrees
from typing import Any, TypeAlias

from command_line.screen import BOLD, GREEN, RED, YELLOW, clock_text, coloured
from experiments.reports.counted_nouns import counted
from experiments.reports.text_tables import number
from experiments.reports.value_text import coefficient_text

Report: TypeAlias = dict[str, Any]
Part: TypeAlias = tuple[str, str]  # a text and its style
BAD, WARNING, GOOD, OLD = "bold red", "yellow", "green", "dim italic"
COLOURS = {BAD: RED, WARNING: YELLOW, GOOD: GREEN, "bold": BOLD}
POWER_CUT = "power cut"
MODE_STYLES = {
    **dict.fromkeys(("fault", "damping", "no answer", POWER_CUT), BAD),
    **dict.fromkeys(("stopping", "arming"), WARNING),
    **dict.fromkeys(("walking", "hold"), GOOD),
}
MILD = ("none", "warn")  # reactions that do not end a walk
TORQUE_STYLES = {"on": GOOD, "off": "", "unknown": BAD}
STALE_S = 0.1  # a drive sends position and current every 2 ms
HEARTBEAT_STALE_S = 0.6  # and a heartbeat every 100 ms; after 0.5 s without it is a fault
NEAR_LIMIT = 0.8  # of the current limit
SIGNAL_AGES = ("angle_age_s", "current_age_s", "heartbeat_age_s")


def plain(parts: Iterable[Part]) -> str:
    """Join parts for a plain terminal, or for a pipe, which has no colours."""
    return "".join(coloured(text, COLOURS[style]) if style in COLOURS else text for text, style in parts)


def cm(value_m: float | None, digits: int = 1) -> str:
    return number(None if value_m is None else 100.0 * value_m, digits)


def mode_word(report: Report) -> str:
    """Return the mode of the robot, or that its motors have no power."""
    return POWER_CUT if report["power_cut"] else str(report["mode"])


def stride_text(report: Report) -> str:
    return "no stride" if report["stride"] < 0 else f"stride {report['stride']}"


def position_text(report: Report) -> str:
    return f"{report['phase']}, depth {cm(report['depth_m'])} cm, body {number(report['body_x_m'])} m"


def at_depth(estimate: Report) -> str:
    """Return a coefficient in N/cm³ with the depth for which it was estimated."""
    text = coefficient_text(estimate["value"], estimate["std_error"], at_least=estimate["at_least"])
    return f"{text} at {cm(estimate['depth_m'])} cm"


# faults and notices


def style_of(cause: Report) -> str:
    return WARNING if cause["reaction"] in MILD else BAD


def cause_text(cause: Report) -> str:
    against = ", prevents arming" if cause["blocks_arming"] else ""
    return f"{cause['name']} ({cause['reaction'].replace('_', ' ')}{against}): {cause['message']}"


def consequences_text(cause: Report) -> str:
    count = len(cause["consequences"])
    return f"{counted(count, 'fault')} as its consequence" if count else ""


def unheard_text(report: Report) -> str:
    """Name the drives that were not heard since the daemon started; empty where all were."""
    drives = [drive["joint"] for drive in report["drives"] if any(drive[age] is None for age in SIGNAL_AGES)]
    return f"not heard yet: {', '.join(drives)}; 'mudskipper check' says what to do" if drives else ""


def notices(report: Report, time_of_day: Callable[[float], str] = clock_text) -> list[str]:
    """Return what the operator should know besides the faults, the stop first."""
    stopped = f"{time_of_day(report['notice_age_s'])} {report['notice']}" if report["notice"] else ""
    forced = "armed by force against a failed check: see 'mudskipper check'" if report["forced"] else ""
    trouble = report["pose"]["trouble"]
    pose = f"{trouble} 'mudskipper check' says what to do" if trouble else ""
    return [*filter(None, [stopped, forced, pose, *report["warnings"]])]


# drives


def is_stale(drive: Report) -> bool:
    age_s = drive["angle_age_s"]
    return age_s is None or age_s > STALE_S


def torque_state(drive: Report) -> str:
    """Return on, off, or unknown."""
    age_s = drive["heartbeat_age_s"]
    if age_s is None or age_s > HEARTBEAT_STALE_S:
        return "unknown"
    return "on" if drive["closed_loop"] else "off"


def drive_cells(drive: Report, silence_s: float = 0.0) -> dict[str, Part]:
    """Return what is known of a drive, by the head of its column; `silence_s`: since when the daemon says nothing."""
    stale, age_s, current_a = silence_s > 0.0 or is_stale(drive), drive["angle_age_s"], drive["current_a"]
    values = OLD if stale else ""
    near = current_a is not None and abs(current_a) > NEAR_LIMIT * drive["current_limit_a"]
    angle_deg = None if drive["angle_rad"] is None else degrees(drive["angle_rad"])
    measured_c = drive["temperature_c"]
    torque = "unknown" if silence_s else torque_state(drive)
    return {
        "joint": (drive["joint"], "bold"),
        "angle (°)": (number(angle_deg, 1), values),
        "current (A)": (number(current_a, 2), values or (WARNING if near else "")),
        "limit (A)": (f"{drive['current_limit_a']:g}", values),
        "torque (N·m)": (number(drive["torque_command_nm"], 3), values),
        "motor (°C)": (f"~{number(drive['winding_c'], 0)}" if measured_c is None else f"{measured_c:.0f}", values),
        "supply (V)": (number(drive["bus_voltage_v"], 1), values),
        "(A)": (number(drive["bus_current_a"], 1), values),
        "age": (_age(None if age_s is None else age_s + silence_s), BAD if stale else "dim"),
        "torque": (torque, TORQUE_STYLES[torque]),
        "errors": (drive["errors"] or "-", BAD if drive["errors"] else ""),
    }


def _age(age_s: float | None) -> str:
    if age_s is None:
        return "never"
    if age_s >= 100.0:
        return f"{age_s:.0f} s"
    return f"{1e3 * age_s:.0f} ms" if age_s < 1.0 else f"{age_s:.1f} s"


def supply_text(report: Report) -> str:
    """Return the lowest voltage of all drives, their currents together, and the lowest voltage of the last stride."""
    drives = [drive for drive in report["drives"] if not is_stale(drive)]
    voltages_v = [drive["bus_voltage_v"] for drive in drives if drive["bus_voltage_v"] is not None]
    currents_a = [drive["bus_current_a"] for drive in drives if drive["bus_current_a"] is not None]
    parts = [f"{min(voltages_v):.1f} V"] if voltages_v else ["voltage unknown"]
    parts += [f"{sum(currents_a):.1f} A"] if currents_a else []
    stride_v = report["stride_supply_min_v"]
    return ", ".join([*parts, f"lowest {stride_v:.1f} V in the last stride"] if stride_v is not None else parts)


# the daemon


def lease_text(report: Report) -> str:
    return f"{report['lease']}, {number(report['lease_left_s'], 1)} s more" if report["lease"] else "free"


def log_part(log: Report, brief: bool = False) -> Part:
    """Return where the log goes and how it fares, or why it goes nowhere; `brief`: only what is not as usual."""
    if not log["path"]:
        return "off", WARNING
    if log["problem"] or not log["writer_alive"]:
        return log["problem"] or "its writer has died", BAD
    free = log["free_fraction"]
    facts = {
        log["path"]: not brief,
        f"{counted(log['dropped'], 'row')} dropped": log["dropped"] or not brief,
        f"{number(100.0 * (free or 0.0), 0)} % free": free is not None,
        f"safe up to {number(log.get('durable_age_s'), 1)} s ago": log.get("durable_age_s") and not brief,
        f"repairing {counted(log.get('repairing', 0), 'earlier log')}": log.get("repairing"),
    }
    return ", ".join(text for text, said in facts.items() if said) or "ok", WARNING if log["dropped"] else ""


def quota_text(quota_bytes: int, min_free_fraction: float) -> str:
    """Return which logs the robot deletes, and when."""
    limits = [f"more than {quota_bytes / 1e9:g} GB of logs"] * (quota_bytes > 0)
    limits += [f"less than {100.0 * min_free_fraction:g} % of the disk free"] * (min_free_fraction > 0.0)
    rule = "the oldest copied log is deleted, uncopied ones last"
    return f"at {' or '.join(limits)} {rule}" if limits else "no log is deleted"


def machine_lines(report: Report) -> list[tuple[str, Part]]:
    """Return the state of loop, buses, supply, pose, log and lease, each with its name."""
    loop, bus, pose = report["loop"], report["bus"], report["pose"]
    late, tick = loop["wake_late_us"], loop["tick_us"]
    frames = [
        f"{bus[name]} {name.replace('_', ' ')}"
        for name in ("unknown_frames", "malformed_frames", "error_frames", "failed_sends", "lost_frames",
                     "refused_commands")
        if bus[name] or name not in ("lost_frames", "refused_commands")
    ]  # fmt: skip
    poses = f"{pose['source']}: {pose['poses']} poses, {pose['malformed']} malformed, {pose['lost']} without the body"
    missed = WARNING if loop["missed_ticks"] else ""
    return [
        ("loop", (f"{loop['rate_hz']:.2f} Hz, {loop['ticks']} ticks, {loop['missed_ticks']} missed", missed)),
        ("late", (f"{late['p50']:.0f} us median, {late['p99']:.0f} p99, {late['max']:.0f} worst", "")),
        (
            "tick",
            (
                f"{tick['p50']:.0f} us median, {tick['p99']:.0f} p99, {tick['max']:.0f} worst,"
                f" {'compiled' if report.get('compiled') else 'interpreted'}",
                "",
            ),
        ),
        ("bus", (", ".join(frames), "")),
        ("supply", (supply_text(report), "")),
        ("pose", (poses if pose["source"] else "none", "")),
        ("log", log_part(report["log"])),
        ("lease", (lease_text(report), WARNING if report["lease"] else "dim")),
    ]
