"""The single flipper's trials as pictures, after the paper's figures 4 and 5."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from control.geometry import FlipperGeometry
from control.records import Phase
from experiments.flipper.modelled_force import laws_of
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
from experiments.trials.stride_profile import StrideProfile, profile_from_row

Muds = Sequence[Mapping[str, Any]]  # of the summary
THIN: dict[str, Any] = {"linewidth": 1.1}
DASHED: dict[str, Any] = THIN | {"linestyle": "--"}
MODELLED: dict[str, Any] = {"linewidth": 2.0, "linestyle": (0, (3, 1.5))}
STRIDE_PANELS: tuple[tuple[str, dict[str, Any]], ...] = (  # label and legend
    ("depth (cm)", {"loc": "center", "bbox_to_anchor": (0.82, 0.62)}),
    ("joint angle (°)", {"loc": "center left", "bbox_to_anchor": (0.06, 0.5)}),
    ("$f_z$ up (N)", {"ncols": 3, "loc": "upper right"}),
    ("$f_x$ forward (N)", {"ncols": 2, "loc": "upper right"}),
)


def draw_stride(trial: Entry, geometry: FlipperGeometry, method: str) -> Figure:
    """Draw depth, angles and forces of one stride against time, with the forces by the laws: figure 4."""
    profile, surface_m, laws = laws_of(trial, geometry, method)
    upward_n = np.where(profile.during(Phase.STANCE), np.nan, profile.force_z_n)
    inserting_n, extracting_n = (
        np.where(profile.during(phase), laws.force_z_n, np.nan) for phase in (Phase.INSERTION, Phase.EXTRACTION)
    )
    figure = Figure(figsize=(7.0, 8.2))
    panels = figure.subplots(4, 1, sharex=True)
    for number, values, colour, label, style in (
        (0, 100.0 * profile.depth_command_m, GREY, "$z_c$ commanded", DASHED),
        (0, 100.0 * profile.depth_m, INK, "$z$ actual", THIN),
        (1, np.degrees(profile.sweep_rad), "tab:blue", "sweep $\\alpha$", THIN),
        (1, np.degrees(profile.adduction_rad), "tab:red", "adduction $\\beta$", DASHED),
        (2, upward_n, "tab:green", "$f_z$ measured", THIN),
        (2, inserting_n, "tab:red", "by $k_p$", MODELLED),
        (2, extracting_n, "navy", "by $k_e$", MODELLED),
        (3, profile.force_x_n, "tab:blue", "$f_x$ measured", THIN),
        (3, laws.force_x_n, "tab:red", "by $k_s$", MODELLED),
    ):
        panels[number].plot(profile.time_s, values, color=colour, label=label, **style)
    panels[0].axhline(100.0 * surface_m, color=GREY, linewidth=0.8, linestyle=":", label="surface found")
    panels[0].invert_yaxis()
    for panel in panels[2:]:
        panel.axhline(0.0, color=GREY, linewidth=0.6)
    for letter, panel, (label, legend) in zip("BCDE", panels, STRIDE_PANELS, strict=True):  # the paper's A is a drawing
        panel.set_ylabel(label)
        panel.legend(fontsize="small", **legend)
        panel.text(0.006, 0.94, letter, transform=panel.transAxes, va="top", fontweight="bold")
        panel.margins(x=0.0)
    _mark_phases(panels, profile)
    panels[0].set_title(f"mud {mud_text(trial['mud'])}, trial {trial['trial']}\n", fontsize="medium", loc="left")
    panels[-1].set_xlabel("time (s)")
    return figure


def _mark_phases(panels: Sequence[Axes], profile: StrideProfile) -> None:
    """Shade the strokes in every panel, and name them above the first."""
    for phase, colour in PHASE_SHADES.items():
        times_s = profile.time_s[profile.during(phase)]
        if len(times_s):
            for panel in panels:
                panel.axvspan(float(times_s[0]), float(times_s[-1]), color=colour, linewidth=0.0, zorder=0)
            panels[0].annotate(PHASE_NAMES[phase], (float(times_s.mean()), 1.02), xycoords=("data", "axes fraction"),
                               ha="center", va="bottom", fontsize="small")  # fmt: skip


# figure 5


def draw_coefficients(muds: Muds, firsts: Mapping[str, Entry]) -> Figure:
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


def _draw_curves(panels: Sequence[Axes], firsts: Mapping[str, Entry], looks: Mapping[str, dict[str, Any]]) -> None:
    """Draw f_z against depth in insertion, f_x against sweep in stance, and f_z against depth in extraction."""
    for mud, trial in firsts.items():
        profile = profile_from_row(trial["course"])
        depth_cm, sweep_deg = 100.0 * profile.depth_m, np.degrees(profile.sweep_rad)
        for panel, (phase, name), x, y in zip(
            panels,
            PHASE_NAMES.items(),
            (depth_cm, sweep_deg, depth_cm),
            (profile.force_z_n, profile.force_x_n, profile.force_z_n),
            strict=True,
        ):
            during, force = profile.during(phase), "$f_x$" if phase is Phase.STANCE else "$f_z$"
            panel.plot(x[during], y[during], label=mud_text(mud), **line_of(looks[mud]))
            panel.set_xlabel("sweep $\\alpha$ (°)" if phase is Phase.STANCE else "depth $z$ (cm)")
            panel.set_ylabel(f"{force} in {name} (N)")
    for panel in panels:
        panel.axhline(0.0, color=GREY, linewidth=0.6)
    for panel in panels[1:]:
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
