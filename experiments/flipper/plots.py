"""The single flipper's trials as pictures, after the paper's figures 4 and 5."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from control.geometry import FlipperGeometry
from control.records import Phase
from experiments.flipper.modelled_force import ModelledForces, drawn_coefficients, modelled_forces
from experiments.reports.coefficient_table import PER_CM3
from experiments.reports.error_table import COEFFICIENTS
from experiments.reports.mud_names import mud_text
from experiments.reports.mud_styles import (
    GREY,
    INK,
    LABELS,
    PHASE_NAMES,
    PHASE_SHADES,
    line_of,
    looks_of,
    mark_of,
    waters_of,
)
from experiments.study.notebook import Entry
from experiments.trials.stride_profile import Floats, StrideProfile, profile_from_row

Muds = Sequence[Mapping[str, Any]]  # of the summary
THIN: dict[str, Any] = {"linewidth": 1.1}
MODELLED: dict[str, Any] = {"linewidth": 2.0, "linestyle": (0, (3, 1.5))}


def draw_stride(trial: Entry, geometry: FlipperGeometry, method: str) -> Figure:
    """Draw depth, angles and forces of one stride against time, with the forces by the laws: figure 4."""
    profile, stride = profile_from_row(trial["course"]), trial["strides"][method][0]
    laws = modelled_forces(profile, geometry, stride["surface_m"] or 0.0, drawn_coefficients(stride), method)
    figure = Figure(figsize=(7.0, 8.2))
    panels = figure.subplots(4, 1, sharex=True)
    _draw_depths(panels[0], profile, stride["surface_m"] or 0.0)
    _draw_angles(panels[1], profile)
    _draw_upward(panels[2], profile, laws)
    _draw_forward(panels[3], profile, laws)
    for letter, panel in zip("BCDE", panels, strict=True):  # the paper's A is a drawing
        panel.text(0.006, 0.94, letter, transform=panel.transAxes, va="top", fontweight="bold")
        _shade(panel, profile)
        panel.margins(x=0.0)
    for phase, name in PHASE_NAMES.items():
        times_s = profile.time_s[profile.during(phase)]
        if len(times_s):
            panels[0].annotate(name, (float(times_s.mean()), 1.02), xycoords=("data", "axes fraction"), ha="center",
                               va="bottom", fontsize="small")  # fmt: skip
    panels[0].set_title(f"mud {mud_text(trial['mud'])}, trial {trial['trial']}\n", fontsize="medium", loc="left")
    panels[-1].set_xlabel("time (s)")
    return figure


def _shade(panel: Axes, profile: StrideProfile) -> None:
    for phase, colour in PHASE_SHADES.items():
        times_s = profile.time_s[profile.during(phase)]
        if len(times_s):
            panel.axvspan(float(times_s[0]), float(times_s[-1]), color=colour, linewidth=0.0, zorder=0)


def _draw_depths(panel: Axes, profile: StrideProfile, surface_m: float) -> None:
    panel.plot(profile.time_s, 100.0 * profile.depth_command_m, "--", color=GREY, label="$z_c$ commanded", **THIN)
    panel.plot(profile.time_s, 100.0 * profile.depth_m, color=INK, label="$z$ actual", **THIN)
    panel.axhline(100.0 * surface_m, color=GREY, linewidth=0.8, linestyle=":", label="surface found")
    panel.invert_yaxis()
    panel.set_ylabel("depth (cm)")
    panel.legend(fontsize="small", loc="center", bbox_to_anchor=(0.82, 0.62))


def _draw_angles(panel: Axes, profile: StrideProfile) -> None:
    panel.plot(profile.time_s, np.degrees(profile.sweep_rad), color="tab:blue", label="sweep $\\alpha$", **THIN)
    panel.plot(
        profile.time_s, np.degrees(profile.adduction_rad), "--", color="tab:red", label="adduction $\\beta$", **THIN
    )
    panel.set_ylabel("joint angle (°)")
    panel.legend(fontsize="small", loc="center left", bbox_to_anchor=(0.06, 0.5))


def _draw_upward(panel: Axes, profile: StrideProfile, laws: ModelledForces) -> None:
    measured_n = np.where(profile.during(Phase.STANCE), np.nan, profile.force_z_n)
    panel.plot(profile.time_s, measured_n, color="tab:green", label="$f_z$ measured", **THIN)
    for phase, colour, label in (
        (Phase.INSERTION, "tab:red", "by $k_p$"),
        (Phase.EXTRACTION, "navy", "by $k_e$"),
    ):
        modelled_n = np.where(profile.during(phase), laws.force_z_n, np.nan)
        panel.plot(profile.time_s, modelled_n, color=colour, label=label, **MODELLED)
    panel.axhline(0.0, color=GREY, linewidth=0.6)
    panel.set_ylabel("$f_z$ up (N)")
    panel.legend(fontsize="small", ncols=3, loc="upper right")


def _draw_forward(panel: Axes, profile: StrideProfile, laws: ModelledForces) -> None:
    panel.plot(profile.time_s, profile.force_x_n, color="tab:blue", label="$f_x$ measured", **THIN)
    panel.plot(profile.time_s, laws.force_x_n, color="tab:red", label="by $k_s$", **MODELLED)
    panel.axhline(0.0, color=GREY, linewidth=0.6)
    panel.set_ylabel("$f_x$ forward (N)")
    panel.legend(fontsize="small", ncols=2, loc="upper right")


# figure 5


def draw_coefficients(muds: Muds, firsts: Mapping[str, Entry], geometry: FlipperGeometry) -> Figure:
    """Draw the forces of one trial in each mud, the coefficients, and their comparison with a load cell: figure 5."""
    compared = any(mud["truth"] for mud in muds)
    rows = 3 if compared else 2
    figure = Figure(figsize=(11.0, 3.3 * rows + 0.5))
    panels = figure.subplots(rows, 3)
    looks = looks_of([mud["mud"] for mud in muds])
    _draw_curves(panels[0], firsts, looks)
    for column, name in enumerate(COEFFICIENTS):
        _draw_by_mud(panels[1][column], muds, name, looks)
        if compared:
            _draw_compared(panels[2][column], muds, name, looks)
    for letter, panel in zip("ABCDEFGHI", panels.flat, strict=False):
        panel.set_title(letter, loc="left", fontsize="medium", fontweight="bold")
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 6), fontsize="small")
    return figure


Curve = Callable[[StrideProfile], tuple[Floats, Floats]]


def _draw_curves(panels: Sequence[Axes], firsts: Mapping[str, Entry], looks: Mapping[str, dict[str, Any]]) -> None:
    """Draw f_z against depth in insertion, f_x against sweep in stance, and f_z against depth in extraction."""
    wanted: tuple[tuple[Phase, Curve, str, str], ...] = (
        (Phase.INSERTION, lambda c: (100.0 * c.depth_m, c.force_z_n), "depth $z$ (cm)", "$f_z$ in insertion (N)"),
        (Phase.STANCE, lambda c: (np.degrees(c.sweep_rad), c.force_x_n), "sweep $\\alpha$ (°)", "$f_x$ in stance (N)"),
        (Phase.EXTRACTION, lambda c: (100.0 * c.depth_m, c.force_z_n), "depth $z$ (cm)", "$f_z$ in extraction (N)"),
    )
    for panel, (phase, curve, across, up) in zip(panels, wanted, strict=True):
        for mud, trial in firsts.items():
            profile = profile_from_row(trial["course"])
            x, y = (column[profile.during(phase)] for column in curve(profile))
            panel.plot(x, y, label=mud_text(mud), **line_of(looks[mud]))
        panel.axhline(0.0, color=GREY, linewidth=0.6)
        panel.set_xlabel(across)
        panel.set_ylabel(up)
        if phase is not Phase.INSERTION:
            panel.invert_xaxis()  # in the direction of the motion


def _draw_by_mud(panel: Axes, muds: Muds, name: str, looks: Mapping[str, dict[str, Any]]) -> None:
    """Draw mean and standard deviation over the trials; a lower bound has an arrow up."""
    names = [mud["mud"] for mud in muds]
    waters = waters_of(names)
    for x, mud in zip(waters or range(len(names)), muds, strict=True):
        gathered, look = mud[name], looks[mud["mud"]]
        if gathered.value is None:
            continue
        value, sd = PER_CM3 * gathered.value, PER_CM3 * gathered.value * (gathered.repeatability or 0.0)
        trials = [PER_CM3 * trial for trial in gathered.trials]
        panel.plot([x] * len(trials), trials, "_", color=GREY, markersize=12)
        panel.errorbar(x, value, sd or None, capsize=4, ecolor=INK, linestyle="", lolims=gathered.at_least,
                       **mark_of(look))  # fmt: skip
    panel.set_ylim(bottom=0.0)
    panel.set_ylabel(f"{LABELS[name]} (N/cm³)")
    panel.set_xlabel("water content $w$ (%)" if waters else "mud")
    if not waters:
        panel.set_xticks(range(len(names)), names)


def _draw_compared(panel: Axes, muds: Muds, name: str, looks: Mapping[str, dict[str, Any]]) -> None:
    """Draw against a load cell's values, with two standard errors, and the grey line on which both are equal."""
    largest = 0.0
    for mud in muds:
        gathered, truth = mud[name], (mud["truth"] or {}).get(name)
        if gathered.value is None or truth is None:
            continue
        value, uncertainty = PER_CM3 * gathered.value, 2.0 * PER_CM3 * (gathered.std_error or 0.0)
        panel.errorbar(PER_CM3 * truth, value, uncertainty or None, capsize=4, ecolor=INK, linestyle="",
                       lolims=gathered.at_least, **mark_of(looks[mud["mud"]]))  # fmt: skip
        largest = max(largest, value + uncertainty, PER_CM3 * truth)
    panel.plot([0.0, 1.1 * largest], [0.0, 1.1 * largest], color=GREY, linewidth=1.0, label="equal")
    panel.set_xlabel(f"{LABELS[name]} by load cell (N/cm³)")
    panel.set_ylabel("by the flipper (N/cm³)")
    panel.legend(fontsize="small", loc="upper left")
