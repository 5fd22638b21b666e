"""Figures of the actuator calibration: sensed against external torque, friction by speed.

In black and white, joints differ by their markers, and configured from fitted; what is the paper's is grey.
"""

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.actuator.fit import JointFit
from experiments.reports.value_text import value_text

HEIGHT_IN, WIDTH_IN = 4.2, 5.0  # two next to each other are as wide as every picture
SENSED, EXTERNAL = r"$\tau_\mathrm{sense}$", r"$\tau_\mathrm{ext}$"
GREY, LIGHT_GREY = "0.45", "0.85"
BLUE, RED = "#1f5fa8", "#b5322c"
MARKERS = {"adduction": "o", "sweep": "D"}  # the paper's circles and diamonds
COLOURS = {"adduction": BLUE, "sweep": RED}


def draw_torques(fits: Sequence[JointFit]) -> Figure:
    highest_nm = max(fit.numbers["configured_nm_a"] * max(fit.loads.current_a) for fit in fits)
    figure, axes = _panels(fits)
    axes[0].set_ylim(-0.05 * highest_nm, 1.3 * highest_nm)  # of all; room for the legend
    axes[0].set_ylabel(f"sensed torque {SENSED} (N·m)")
    for axis, (numbers, loads, _) in zip(axes, fits, strict=True):
        bound_nm, configured_nm_a = numbers["paper_rmse_nm"], numbers["configured_nm_a"]
        whole_nm = [0.0, 1.08 * max(loads.torque_nm)]
        around = [each - bound_nm for each in whole_nm], [each + bound_nm for each in whole_nm]
        axis.fill_between(whole_nm, *around, color=LIGHT_GREY, linewidth=0.0, zorder=0)
        label = f"equal ± {bound_nm:g} N·m, the paper's RMSE"
        axis.plot(whole_nm, whole_nm, color=GREY, linewidth=1.2, label=label, zorder=1)
        configured_nm, label = configured_nm_a * loads.current_a, f"configured: {configured_nm_a:g} N·m/A"
        axis.plot(loads.torque_nm, configured_nm, "x", color="black", markersize=5, label=label, zorder=2)
        constant = value_text(numbers["torque_constant_nm_a"], numbers["torque_constant_error_nm_a"])
        label = f"fitted: {constant} N·m/A"
        axis.plot(loads.torque_nm, loads.fitted_nm, label=label, zorder=3, **_style(numbers["joint"]))
        axis.set_xlabel(f"external torque {EXTERNAL} (N·m)")
    return _with_legends(figure)


def draw_friction(fits: Sequence[JointFit]) -> Figure:
    """Every joint needs loops."""
    figure, axes = _panels(fits)
    axes[0].set_ylabel("torque spent (mN·m)")
    highest_mnm = 0.0
    for axis, (numbers, _, loops) in zip(axes, fits, strict=True):
        rest_mnm = 1e3 * numbers["rest_friction_nm"]
        label = f"at rest at least: {rest_mnm:.1f} mN·m"
        axis.axhline(rest_mnm, color="black", linestyle=":", linewidth=1.2, label=label)
        speeds_rad_s = [loop.speed_rad_s for loop in loops]
        spent_mnm = [1e3 * numbers["torque_constant_nm_a"] * loop.spent_a for loop in loops]
        axis.plot(speeds_rad_s, spent_mnm, label="a loop", **_style(numbers["joint"]))
        highest_mnm = max(highest_mnm, rest_mnm, *spent_mnm)
        if isfinite(numbers["friction_nm"]):
            _plot_friction_line(axis, numbers, 1.1 * max(speeds_rad_s))
        axis.set_xlabel("speed (rad/s)")
        axis.set_xlim(left=0.0)
    axes[0].set_ylim(0.0, 1.5 * highest_mnm)  # of all; room for the legend
    return _with_legends(figure)


def _plot_friction_line(axis: Axes, numbers: Mapping[str, Any], fastest_rad_s: float) -> None:
    dry_mnm, slope_mnm_s = 1e3 * numbers["friction_nm"], 0.0
    label = f"dry {value_text(numbers['friction_nm'], numbers['friction_error_nm'], per=1e-3)} mN·m"
    if isfinite(numbers["viscous_nm_s"]):
        viscous = value_text(numbers["viscous_nm_s"], numbers["viscous_error_nm_s"], per=1e-3)
        label += f",\nviscous {viscous} mN·m·s"
        slope_mnm_s = 1e3 * numbers["viscous_nm_s"]
    line_mnm = [dry_mnm, dry_mnm + slope_mnm_s * fastest_rad_s]
    axis.plot([0.0, fastest_rad_s], line_mnm, color="black", linewidth=1.5, label=label)


def _style(joint: str) -> dict[str, Any]:
    kind = joint.split("_")[1]
    look = {"markersize": 6, "markerfacecolor": "none", "markeredgewidth": 1.2, "linestyle": "none"}
    return look | {"marker": MARKERS[kind], "color": COLOURS[kind]}


def _panels(fits: Sequence[JointFit]) -> tuple[Figure, Sequence[Axes]]:
    """Return one panel for each joint, side by side."""
    figure = Figure(figsize=(WIDTH_IN * len(fits), HEIGHT_IN))
    axes: Sequence[Axes] = figure.subplots(1, len(fits), sharey=True, squeeze=False)[0]
    for axis, fit in zip(axes, fits, strict=True):
        axis.set_title(fit.numbers["joint"].replace("_", " "))
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(color="0.92", linewidth=0.6)
        axis.set_axisbelow(True)
    return figure, axes


def _with_legends(figure: Figure) -> Figure:
    for axis in figure.axes:
        axis.legend(loc="upper left", frameon=False)
    return figure
