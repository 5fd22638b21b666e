"""Figures of the actuator calibration: sensed against external torque, and errors by weight. Readable in print."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

from matplotlib.figure import Figure

from experiments.actuator_fit import JointFit
from experiments.actuator_report import paper_rmse_nm

HEIGHT_IN, WIDTH_IN = 4.2, 4.6
GREY, LIGHT_GREY = "0.45", "0.85"
BLUE, RED = "#1f5fa8", "#b5322c"
MARKERS = {"adduction": "o", "sweep": "D"}  # the paper's circles and diamonds
COLOURS = {"adduction": BLUE, "sweep": RED}


def plot_torques(fits: Sequence[JointFit], path: Path) -> None:
    figure, axes = _panels(len(fits))
    for axis, fit in zip(axes, fits, strict=True):
        kind = fit.joint.split("_")[1]
        external_nm = [load.torque_nm for load in fit.loads]
        largest_nm = 1.08 * max(external_nm)
        axis.plot([0.0, largest_nm], [0.0, largest_nm], color=GREY, linewidth=1.2, label="equal", zorder=1)
        configured_nm = [fit.configured_nm_a * load.current_a for load in fit.loads]
        label = f"configured, {fit.configured_nm_a:g} N·m/A"
        axis.plot(external_nm, configured_nm, "x", color="black", markersize=5, label=label, zorder=2)
        label = f"fitted, {fit.line.constant_nm_a:.4f} ± {fit.line.constant_error_nm_a:.4f} N·m/A"
        fitted_nm = [fit.fitted_nm(load) for load in fit.loads]
        style = {"color": COLOURS[kind], "markersize": 6, "markerfacecolor": "none", "markeredgewidth": 1.2}
        axis.plot(external_nm, fitted_nm, MARKERS[kind], label=label, zorder=3, linestyle="none", **style)
        axis.set_title(fit.joint.replace("_", " "), fontsize=11)
        axis.set_xlabel("external torque τ_ext, N·m")
        axis.legend(frameon=False, fontsize=8, loc="upper left")
    axes[0].set_ylabel("sensed torque τ_sense, N·m")
    figure.savefig(path, dpi=160)


def plot_errors(fits: Sequence[JointFit], path: Path) -> None:
    figure, axes = _panels(len(fits))
    for axis, fit in zip(axes, fits, strict=True):
        kind, bound_nm = fit.joint.split("_")[1], paper_rmse_nm(fit.joint)
        weights_g = sorted({load.weight_g for load in fit.loads})
        label = f"paper's RMSE, ±{bound_nm:g} N·m"
        axis.axhspan(-1e3 * bound_nm, 1e3 * bound_nm, color=LIGHT_GREY, zorder=0, label=label)
        axis.axhline(0.0, color=GREY, linewidth=0.8, zorder=1)
        for place, weight_g in enumerate(weights_g):
            errors_mnm = [
                1e3 * (fit.fitted_nm(load) - load.torque_nm) for load in fit.loads if load.weight_g == weight_g
            ]
            mean_mnm = fmean(errors_mnm)
            mean_label = "their mean" if place == len(weights_g) - 1 else None
            axis.plot([place - 0.28, place + 0.28], [mean_mnm] * 2, color="black", linewidth=1.8, label=mean_label)
            axis.plot(
                [place] * len(errors_mnm),
                errors_mnm,
                MARKERS[kind],
                color=COLOURS[kind],
                markersize=5,
                markerfacecolor="none",
                zorder=2,
                label="a trial" if place == 0 else None,
            )
        axis.set_xticks(range(len(weights_g)), [f"{weight_g:g}" for weight_g in weights_g])
        axis.set_title(f"{fit.joint.replace('_', ' ')}: RMSE {1e3 * fit.rmse_fitted_nm:.1f} mN·m", fontsize=11)
        axis.set_xlabel("weight, g")
        axis.legend(frameon=False, fontsize=8, loc="upper left")
        highest_mnm = max(1e3 * bound_nm, *(abs(value) for value in axis.get_ylim()))
        axis.set_ylim(-1.15 * highest_mnm, 1.45 * highest_mnm)  # room for the legend
    axes[0].set_ylabel("τ_sense - τ_ext, mN·m")
    figure.savefig(path, dpi=160)


def _panels(count: int) -> tuple[Figure, Sequence[Any]]:
    """Side by side, with what lies on paper around them."""
    figure = Figure(figsize=(WIDTH_IN * count, HEIGHT_IN), layout="constrained")
    axes = figure.subplots(1, count, sharey=True, squeeze=False)[0]
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(color="0.92", linewidth=0.6)
        axis.set_axisbelow(True)
    return figure, axes
