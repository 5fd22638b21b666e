"""A walk as a picture, after the paper's figures 7 and 8: forces, coefficients, depth and place against time, muds
shaded.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402 - after the choice of a backend without a screen
import numpy as np  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402

from command_line.screen import mud_text  # noqa: E402
from control.modes import Mode  # noqa: E402
from firmware_host.log_reader import Log  # noqa: E402
from simulation.track import Track  # noqa: E402

MUD_COLOURS = ("#efe3d0", "#d6c3a1", "#b99a6b")
FLIPPER_COLOURS = {"left": "tab:blue", "right": "tab:orange"}
Array = np.ndarray[Any, Any]


def plot_walk(log: Log, track: Track | None, path: Path) -> None:
    """Without a track the muds are not shaded."""
    rows = log.ticks[log.ticks["mode"] == Mode.WALKING]
    start_s = float(rows["stamp_s"][0]) if len(rows) else 0.0
    time_s = rows["stamp_s"] - start_s
    figure, panels = plt.subplots(6, 1, figsize=(11, 12), sharex=True, constrained_layout=True)
    _plot_forces(panels[0], time_s, rows)
    for panel, name in zip(panels[1:4], ("k_p", "k_s", "k_e"), strict=True):
        _plot_coefficient(panel, log.strides, name, start_s)
    _plot_depth(panels[4], time_s, rows, log.strides, start_s)
    panels[5].plot(time_s, rows["body_x_m"], color="black", linewidth=1)
    panels[5].set(ylabel="body (m)", xlabel="time (s)")
    if track is not None:
        _shade_muds(panels, time_s, rows["body_x_m"], track)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _plot_forces(panel: Axes, time_s: Array, rows: Array) -> None:
    panel.plot(time_s, rows["force_x_n"][:, 1], color="tab:purple", linewidth=0.7, label="$f_x$ forward")
    panel.plot(time_s, rows["force_z_n"][:, 1], color="tab:green", linewidth=0.7, label="$f_z$ up")
    panel.set(ylabel="right flipper (N)")
    panel.legend(loc="lower left", ncols=2, fontsize="small")


def _plot_coefficient(panel: Axes, strides: list[dict[str, Any]], name: str, start_s: float) -> None:
    """Full dots are values, triangles lower bounds, hollow dots not valid; bars are two standard errors."""
    for number, flipper in enumerate(("left", "right")):
        for valid, at_least, mark in ((True, False, "o"), (True, True, "^"), (False, False, "o")):
            told = [
                s
                for s in strides
                if s["flipper"] == number
                and (s[f"{name}_valid"], s[f"{name}_at_least"] and valid) == (valid, at_least)
                and s[name] == s[name]
            ]
            panel.errorbar(
                [s["stamp_s"] - start_s for s in told],
                [s[name] / 1e6 for s in told],
                [2.0 * s[f"{name}_std_error"] / 1e6 for s in told],
                fmt=mark,
                markersize=4,
                linewidth=1,
                color=FLIPPER_COLOURS[flipper],
                markerfacecolor=FLIPPER_COLOURS[flipper] if valid else "white",
                label=flipper if mark == "o" and valid else None,
            )
    panel.set(ylabel=f"${name}$ (N/cm³)", ylim=(0, None))
    panel.legend(loc="upper left", ncols=2, fontsize="small")


def _plot_depth(panel: Axes, time_s: Array, rows: Array, strides: list[dict[str, Any]], start_s: float) -> None:
    panel.plot(time_s, 100.0 * rows["depth_m"][:, 1], color="tab:orange", linewidth=0.7, label="right, measured")
    panel.plot(time_s, 100.0 * rows["depth_command_m"], color="black", linewidth=0.7, label="commanded")
    panel.plot(
        [s["stamp_s"] - start_s for s in strides],
        [100.0 * s["chosen_depth_m"] for s in strides],
        "v",
        color="tab:red",
        label="chosen for the next stride",
    )
    panel.axhline(0.0, color="saddlebrown", linewidth=0.8)
    panel.invert_yaxis()
    panel.set(ylabel="depth (cm)")
    panel.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=3, fontsize="small", frameon=False)


def _shade_muds(panels: Any, time_s: Array, places_m: Array, track: Track) -> None:
    """From the first arrival in one mud to that in the next."""
    start_s = 0.0
    for segment, colour in zip(track.segments, MUD_COLOURS * len(track.segments), strict=False):
        beyond = np.flatnonzero(places_m >= segment.end_m)
        end_s = float(time_s[beyond[0]]) if len(beyond) else (float(time_s[-1]) if len(time_s) else 0.0)
        for panel in panels:
            panel.axvspan(start_s, end_s, color=colour, alpha=0.6, linewidth=0)
        name, above = mud_text(segment.clay.name), panels[0].get_xaxis_transform()
        label = f"w = {name}" if name.endswith("%") else name
        panels[0].text((start_s + end_s) / 2, 1.02, label, transform=above, ha="center")
        start_s = end_s
