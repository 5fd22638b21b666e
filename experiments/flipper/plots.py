"""The single flipper's trials as pictures, after the paper's figures 4 and 5."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from control.geometry import FlipperGeometry
from control.records import COEFFICIENTS, Phase
from experiments.flipper.modelled_force import modelled_stride
from experiments.reports.mud_names import mud_text
from experiments.reports.mud_styles import (
    LABELS,
    PHASE_NAMES,
    PHASE_SHADES,
    draw_coefficient,
    line_of,
    looks_of,
    name_muds,
)
from experiments.reports.style import FAINT
from experiments.reports.value_text import N_CM3
from experiments.study.notebook import Entry
from experiments.trials.stride_profile import profile_from, stroke_of

Muds = Sequence[Mapping[str, Any]]  # of the summary
THIN: dict[str, Any] = {"linewidth": 1.1}
LEGEND: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.96), "fontsize": "small", "frameon": False}
MODELLED: dict[str, Any] = {"linewidth": 2.0, "linestyle": (0, (3, 1.5))}


def draw_stride(trial: Entry, geometry: FlipperGeometry, method: str) -> Figure:
    """Draw depth, angles and forces of one stride against time, with the forces by the laws: figure 4."""
    stride = modelled_stride(trial, geometry, method)
    by_phase = {phase: stride.where(stride["phase"] == phase) for phase in PHASE_NAMES}
    curves = {
        "depth (cm)": {
            "$z_c$ commanded": 100.0 * stride["depth_command_m"],
            "$z$ actual": 100.0 * stride["depth_m"],
        },
        "joint angle (°)": {
            "sweep $\\alpha$": np.degrees(stride["sweep_rad"]),
            "adduction $\\beta$": np.degrees(stride["adduction_rad"]),
        },
        "$f_z$ up (N)": {
            "$f_z$ measured": stride["force_z_n"].mask(stride["phase"] == Phase.STANCE),
            "by $k_p$": by_phase[Phase.INSERTION]["law_z_n"],
            "by $k_e$": by_phase[Phase.EXTRACTION]["law_z_n"],
        },
        "$f_x$ forward (N)": {"$f_x$ measured": stride["force_x_n"], "by $k_s$": stride["law_x_n"]},
    }
    figure = Figure(figsize=(7.0, 8.2))
    panels = figure.subplots(len(curves), 1, sharex=True)
    for letter, panel, (ylabel, lines) in zip("BCDE", panels, curves.items(), strict=True):  # A is a drawing
        for label, values in lines.items():
            panel.plot(stride["time_s"], values, label=label, **(MODELLED if label.startswith("by") else THIN))
        panel.axhline(0.0, color=FAINT, linewidth=0.6)
        panel.text(0.006, 0.94, letter, transform=panel.transAxes, va="top", fontweight="bold")
        panel.set_ylabel(ylabel)
        panel.margins(x=0.0)
    surface_cm = 100.0 * (trial["strides"][method][0]["surface_m"] or 0.0)
    panels[0].axhline(surface_cm, color=FAINT, linewidth=0.8, linestyle=":", label="surface found")
    panels[0].invert_yaxis()
    for phase, name in PHASE_NAMES.items():
        times_s = by_phase[phase]["time_s"].dropna()
        if len(times_s):
            for panel in panels:
                panel.axvspan(times_s.min(), times_s.max(), color=PHASE_SHADES[phase], linewidth=0.0, zorder=0)
            panels[0].annotate(name, (times_s.mean(), 1.02), xycoords=("data", "axes fraction"), ha="center",
                               va="bottom", fontsize="small")  # fmt: skip
    panels[0].legend(loc="center", fontsize="small", frameon=False)  # between the strokes; their names are above
    for panel in panels[1:]:
        panel.legend(ncols=3, **LEGEND)
    panels[0].set_title(f"mud {mud_text(trial['mud'])}, trial {trial['trial']}\n", fontsize="medium", loc="left")
    panels[-1].set_xlabel("time (s)")
    return figure


# figure 5


def draw_coefficients(muds: Muds, firsts: Mapping[str, Entry]) -> Figure:
    """Draw the forces of one trial in each mud, the coefficients, and their comparison with a load cell: figure 5."""
    rows = 3 if any(mud["truth"] for mud in muds) else 2
    figure = Figure(figsize=(10.0, 3.0 * rows + 0.5))
    panels = figure.subplots(rows, 3)
    looks = looks_of([mud["mud"] for mud in muds])
    _draw_curves(panels[0], firsts, looks)
    for (by_mud, *compared), name in zip(panels[1:].T, COEFFICIENTS, strict=True):
        for x, mud in enumerate(muds):
            draw_coefficient(by_mud, x, mud[name], looks[mud["mud"]])
        name_muds(by_mud, [mud["mud"] for mud in muds], f"{LABELS[name]} (N/cm³)")
        for panel in compared:
            _draw_compared(panel, muds, name, looks)
    for letter, panel in zip("ABCDEFGHI", panels.flat, strict=False):
        panel.set_title(letter, loc="left", fontsize="medium", fontweight="bold")
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 6), fontsize="small")
    return figure


def _draw_curves(panels: Sequence[Axes], firsts: Mapping[str, Entry], looks: Mapping[str, dict[str, Any]]) -> None:
    """Draw f_z against depth in insertion, f_x against sweep in stance, and f_z against depth in extraction."""
    for mud, trial in firsts.items():
        profile = profile_from(trial)
        for panel, (phase, name) in zip(panels, PHASE_NAMES.items(), strict=True):
            stroke = stroke_of(profile, phase)
            x, y = 100.0 * stroke["depth_m"], stroke["force_z_n"]
            panel.set(xlabel="depth $z$ (cm)", ylabel=f"$f_z$ in {name} (N)")
            if phase is Phase.STANCE:
                x, y = np.degrees(stroke["sweep_rad"]), stroke["force_x_n"]
                panel.set(xlabel="sweep $\\alpha$ (°)", ylabel=f"$f_x$ in {name} (N)")
            panel.plot(x, y, label=mud_text(mud), **line_of(looks[mud]))
    for panel in panels:
        panel.axhline(0.0, color=FAINT, linewidth=0.6)
    for panel in panels[1:]:
        panel.invert_xaxis()  # in the direction of the motion


def _draw_compared(panel: Axes, muds: Muds, name: str, looks: Mapping[str, dict[str, Any]]) -> None:
    """Draw against a load cell's values, with the grey line on which both are equal."""
    for mud in muds:
        if truth := (mud["truth"] or {}).get(name):
            draw_coefficient(panel, truth / N_CM3, mud[name], looks[mud["mud"]])
    panel.axline((0.0, 0.0), slope=1.0, color=FAINT, linewidth=1.0, label="equal")
    panel.set(xlabel=f"{LABELS[name]} by load cell (N/cm³)", ylabel="by the flipper (N/cm³)")
    panel.set(xlim=(0.0, None), ylim=(0.0, None))
    panel.legend(fontsize="small", loc="upper left")
