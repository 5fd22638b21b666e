"""The pictures of a report: every fit with its residuals, after the law τ = k Φ, and several runs side by side.

Moments in cm⁴ and torques in N·cm make the slope of a line the coefficient in N/cm³. In a stance the depth, and so the
moment, hardly changes: shear is drawn along its stroke instead, with a line of k times the moment.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import nan
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pandas import DataFrame

from control.records import COEFFICIENTS
from estimation.strokes.fit_samples import FitSamples
from experiments.pictures.recorded_walk import in_detail
from experiments.pictures.robot_sketch import prepare, show_scales
from experiments.reports.coefficient_table import GatheredCoefficient
from experiments.reports.mud_names import mud_key
from experiments.reports.mud_styles import LABELS, draw_coefficient, looks_of, mark_of, name_muds
from experiments.reports.style import FAINT, WIDTH_IN, say_empty
from experiments.reports.value_text import N_CM3
from experiments.run_report.results import SPEED, Entry, run_labels
from experiments.run_report.run import Run

Floats = NDArray[np.float64]
Layer = tuple[Floats, Floats, str, dict[str, Any]]  # forward and down in m, the colours' values, their label and scale
CM4, N_CM = 1e8, 100.0  # in m⁴, and in N·m
MOST_DRAWN = 10  # strides of each mud, evenly over the run
MOST_MUDS = 12  # a robot on its own notices hundreds in an hour
LEGEND_COLUMN_IN = 3.0  # "k_p 1.4 N/cm³, from 3200 s, walk 2" with its mark
INSIDE, BEYOND = 2.0, 0.6  # percentiles of the samples, and how far of their range a sample may be beyond them
NARROW_IN, HEIGHT_IN = 6.0, 7.2  # with one flipper
DRAWN_OF_FIT = ("torques_nm", "residuals_nm")
MARK: dict[str, Any] = {"markersize": 3.0, "alpha": 0.7, "linestyle": ""}
MARGIN_M = 0.015  # around the deepest path
GAMMA_DEG = np.linspace(-90.0, 90.0, 91)
BIN_DEG, SEEN_FRACTION = 15.0, 0.05  # of the directions in which plates moved, and of their paths: corners have less
SEEN_S, STEP_M = 60.0, 0.003  # of each walk, and of a path that has a direction: poses are known within 0.3 mm
MOST_PERCENT = 50.0  # of a prediction's error that has a colour of its own
WIDTH = 0.6  # of the runs of one mud, as a fraction of the distance between two muds


def drawn_muds(run: Run) -> list[str]:
    """Return the muds with the most strides in the order of the run, at most MOST_MUDS."""
    strides = run.strides[run.strides["mud"] != ""].groupby("mud", sort=False).size()
    most = set(strides.nlargest(MOST_MUDS).index)
    return [str(mud) for mud in strides.index if mud in most]


def draw_fits(run: Run) -> Figure:
    """Draw the fits of each coefficient next to their residuals, the left flipper next to the right one."""
    muds, flippers = drawn_muds(run), run.replay.flippers
    looks = {mud: MARK | {key: look[key] for key in ("color", "marker")} for mud, look in looks_of(muds).items()}
    width_in = NARROW_IN if len(flippers) == 1 else WIDTH_IN
    figure = Figure(figsize=(width_in, HEIGHT_IN))
    axes = figure.subplots(len(COEFFICIENTS), 2 * len(flippers), squeeze=False)
    fitted = run.estimates[run.estimates["samples"].notna() & run.estimates["mud"].isin(muds)]
    for row, name in zip(axes, COEFFICIENTS, strict=True):
        drawn = []
        for fit, residuals, flipper in zip(row[::2], row[1::2], flippers, strict=True):
            own = fitted[(fitted["coefficient"] == name) & (fitted["flipper"] == flipper)]
            drawn.append(_draw_samples(fit, residuals, own, looks, along_stroke=name == "k_s"))
            fit.set_title(f"{LABELS[name]}, {flipper}")
            residuals.set_title("residuals")
        for panels, heights in zip((row[::2], row[1::2]), zip(*drawn, strict=True), strict=True):
            _share_scales(panels, heights)
        row[0].set_ylabel("torque (N·cm)")
        for panel in row:
            panel.set_xlabel("part of the stroke (%)" if name == "k_s" else "moment (cm⁴)")
    handles = [axes[0, 0].plot([], [], **looks[mud], label=mud.replace("k_p", "$k_p$"))[0] for mud in muds]
    columns = min(max(len(muds), 1), int(width_in / LEGEND_COLUMN_IN))
    figure.legend(handles=handles, loc="outside upper center", ncols=columns, frameon=False)
    return figure


def _draw_samples(
    fit: Axes, residuals: Axes, fitted: DataFrame, looks: Mapping[str, dict[str, Any]], along_stroke: bool
) -> tuple[Floats, Floats]:
    """Draw all strides of a mud as one artist of each kind: one of its own takes ten kilobytes.

    Return the torques and the residuals that were drawn, in N·cm.
    """
    drawn = [(np.empty(0), np.empty(0))]
    for mud, all_samples in fitted.groupby("mud", sort=False)["samples"]:
        chosen = np.unique(np.linspace(0, len(all_samples) - 1, MOST_DRAWN).round().astype(int))
        samples = [all_samples.iloc[number] for number in chosen]
        places = [_percent_of_stroke(each) if along_stroke else CM4 * np.asarray(each.moments_m4) for each in samples]
        lines = [_fitted_line(*each, along_stroke) for each in zip(samples, places, strict=True)]
        torques, remains = (N_CM * np.concatenate([getattr(each, name) for each in samples]) for name in DRAWN_OF_FIT)
        fit.plot(np.concatenate(places), torques, **looks[str(mud)])
        fit.plot(*np.hstack(lines), color=looks[str(mud)]["color"], linewidth=0.8)
        residuals.plot(np.concatenate(places), remains, **looks[str(mud)])
        drawn.append((torques, remains))
    if len(drawn) == 1:
        say_empty(fit, "no fit")
    residuals.axhline(0.0, color=FAINT, linewidth=0.8)
    torques, remains = map(np.concatenate, zip(*drawn, strict=True))
    return torques, remains


def _percent_of_stroke(samples: FitSamples) -> Floats:
    """Return the middle of each batch of travel on the way of all of them."""
    ends_m = np.cumsum(samples.weights_m)
    return np.asarray(100.0 * (ends_m - np.asarray(samples.weights_m) / 2.0) / ends_m[-1])


def _fitted_line(samples: FitSamples, places: Floats, along_stroke: bool) -> tuple[Any, Any]:
    """Return the fitted torque at the samples, or the line from the origin; NaN parts it from the next one."""
    if along_stroke:
        fitted_nm = np.subtract(samples.torques_nm, samples.residuals_nm)
        return [*places, nan], [*(N_CM * fitted_nm), nan]
    return [0.0, max(places), nan], [0.0, samples.slope / N_CM3 * max(places), nan]


def _share_scales(panels: Sequence[Axes], heights: Sequence[Floats]) -> None:
    """Give the panels of both flippers the same scales; leave single samples far off out, and count them."""
    for panel in panels[1:]:
        panel.sharex(panels[0])
        panel.sharey(panels[0])
    panels[0].autoscale()
    joined = np.concatenate(heights)
    if not len(joined):
        return
    low, high = np.percentile(joined, [INSIDE, 100.0 - INSIDE])
    bottom, top = panels[0].get_ylim()
    room = BEYOND * (high - low)
    bottom, top = max(bottom, float(low - room)), min(top, float(high + room))
    if not bottom < top:
        return
    panels[0].set_ylim(bottom, top)
    for panel, own in zip(panels, heights, strict=True):
        if outside := int(np.sum((own < bottom) | (own > top))):
            panel.annotate(f"{outside} beyond", (0.98, 0.02), xycoords="axes fraction", ha="right", size=7, color=FAINT)


def draw_paths(run: Run) -> Figure:
    """Draw where the plates' lower edges went, in the colour of the force and in that of the prediction's error."""
    figure = Figure(figsize=(WIDTH_IN, 3.2))
    layers, half_m = (_felt_n(run), _prediction_errors_percent(run)), run.walks[0].geometry.flipper_length_m
    deepest_m = max([0.0, *layers[0][0][:, 1], *layers[1][0][:, 1]])
    for panel, (places, colours, label, look) in zip(figure.subplots(1, 2), layers, strict=True):
        prepare(panel, -half_m, half_m, deepest_m + MARGIN_M, MARGIN_M)
        show_scales(panel)
        if len(places):
            marks = panel.scatter(places[:, 0], -places[:, 1], 5.0, colours, zorder=3, rasterized=True, **look)
            figure.colorbar(marks, ax=panel, location="bottom", label=label)
        else:
            say_empty(panel, f"no {label.partition(' (')[0]}")
    return figure


def _felt_n(run: Run) -> Layer:
    """Return the force of the mud on the plate in all rows below the surface; in a stance only along the track."""
    rows, length_m = [], run.walks[0].geometry.flipper_length_m
    for side in [side for walk in run.walks for side in walk.sides]:
        force_n = np.hypot(side.force_x_n, np.nan_to_num(side.force_z_n))
        rows.append(np.stack([length_m * np.sin(side.sweep_angle_rad), side.depth_m, force_n], axis=1))
    below = np.concatenate(rows)
    below = below[(below[:, 1] > 0.0) & np.isfinite(below).all(axis=1)]
    top_n = float(np.percentile(below[:, 2], 100.0 - INSIDE)) if len(below) else 1.0
    return below[:, :2], below[:, 2], "force of the mud (N)", {"cmap": "viridis", "vmin": 0.0, "vmax": top_n}


def _prediction_errors_percent(run: Run) -> Layer:
    """Return how much too large the torque is that the strides before let expect, of the largest one of a stride."""
    length_m, drawn = run.walks[0].geometry.flipper_length_m, [np.empty((0, 3))]
    known = run.estimates[run.estimates["samples"].notna() & run.estimates["expected_n_m3"].notna()]
    for _, stride in known.groupby(["walk", "index", "flipper"], sort=False):
        largest_nm = max(np.abs(each.torques_nm).max() for each in stride["samples"])
        for samples, k_n_m3 in zip(stride["samples"], stride["expected_n_m3"], strict=True):
            excess_nm = k_n_m3 * np.asarray(samples.moments_m4) - samples.torques_nm
            ahead_m = length_m * np.sin(samples.sweeps_rad)
            drawn.append(np.stack([ahead_m, samples.depths_m, 100.0 * excess_nm / largest_nm], axis=1))
    places = np.concatenate(drawn)
    look = {"cmap": "coolwarm", "vmin": -MOST_PERCENT, "vmax": MOST_PERCENT}
    return places[:, :2], places[:, 2], "prediction minus torque (% of the largest of the stride)", look


def draw_directions(run: Run, headline: Entry) -> Figure:
    """Draw how each mud resists an upright plate by the direction of its motion; hatched where no plate moved.

    At the angle γ below the horizontal clay presses with k_s across the plate, sand with k_s cos γ, and along it both
    with (k_p - k_e + (k_p + k_e) sin γ) / 2.
    """
    figure, looks, unseen_deg = Figure(figsize=(WIDTH_IN, 3.6)), looks_of(drawn_muds(run)), _unseen_directions_deg(run)
    across, along = figure.subplots(1, 2)
    for result in [each for each in headline["muds"] if each["mud"] in looks]:
        look, (k_p, k_s, k_e) = looks[result["mud"]], (result["both"][name] for name in COEFFICIENTS)
        height = (k_s.value or nan) / N_CM3
        across.plot(GAMMA_DEG, height * np.cos(np.radians(GAMMA_DEG)), "--", color=look["color"])
        label = result["mud"].replace("k_p", "$k_p$")
        across.plot(GAMMA_DEG, np.full_like(GAMMA_DEG, height), color=look["color"], label=label)
        draw_coefficient(across, 0.0, k_s, look)
        _draw_along(along, k_p, k_e, look)
    for panel, name in ((across, "across the plate"), (along, "along the plate, up")):
        panel.set(xlabel="direction of motion: up -90°, down 90°", ylabel=f"{name} (N/cm³)", xticks=range(-90, 91, 45))
        for low_deg in unseen_deg:
            panel.axvspan(low_deg, low_deg + BIN_DEG, facecolor="none", edgecolor=FAINT, hatch="///", linewidth=0)
    figure.legend(loc="outside upper center", ncols=4, frameon=False)
    return figure


def _draw_along(panel: Axes, k_p: GatheredCoefficient, k_e: GatheredCoefficient, look: Mapping[str, Any]) -> None:
    """Draw k_p of a plate that goes down, -k_e of one that goes up, and the law between them with two errors."""
    draw_coefficient(panel, 90.0, k_p, dict(look))
    if k_e.value is None:
        return
    draw_coefficient(panel, -90.0, replace(k_e, value=-k_e.value, trials=[-each for each in k_e.trials]), dict(look))
    if k_p.value is not None and not (k_p.at_least or k_e.at_least):
        down, up = (1.0 + np.sin(np.radians(GAMMA_DEG))) / 2.0, (1.0 - np.sin(np.radians(GAMMA_DEG))) / 2.0
        height = (down * k_p.value - up * k_e.value) / N_CM3
        error = 2.0 * np.hypot(down * (k_p.std_error or 0.0), up * (k_e.std_error or 0.0)) / N_CM3
        panel.plot(GAMMA_DEG, height, color=look["color"])
        panel.fill_between(GAMMA_DEG, height - error, height + error, color=look["color"], alpha=0.2, linewidth=0)


def _unseen_directions_deg(run: Run) -> list[float]:
    """Return where the bins begin in whose directions the lower edges hardly went through the mud."""
    bins_deg = np.arange(-90.0, 90.0 + BIN_DEG, BIN_DEG)
    seen_m = np.zeros(len(bins_deg) - 1)
    for side in [side for walk in run.walks for side in in_detail(walk, [(0.0, SEEN_S)]).sides]:
        body_m = np.zeros_like(side.body_x_m) if side.fixed_base else side.body_x_m
        forward_m = body_m + side.geometry.flipper_length_m * np.sin(side.sweep_angle_rad)
        edge_m = np.stack([forward_m, side.depth_m], axis=1)
        known_m = edge_m[np.isfinite(edge_m).all(axis=1) & (side.time_s <= SEEN_S)]
        passed_m = [*known_m[:1]]
        for place_m in known_m:
            if np.hypot(*(place_m - passed_m[-1])) >= STEP_M:
                passed_m.append(place_m)
        in_mud = [(a, b) for a, b in pairwise(passed_m) if min(a[1], b[1]) > 0.0]
        moves_m = np.array([b - a for a, b in in_mud]).reshape(-1, 2)
        gamma_deg = np.degrees(np.arctan2(moves_m[:, 1], np.abs(moves_m[:, 0])))
        seen_m += np.histogram(gamma_deg, bins_deg, weights=np.hypot(*moves_m.T))[0]
    return [float(low) for low in bins_deg[:-1][seen_m <= SEEN_FRACTION * seen_m.sum()]]


def draw_comparison(runs: Sequence[Run], headlines: Sequence[Entry]) -> Figure:
    """Draw speed and coefficients of several runs mud by mud."""
    labels = [*run_labels(runs, headlines).values()]
    results = [(run, each) for run, headline in enumerate(headlines) for each in headline["muds"]]
    muds = {mud_key(result["mud"]): result["mud"].replace(" N/cm³", "") for _, result in results}
    looks = [*looks_of(labels).values()]
    has_speed = any(result["speed_m_s"] is not None for _, result in results)
    figure = Figure(figsize=(WIDTH_IN, 6.0))
    axes = figure.subplots(2, 2).flatten() if has_speed else figure.subplots(1, 3)
    for panel, name in zip(axes, [*[SPEED] * has_speed, *COEFFICIENTS], strict=True):
        for run, result in results:
            x = list(muds).index(mud_key(result["mud"])) + WIDTH * ((run + 0.5) / len(runs) - 0.5)
            speed_m_s, error_m_s = result["speed_m_s"], result["speed_std_error_m_s"]
            if name != SPEED:
                draw_coefficient(panel, x, result["both"][name], looks[run])
            elif speed_m_s is not None:
                panel.errorbar(x, 100.0 * speed_m_s, error_m_s and 200.0 * error_m_s, **mark_of(looks[run]))
        name_muds(panel, [*muds.values()], "speed (cm/s)" if name == SPEED else f"{LABELS[name]} (N/cm³)")
    handles = [
        axes[0].plot([], [], **mark_of(look), linestyle="", label=run)[0]
        for run, look in zip(labels, looks, strict=True)
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=min(len(runs), 3), frameon=False)
    return figure
