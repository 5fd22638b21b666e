"""Summarises a demo: its strides with their mud, the speed in each mud, and the timing of the loop."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from command_line.demo.demonstration import Demo
from control.modes import Mode
from experiments.reports.mud_names import mud_text
from firmware_host.log_reading.log_reader import Log
from firmware_host.operator.counted_nouns import counted
from simulation.mud.track import Track

LEAD_M = 0.06  # distance of the flippers ahead of the body's middle when a stride begins


def summarise(report: dict[str, Any], demonstration: Demo, log: Log, log_path: Path, plot_path: Path) -> dict[str, Any]:
    track = demonstration.track
    stamps_s, positions_m = walked_path(log)
    strides = []
    for stride in demonstration.strides:
        start_m = float(np.interp(stride["t_start_s"], stamps_s, positions_m)) if len(stamps_s) else 0.0
        strides.append(stride | {"mud": track.clay_at(start_m + LEAD_M).name})
    return {
        **report["loop"],
        "strides": strides,
        "speed_cm_s": speeds_cm_s(stamps_s, positions_m, track),
        "dropped_rows": report["log"]["dropped"],
        "warnings": report["warnings"],
        "log": str(log_path),
        "plot": str(plot_path),
    }


def walked_path(log: Log) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Returns time in s and position in m of the ticks in which the robot walked with a known pose."""
    rows = log.ticks[(log.ticks["mode"] == Mode.WALKING) & np.isfinite(log.ticks["body_x_m"])]
    return rows["stamp_s"], rows["body_x_m"]


def speeds_cm_s(
    stamps_s: np.ndarray[Any, Any], positions_m: np.ndarray[Any, Any], track: Track
) -> dict[str, float | None]:
    """Returns the mean speed from the first arrival in each mud to the first arrival in the next."""
    speeds: dict[str, float | None] = {}
    start_m = float(positions_m[0]) if len(positions_m) else 0.0
    for segment in track.segments:
        inside = np.flatnonzero(positions_m >= start_m)
        beyond = np.flatnonzero(positions_m >= segment.end_m)
        first = int(inside[0]) if len(inside) else -1
        last = int(beyond[0]) if len(beyond) else len(positions_m) - 1
        name = segment.clay.name
        if name in speeds:  # the same mud again
            name = f"{name} at {start_m:.2f} m"
        speeds[name] = None
        if 0 <= first < last:
            distance_m, duration_s = positions_m[last] - positions_m[first], stamps_s[last] - stamps_s[first]
            speeds[name] = round(100.0 * float(distance_m / duration_s), 2)
        start_m = segment.end_m
    return speeds


def summary_text(summary: dict[str, Any]) -> str:
    late, tick = summary["wake_late_us"], summary["tick_us"]
    speeds = ", ".join(
        f"{mud_text(mud)}: {'-' if speed is None else f'{speed:.1f} cm/s'}"
        for mud, speed in summary["speed_cm_s"].items()
    )
    lines = [
        f"strides  {len(summary['strides'])} of both flippers",
        f"speed    {speeds}",
        f"loop     {summary['rate_hz']:.2f} Hz over {summary['ticks']} ticks, {summary['missed_ticks']} missed",
        f"wake-up  {late['p50']:.0f} us late at the median, {late['p99']:.0f} p99, {late['max']:.0f} worst",
        f"tick     {tick['p50']:.0f} us at the median, {tick['p99']:.0f} p99, {tick['max']:.0f} worst",
        *([f"lost     {counted(summary['dropped_rows'], 'row')} of the log"] if summary["dropped_rows"] else []),
        *(f"warning  {warning}" for warning in summary["warnings"]),
        f"log      {summary['log']}",
    ]
    return "\n".join(lines)
