"""Pictures of the load cell's trials: force and depth with the fits, and coefficients."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from control.records import COEFFICIENTS
from experiments.loadcell.analysis import MudCoefficient
from experiments.loadcell.force_trials import depths_of
from experiments.loadcell.strokes import REVERSAL_FRACTION, AnalysedTrial, StageSettings
from experiments.reports.mud_styles import LABELS, draw_coefficient, looks_of, name_muds
from experiments.reports.style import FAINT, INK

MODEL: dict[str, Any] = {"color": INK, "linestyle": (0, (5, 2)), "linewidth": 1.4, "zorder": 5}
BEFORE_S, AFTER_S = 0.3, 0.4
SHOWN_ABOVE_M = 0.01  # the mud


def draw_mud(
    trials: Sequence[AnalysedTrial], coefficients: Mapping[str, MudCoefficient], settings: StageSettings
) -> Figure:
    """Draw all trials of one mud from their beginnings, with the model by the mud's coefficients."""
    figure = Figure(figsize=(10.0, 7.0))
    (vertical, shear), (depth, curve) = figure.subplots(2, 2, height_ratios=(1.5, 1.0))
    strokes = [trial for trial in trials if "k_p" in trial.strokes]
    for i, trial in enumerate(strokes):
        look = {"color": f"C{i}", "linewidth": 1.0}
        _plot_insertion((vertical, depth, curve), trial, look, f"trial {trial.recorded.number}")
    if strokes:
        _plot_vertical_model(vertical, curve, strokes[-1], coefficients, settings)
    drags = [(trial, trial.strokes["k_s"]) for trial in trials if "k_s" in trial.strokes]
    for i, (trial, stroke) in enumerate(drags):
        since_s = trial.profile.times_s - stroke.begin_s
        forces_n, shown = trial.profile.forces_n - trial.profile.zero_n, since_s > -BEFORE_S
        look = {"color": f"C{i}", "linewidth": 1.0}
        shear.plot(since_s[shown], forces_n[shown], label=f"trial {trial.recorded.number}", **look)
    if drags:
        stroke = drags[-1][1]
        steady_s = [stroke.steady_s - stroke.begin_s, stroke.end_s - stroke.begin_s]
        shear.plot(steady_s, 2 * [coefficients["k_s"].value * settings.moment_m3], label="model", **MODEL)
    _name_axes(vertical, shear, depth, curve)
    return figure


def _plot_insertion(panels: tuple[Axes, Axes, Axes], trial: AnalysedTrial, look: dict[str, Any], label: str) -> None:
    """Plot force and depth against time, and force against depth."""
    profile, depths_m, down = trial.profile, depths_of(trial), trial.strokes["k_p"]
    end_s = trial.strokes["k_e"].end_s if "k_e" in trial.strokes else profile.times_s[-1]
    shown = (profile.times_s > down.begin_s - BEFORE_S) & (profile.times_s < end_s + AFTER_S)
    since_s, forces_n = profile.times_s[shown] - down.begin_s, profile.forces_n[shown] - down.level_n
    depths_cm = 100.0 * np.where(depths_m[shown] < -SHOWN_ABOVE_M, np.nan, depths_m[shown])
    vertical, depth, curve = panels
    vertical.plot(since_s, forces_n, label=label, **look)
    depth.plot(since_s, depths_cm, **look)
    wet = depths_cm >= -0.2
    curve.plot(depths_cm[wet], forces_n[wet], **look)


def _plot_vertical_model(
    vertical: Axes,
    curve: Axes,
    trial: AnalysedTrial,
    coefficients: Mapping[str, MudCoefficient],
    settings: StageSettings,
) -> None:
    """Plot the model against time, along the depths of the trial."""
    profile, trial_m = trial.profile, depths_of(trial)
    times_s, even_m = profile.times_s, np.linspace(0.0, settings.depth_m, 40)
    for name, stroke in trial.strokes.items():
        sign, fraction = (1.0, 1.0) if name == "k_p" else (-1.0, 1.0 - REVERSAL_FRACTION)
        per_m3, within = sign * coefficients[name].value, (trial_m >= 0.0) & (trial_m <= fraction * np.nanmax(trial_m))
        shown = within & (times_s >= stroke.begin_s) & (times_s <= stroke.end_s)
        since_s, label = times_s[shown] - trial.strokes["k_p"].begin_s, "model" if name == "k_p" else None
        vertical.plot(since_s, per_m3 * settings.volumes_m3(trial_m[shown]), label=label, **MODEL)
        curve.plot(100.0 * fraction * even_m, per_m3 * settings.volumes_m3(fraction * even_m), **MODEL)


def _name_axes(vertical: Axes, shear: Axes, depth: Axes, curve: Axes) -> None:
    for panel, title, x, y in (
        (vertical, "insertion, hold, extraction", "", "force on the plate, up (N)"),
        (shear, "horizontal shear", "time since the force began (s)", "force against the drag (N)"),
        (depth, "depth", "time since the surface (s)", "depth (cm)"),
        (curve, "force over depth", "depth (cm)", "force (N)"),
    ):
        panel.set(xlabel=x, ylabel=y, title=title)
        if panel is not depth:
            panel.axhline(0.0, color=FAINT, linewidth=0.6)
    depth.invert_yaxis()
    depth.sharex(vertical)
    for panel in (vertical, shear):
        if panel.get_legend_handles_labels()[0]:
            panel.legend(loc="upper right" if panel is vertical else "center", ncols=2, frameon=False)


def draw_coefficients(muds: Mapping[str, Mapping[str, MudCoefficient]]) -> Figure:
    figure, looks = Figure(figsize=(10.0, 3.4)), looks_of(list(muds))
    for panel, name in zip(figure.subplots(1, 3), COEFFICIENTS, strict=True):
        for x, (mud, own) in enumerate(muds.items()):
            draw_coefficient(panel, x, own[name], looks[mud])
        name_muds(panel, list(muds), f"{LABELS[name]} (N/cm³)")
    return figure
