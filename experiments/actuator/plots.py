"""Figures of the actuator calibration: sensed against external torque, errors by weight, friction by speed.

In black and white, joints differ by their markers, and configured from fitted; what is the paper's is grey.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from statistics import fmean
from typing import Any

from matplotlib.figure import Figure

from experiments.actuator.fit import JointFit, paper_rmse_nm
from experiments.reports.value_text import value_text

HEIGHT_IN, WIDTH_IN, DPI = 3.4, 3.6, 200  # two next to each other fill the width of a printed page
SENSED, EXTERNAL = r"$\tau_\mathrm{sense}$", r"$\tau_\mathrm{ext}$"
GREY, LIGHT_GREY = "0.45", "0.85"
BLUE, RED = "#1f5fa8", "#b5322c"
MARKERS = {"adduction": "o", "sweep": "D"}  # the paper's circles and diamonds
COLOURS = {"adduction": BLUE, "sweep": RED}


def plot_torques(fits: Sequence[JointFit], path: Path) -> None:
    figure, axes = _panels(len(fits))
    highest_nm = max(fit.configured_nm_a * load.current_a for fit in fits for load in fit.loads)
    axes[0].set_ylim(-0.05 * highest_nm, 1.3 * highest_nm)  # of all; room for the legend
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
        fitted_nm = [fit.fitted_nm(load) for load in fit.loads]
        axis.plot(external_nm, fitted_nm, label=label, zorder=3, **_style(fit))
        axis.set_title(_titled(fit))
        axis.set_xlabel(f"external torque {EXTERNAL} (N·m)")
        axis.legend(loc="upper left", frameon=False, fontsize=8)
    axes[0].set_ylabel(f"sensed torque {SENSED} (N·m)")
    figure.savefig(path, dpi=DPI)


def plot_errors(fits: Sequence[JointFit], path: Path) -> None:
    figure, axes = _panels(len(fits))
    highest_mnm = 1e3 * max(max(paper_rmse_nm(fit.joint), *map(abs, _errors_nm(fit))) for fit in fits)
    axes[0].set_ylim(-1.15 * highest_mnm, 1.75 * highest_mnm)  # of all; room for the legend
    for axis, fit in zip(axes, fits, strict=True):
        bound_mnm = 1e3 * paper_rmse_nm(fit.joint)
        weights_g = sorted({load.weight_g for load in fit.loads})
        label = f"paper's RMSE, ±{bound_mnm:g} mN·m"
        axis.axhspan(-bound_mnm, bound_mnm, color=LIGHT_GREY, linewidth=0.0, zorder=0, label=label)
        axis.axhline(0.0, color=GREY, linewidth=0.8, zorder=1)
        for column, weight_g in enumerate(weights_g):
            _plot_weight(axis, fit, column, weight_g, last=column == len(weights_g) - 1)
        axis.set_xticks(range(len(weights_g)), [f"{weight_g:g}" for weight_g in weights_g])
        axis.set_title(f"{_titled(fit)}\nRMSE fitted {1e3 * fit.rmse_fitted_nm:.1f} mN·m")
        axis.set_xlabel("weight (g)")
        axis.legend(loc="upper left", frameon=False, fontsize=8)
    axes[0].set_ylabel(f"{SENSED} $-$ {EXTERNAL} (mN·m)")
    figure.savefig(path, dpi=DPI)


def _plot_weight(axis: Any, fit: JointFit, column: int, weight_g: float, last: bool) -> None:
    errors = zip(fit.loads, _errors_nm(fit), strict=True)
    errors_mnm = [1e3 * error_nm for load, error_nm in errors if load.weight_g == weight_g]
    label = "their mean" if last else None
    axis.plot([column - 0.28, column + 0.28], [fmean(errors_mnm)] * 2, color="black", linewidth=1.8, label=label)
    label = None if column else "a trial, fitted constant"
    axis.plot([column] * len(errors_mnm), errors_mnm, zorder=2, label=label, **_style(fit))


def _errors_nm(fit: JointFit) -> list[float]:
    return [fit.fitted_nm(load) - load.torque_nm for load in fit.loads]


def plot_friction(fits: Sequence[JointFit], path: Path) -> None:
    figure, axes = _panels(len(fits))
    highest_mnm = 1e3 * max(fit.constant_nm_a * max([fit.rest_friction_a, *_spent_a(fit)]) for fit in fits)
    axes[0].set_ylim(0.0, 1.5 * highest_mnm)  # of all; room for the legend
    for axis, fit in zip(axes, fits, strict=True):
        (dry_nm, dry_error_nm), (viscous_nm_s, viscous_error_nm_s) = fit.friction_nm, fit.viscous_nm_s
        speeds_rad_s = [loop.speed_rad_s for loop in fit.loops]
        spent_mnm = [1e3 * fit.constant_nm_a * spent_a for spent_a in _spent_a(fit)]
        rest_mnm = 1e3 * fit.constant_nm_a * fit.rest_friction_a
        axis.axhline(
            rest_mnm, color="black", linestyle=":", linewidth=1.2, label=f"at rest at least: {rest_mnm:.1f} mN·m"
        )
        axis.plot(speeds_rad_s, spent_mnm, label="a loop", **_style(fit))
        if isfinite(dry_nm):
            whole_rad_s = [0.0, 1.1 * max(speeds_rad_s)]
            slope_nm_s = viscous_nm_s if isfinite(viscous_nm_s) else 0.0
            label = f"dry {value_text(dry_nm, dry_error_nm, per=1e-3)} mN·m"
            if isfinite(viscous_nm_s):
                label += f",\nviscous {value_text(viscous_nm_s, viscous_error_nm_s, per=1e-3)} mN·m·s"
            line_mnm = [1e3 * (dry_nm + slope_nm_s * speed_rad_s) for speed_rad_s in whole_rad_s]
            axis.plot(whole_rad_s, line_mnm, color="black", linewidth=1.5, label=label)
        axis.set_title(_titled(fit))
        axis.set_xlabel("speed (rad/s)")
        axis.set_xlim(left=0.0)
        axis.legend(loc="upper left", frameon=False, fontsize=8)
    axes[0].set_ylabel("torque spent (mN·m)")
    figure.savefig(path, dpi=DPI)


def _spent_a(fit: JointFit) -> list[float]:
    return [loop.spent_a for loop in fit.loops]


def _titled(fit: JointFit) -> str:
    return fit.joint.replace("_", " ")


def _style(fit: JointFit) -> dict[str, Any]:
    kind = fit.joint.split("_")[1]
    look = {"markersize": 6, "markerfacecolor": "none", "markeredgewidth": 1.2, "linestyle": "none"}
    return look | {"marker": MARKERS[kind], "color": COLOURS[kind]}


def _panels(count: int) -> tuple[Figure, Sequence[Any]]:
    """Side by side, with what lies on paper around them."""
    figure = Figure(figsize=(WIDTH_IN * count, HEIGHT_IN), layout="constrained")
    axes = figure.subplots(1, count, sharey=True, squeeze=False)[0]
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(color="0.92", linewidth=0.6)
        axis.set_axisbelow(True)
    return figure, axes
