"""Figures of the actuator calibration: sensed against external torque, friction by speed. The paper's is grey."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.actuator.fit import JointFit
from experiments.reports.style import BODY, FAINT, FORWARD, INK, WIDTH_IN
from experiments.reports.value_text import value_text

HEIGHT_IN, COLUMNS = 4.2, 2
SENSED, EXTERNAL = r"$\tau_\mathrm{sense}$", r"$\tau_\mathrm{ext}$"
DASH: dict[str, Any] = {"color": FAINT, "linewidth": 1.2}
DOT: dict[str, Any] = {"color": FORWARD, "markerfacecolor": "none", "zorder": 3}


def draw_torques(fits: Sequence[JointFit]) -> Figure:
    figure, axes = _panels(fits, f"external torque {EXTERNAL} (N·m)", f"sensed torque {SENSED} (N·m)")
    for axis, (numbers, loads, _) in zip(axes, fits, strict=True):
        bound_nm, configured_nm_a = numbers["paper_rmse_nm"], numbers["configured_nm_a"]
        whole_nm = np.array([0.0, 1.08 * max(loads.torque_nm)])
        axis.fill_between(whole_nm, whole_nm - bound_nm, whole_nm + bound_nm, color=BODY, linewidth=0.0)
        axis.plot(whole_nm, whole_nm, label=f"equal ± {bound_nm:g} N·m, the paper's RMSE", **DASH)
        configured_nm, label = configured_nm_a * loads.current_a, f"configured: {configured_nm_a:g} N·m/A"
        axis.plot(loads.torque_nm, configured_nm, "x", color=INK, markersize=5, label=label)
        constant = value_text(numbers["torque_constant_nm_a"], numbers["torque_constant_error_nm_a"])
        axis.plot(loads.torque_nm, loads.fitted_nm, "o", label=f"fitted: {constant} N·m/A", **DOT)
        axis.legend(loc="upper left", frameon=False)
    return figure


def draw_friction(fits: Sequence[JointFit]) -> Figure:
    """Every joint needs loops."""
    figure, axes = _panels(fits, "speed (rad/s)", "torque spent (mN·m)")
    for axis, (numbers, _, loops) in zip(axes, fits, strict=True):
        rest_mnm = 1e3 * numbers["rest_friction_nm"]
        axis.axhline(rest_mnm, linestyle=":", label=f"at rest at least: {rest_mnm:.1f} mN·m", **DASH)
        speeds_rad_s = np.array([loop.speed_rad_s for loop in loops])
        spent_mnm = [1e3 * numbers["torque_constant_nm_a"] * loop.spent_a for loop in loops]
        axis.plot(speeds_rad_s, spent_mnm, "o", label="a loop", **DOT)
        dry, viscous = (
            value_text(numbers[name], numbers[error], per=1e-3)
            for name, error in (("friction_nm", "friction_error_nm"), ("viscous_nm_s", "viscous_error_nm_s"))
        )
        line_rad_s = np.array([0.0, 1.1 * max(speeds_rad_s)])
        slope_nm_s = np.nan_to_num(numbers["viscous_nm_s"])  # all friction counts as dry where it is not known
        label = f"dry {dry} mN·m,\nviscous {viscous} mN·m·s"
        axis.plot(line_rad_s, 1e3 * (numbers["friction_nm"] + slope_nm_s * line_rad_s), label=label, color=INK)
        axis.legend(loc="upper left", frameon=False)
    axes[0].set(xlim=(0.0, None), ylim=(0.0, 1.4 * axes[0].get_ylim()[1]))  # of all; room for the legend
    return figure


def _panels(fits: Sequence[JointFit], xlabel: str, ylabel: str) -> tuple[Figure, Sequence[Axes]]:
    """Return one panel for each joint, two in a row."""
    columns = min(COLUMNS, len(fits))
    rows = -(-len(fits) // columns)
    figure = Figure(figsize=(WIDTH_IN * columns / COLUMNS, HEIGHT_IN * rows))
    axes: list[Axes] = list(figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).flat)
    for axis, fit in zip(axes, fits, strict=False):
        axis.set(title=fit.numbers["joint"].replace("_", " "), xlabel=xlabel, ylabel=ylabel)
        axis.label_outer()
    for axis in axes[len(fits) - columns : len(fits)]:  # the lowest of each column, also above an empty panel
        axis.set_xlabel(xlabel)
        axis.tick_params(labelbottom=True)
    for axis in axes[len(fits) :]:
        axis.set_axis_off()
    return figure, axes[: len(fits)]
