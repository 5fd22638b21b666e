"""Figures of the actuator calibration: sensed against external torque, friction by speed.

In black and white, joints differ by their markers, and configured from fitted; what is the paper's is grey.
"""

from collections.abc import Sequence
from math import isfinite
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.actuator.fit import JointFit, paper_rmse_nm
from experiments.reports.value_text import value_text

HEIGHT_IN, WIDTH_IN = 3.4, 3.6  # two next to each other fill the width of a printed page
SENSED, EXTERNAL = r"$\tau_\mathrm{sense}$", r"$\tau_\mathrm{ext}$"
GREY, LIGHT_GREY = "0.45", "0.85"
BLUE, RED = "#1f5fa8", "#b5322c"
MARKERS = {"adduction": "o", "sweep": "D"}  # the paper's circles and diamonds
COLOURS = {"adduction": BLUE, "sweep": RED}


def draw_torques(fits: Sequence[JointFit]) -> Figure:
    highest_nm = max(fit.configured_nm_a * load.current_a for fit in fits for load in fit.loads)
    figure, axes = _panels(fits)
    axes[0].set_ylim(-0.05 * highest_nm, 1.3 * highest_nm)  # of all; room for the legend
    axes[0].set_ylabel(f"sensed torque {SENSED} (N·m)")
    for axis, fit in zip(axes, fits, strict=True):
        external_nm, bound_nm = [load.torque_nm for load in fit.loads], paper_rmse_nm(fit.joint)
        whole_nm = [0.0, 1.08 * max(external_nm)]
        label = f"equal ± {bound_nm:g} N·m, the paper's RMSE"
        around = [each - bound_nm for each in whole_nm], [each + bound_nm for each in whole_nm]
        axis.fill_between(whole_nm, *around, color=LIGHT_GREY, linewidth=0.0, zorder=0)
        axis.plot(whole_nm, whole_nm, color=GREY, linewidth=1.2, label=label, zorder=1)
        configured_nm = [fit.configured_nm_a * load.current_a for load in fit.loads]
        label = f"configured: {fit.configured_nm_a:g} N·m/A"
        axis.plot(external_nm, configured_nm, "x", color="black", markersize=5, label=label, zorder=2)
        label = f"fitted: {value_text(fit.constant_nm_a, fit.constant_error_nm_a)} N·m/A"
        axis.plot(external_nm, [fit.fitted_nm(load) for load in fit.loads], label=label, zorder=3, **_style(fit))
        axis.set_xlabel(f"external torque {EXTERNAL} (N·m)")
    return _with_legends(figure)


def draw_friction(fits: Sequence[JointFit]) -> Figure:
    highest_nm = max(
        fit.constant_nm_a * max(fit.rest_friction_a, *(loop.spent_a for loop in fit.loops)) for fit in fits
    )
    figure, axes = _panels(fits)
    axes[0].set_ylim(0.0, 1.5e3 * highest_nm)  # of all; room for the legend
    axes[0].set_ylabel("torque spent (mN·m)")
    for axis, fit in zip(axes, fits, strict=True):
        rest_mnm, label = 1e3 * fit.constant_nm_a * fit.rest_friction_a, "at rest at least"
        axis.axhline(rest_mnm, color="black", linestyle=":", linewidth=1.2, label=f"{label}: {rest_mnm:.1f} mN·m")
        spent_mnm = [1e3 * fit.constant_nm_a * loop.spent_a for loop in fit.loops]
        axis.plot([loop.speed_rad_s for loop in fit.loops], spent_mnm, label="a loop", **_style(fit))
        _plot_friction_line(axis, fit)
        axis.set_xlabel("speed (rad/s)")
        axis.set_xlim(left=0.0)
    return _with_legends(figure)


def _plot_friction_line(axis: Axes, fit: JointFit) -> None:
    (dry_nm, dry_error_nm), (viscous_nm_s, viscous_error_nm_s) = fit.friction_nm, fit.viscous_nm_s
    if not isfinite(dry_nm):
        return
    label, slope_nm_s = f"dry {value_text(dry_nm, dry_error_nm, per=1e-3)} mN·m", 0.0
    if isfinite(viscous_nm_s):
        label += f",\nviscous {value_text(viscous_nm_s, viscous_error_nm_s, per=1e-3)} mN·m·s"
        slope_nm_s = viscous_nm_s
    fastest_rad_s = 1.1 * max(loop.speed_rad_s for loop in fit.loops)
    line_mnm = [1e3 * dry_nm, 1e3 * (dry_nm + slope_nm_s * fastest_rad_s)]
    axis.plot([0.0, fastest_rad_s], line_mnm, color="black", linewidth=1.5, label=label)


def _style(fit: JointFit) -> dict[str, Any]:
    kind = fit.joint.split("_")[1]
    look = {"markersize": 6, "markerfacecolor": "none", "markeredgewidth": 1.2, "linestyle": "none"}
    return look | {"marker": MARKERS[kind], "color": COLOURS[kind]}


def _panels(fits: Sequence[JointFit]) -> tuple[Figure, Sequence[Axes]]:
    """Return one panel for each joint, side by side."""
    figure = Figure(figsize=(WIDTH_IN * len(fits), HEIGHT_IN))
    axes: Sequence[Axes] = figure.subplots(1, len(fits), sharey=True, squeeze=False)[0]
    for axis, fit in zip(axes, fits, strict=True):
        axis.set_title(fit.joint.replace("_", " "))
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(color="0.92", linewidth=0.6)
        axis.set_axisbelow(True)
    return figure, axes


def _with_legends(figure: Figure) -> Figure:
    for axis in figure.axes:
        axis.legend(loc="upper left", frameon=False)
    return figure
