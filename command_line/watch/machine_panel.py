"""The machine: each drive in one line, the loop, the log and the lease."""

from math import degrees
from pathlib import PurePath
from typing import Any

from command_line.drive_state import is_stale, torque_state
from command_line.watch.history import History
from command_line.watch.lines import Line, Piece
from experiments.reports.text_tables import number

NEAR_LIMIT = 0.8  # of the current limit
TORQUE_STYLES = {"on": "good", "off": "", "unknown": "bad"}
HEAD = f"{'drive':16}{'angle':>9}{'current / limit':>18}{'motor':>8}{'age':>10}  torque"


def drive_lines(history: History, heard: bool) -> list[Line]:
    """Return a head and one line for each drive; `heard`: the daemon answers."""
    return [((HEAD, "dim"),), *(_drive(drive, heard) for drive in history.status["drives"])]


def _drive(drive: dict[str, Any], heard: bool) -> Line:
    stale = is_stale(drive)
    angle = number(None if drive["angle_rad"] is None else degrees(drive["angle_rad"]), 1)
    current_a, limit_a = drive["current_a"], drive["current_limit_a"]
    near = current_a is not None and abs(current_a) > NEAR_LIMIT * limit_a
    values = "old" if stale else ""
    return (
        (f"{drive['joint']:16}", "title"),
        (f"{angle:>8}°", values),
        (f"{number(current_a, 2):>10} / {limit_a:3g} A", values or ("warn" if near else "")),
        (f"{_temperature(drive):>8}", values),
        (f"{_age(drive['angle_age_s']):>10}  ", "bad" if stale else "dim"),
        _torque(drive, heard),
        (f"  {drive['errors']}" if drive["errors"] else "", "bad"),
    )


def _temperature(drive: dict[str, Any]) -> str:
    measured_c = drive["temperature_c"]
    return f"{measured_c:.0f} °C" if measured_c is not None else f"~{number(drive['winding_c'], 0)} °C"


def _age(age_s: float | None) -> str:
    if age_s is None:
        return "never"
    return f"{1e3 * age_s:.0f} ms" if age_s < 1.0 else f"{age_s:.1f} s"


def _torque(drive: dict[str, Any], heard: bool) -> Piece:
    state = torque_state(drive) if heard else "unknown"
    return state, TORQUE_STYLES[state]


def loop_lines(history: History) -> list[Line]:
    """Return loop, log and lease, one line each."""
    report = history.status
    loop, late, tick = report["loop"], report["loop"]["wake_late_us"], report["loop"]["tick_us"]
    missed = loop["missed_ticks"]
    return [
        (
            ("loop    ", "title"),
            (f"{loop['rate_hz']:.1f} Hz, late {late['p50']:.0f}, 99 % {late['p99']:.0f} us", ""),
            (f", tick {tick['p50']:.0f}, 99 % {tick['p99']:.0f} us", ""),
            (f", {missed} missed", "warn" if missed else ""),
        ),
        (("log     ", "title"), *_log(report["log"])),
        (("lease   ", "title"), *_lease(report)),
    ]


def machine_line(history: History) -> Line:
    """Return loop, log and lease in one line."""
    report = history.status
    loop = report["loop"]
    missed = f"{loop['missed_ticks']} missed"
    return (
        (f"{loop['rate_hz']:.1f} Hz, 99 % late {loop['wake_late_us']['p99']:.0f} us, ", ""),
        (missed, "warn" if loop["missed_ticks"] else ""),
        ("  log ", "title"),
        *_log(report["log"], name=False),
        ("  lease ", "title"),
        *_lease(report),
    )


def _log(log: dict[str, Any], name: bool = True) -> tuple[Piece, ...]:
    if not log["path"]:
        return (("off", "warn"),)
    if log["problem"] or not log["writer_alive"]:
        return ((log["problem"] or "its writer has died", "bad"),)
    free = log["free_fraction"]
    texts = [PurePath(log["path"]).name] if name else []
    texts += (
        [f"{100.0 * free:.0f} % of the disk free" if name else f"{100.0 * free:.0f} % free"]
        if free is not None
        else ["ok"]
    )
    dropped = log["dropped"]
    return (", ".join(texts), ""), (f", {dropped} rows lost" if dropped else "", "warn")


def _lease(report: dict[str, Any]) -> tuple[Piece, ...]:
    if not report["lease"]:
        return (("free", "dim"),)
    return ((f"{report['lease']}, {number(report['lease_left_s'], 1)} s more", "warn"),)
