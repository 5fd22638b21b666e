"""The walks over several muds as pictures, after the paper's figures 6 and 7."""

from collections.abc import Mapping, Sequence
from itertools import chain, pairwise
from math import nan
from statistics import stdev
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pandas import DataFrame

from control.records import COEFFICIENTS, Phase
from estimation.mud import PAPER_DRAG_N
from experiments.reports.coefficient_table import GatheredCoefficient
from experiments.reports.mud_names import mud_text
from experiments.reports.mud_styles import LABELS, PHASE_NAMES, line_of, looks_of
from experiments.reports.style import FAINT, INK, say_empty
from experiments.reports.text_tables import number
from experiments.reports.value_text import N_CM3
from experiments.study.notebook import Entry
from experiments.trials.estimation_methods import COMPENSATED, DEFAULT, PAPER
from experiments.trials.stride_profile import profile_from, stroke_of
from experiments.walk.known_surface import KNOWN, KNOWN_COMPENSATED
from experiments.walk.measurement import WalkTrials

STROKE_STYLES = {  # as in the paper
    Phase.INSERTION: ("C0", "-"),
    Phase.STANCE: ("C2", "--"),
    Phase.EXTRACTION: ("C3", "-."),
}
METHOD_STYLES: dict[str, dict[str, Any]] = {
    DEFAULT: {"color": "C0", "marker": "o"},
    PAPER: {"color": "C1", "marker": "x"},
    COMPENSATED: {"color": "C3", "marker": "+"},
}
LOAD_CELL = "load cell"
BARS = {
    KNOWN: ("paper's law", None),  # in the colour of its depth
    KNOWN_COMPENSATED: ("paper's law\nwith drag", "C2"),
    DEFAULT: ("default", "C4"),
    LOAD_CELL: ("load cell", "#d9d9d9"),
}
LEGEND: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.98), "fontsize": "small", "frameon": False}
HEADROOM = 2.0  # height of a panel over the largest true or own value; higher values are drawn at the edge


def draw_walk_over(plan: WalkTrials, walk: Entry, strides: DataFrame, reach_m: float) -> Figure:
    """Draw position, forces and coefficients of one walk against time: figure 6."""
    profile, own = profile_from(walk), strides[strides["trial"] == walk["trial"]]
    begun_s, end_s = profile["time_s"].min(), profile["time_s"].max()
    borders_s = _borders_s(plan, walk, profile, own, reach_m)
    figure = Figure(figsize=(10.0, 11.0))
    panels = figure.subplots(6, 1, sharex=True)
    time_s = profile["time_s"] - begun_s
    panels[0].set_ylabel("body (cm)")
    if walk["start_m"] is None:
        say_empty(panels[0], "no pose")
    else:
        panels[0].plot(time_s, 100.0 * (profile["body_x_m"] - walk["start_m"]), color=INK, linewidth=1.2)
    upward_n = profile["force_z_n"].mask(profile["phase"] == Phase.STANCE)
    for panel, force_n, label in (
        (panels[1], profile["force_x_n"], "$f_x$ forward (N)"),
        (panels[2], upward_n, "$f_z$ up (N)"),
    ):
        panel.plot(time_s, force_n, color="#bbbbbb", linewidth=0.8)  # outside of the strokes
        for phase, (colour, style) in STROKE_STYLES.items():
            stroke_n = force_n.where(profile["phase"] == phase)
            if stroke_n.any():
                panel.plot(time_s, stroke_n, style, color=colour, linewidth=1.3, label=PHASE_NAMES[phase])
        panel.set_ylabel(label)
        panel.legend(ncols=3, **LEGEND)
    for panel, name in zip(panels[3:], COEFFICIENTS, strict=True):
        _draw_coefficient(panel, name, own[own["coefficient"] == name], begun_s)
    for letter, panel in zip("ABCDEF", panels, strict=True):
        panel.set_title(letter, loc="left", fontsize="medium", fontweight="bold")
        for border_s in borders_s:
            panel.axvline(border_s - begun_s, color=INK, linewidth=1.0)
    for (mud, _), (start_s, until_s) in zip(plan.muds, pairwise([begun_s, *borders_s, end_s]), strict=False):
        middle_s = (start_s + until_s) / 2.0 - begun_s
        panels[0].annotate(mud_text(mud), (middle_s, 1.02), xycoords=("data", "axes fraction"), ha="center")
    panels[0].set_xlim(0.0, end_s - begun_s)
    panels[-1].set_xlabel("time (s)")
    return figure


def _borders_s(plan: WalkTrials, walk: Entry, profile: DataFrame, own: DataFrame, reach_m: float) -> list[float]:
    """Return when the plates first went down past each border; by the order of the strides where there is no pose."""
    if walk["start_m"] is None:
        times_s, plates_m = own["t_start_s"], own["plates_m"]
    else:
        times_s, plates_m = profile["time_s"], profile["body_x_m"] - walk["start_m"] + reach_m
    beyond_s = (times_s[plates_m >= border_m].head(1).tolist() for border_m in plan.layout.ends_m[:-1])
    return list(chain.from_iterable(beyond_s))


def _draw_coefficient(panel: Axes, name: str, own: DataFrame, begun_s: float) -> None:
    """Draw the estimates by all methods; arrows are lower bounds, the dashed line the load cell's values."""
    valid = own[own["valid"].astype(bool)]
    tallest = own["truth"].max() if own["truth"].any() else valid["value"].max() if len(valid) else 1.0
    top = HEADROOM * tallest / N_CM3
    known = own[own["truth"].notna() & (own["method"] == DEFAULT)]
    look: dict[str, Any] = {"color": FAINT, "linewidth": 1.8, "label": "load cell"}
    panel.plot(known["t_end_s"] - begun_s, known["truth"] / N_CM3, "--", **look)
    for method, style in METHOD_STYLES.items():
        rows = valid[valid["method"] == method]
        if method == COMPENSATED and name != "k_s":
            continue  # it compensates k_s alone
        errors = 2.0 / N_CM3 * rows["std_error"] * (method == DEFAULT)
        bounds = rows["at_least"].astype(bool)
        values = (rows["value"] / N_CM3).clip(upper=0.97 * top)
        panel.errorbar(rows["t_end_s"] - begun_s, values, errors.mask(bounds, 0.1 * top), lolims=bounds,
                       linestyle="", linewidth=1.0, markersize=6.0, label=method, **style)  # fmt: skip
    panel.set(ylim=(0.0, top), ylabel=f"{LABELS[name]}\n(N/cm³)")
    panel.legend(ncols=5, **LEGEND)


# figure 7


def draw_soft(soft: Mapping[str, Any], walks: Mapping[float, Sequence[Entry]]) -> Figure:
    """Draw f_x in one stance at each depth, and k_s by method with the load cell's: figure 7."""
    figure = Figure(figsize=(10.0, 4.2))
    forces, bars = figure.subplots(1, 2, width_ratios=(1.0, 1.5))
    looks = looks_of([f"{depth_cm:g} cm" for depth_cm in walks])
    for depth_cm, trials in walks.items():
        stance, label = stroke_of(profile_from(trials[0]), Phase.STANCE), f"{depth_cm:g} cm"
        time_s = stance["time_s"] - stance["time_s"].min()
        forces.plot(time_s, stance["force_x_n"], label=f"z = {label}", **line_of(looks[label]))
    forces.axhline(PAPER_DRAG_N / 2.0, color=FAINT, linewidth=1.2, linestyle=":",
                   label=f"half of the paper's {PAPER_DRAG_N:g} N of body drag")  # fmt: skip
    forces.set(xlabel="time in stance (s)", ylabel="$f_x$ of one flipper (N)", ylim=(0.0, None))
    forces.legend(fontsize="small", loc="lower right")
    forces.set_title(f"A   mud {mud_text(soft['mud'])}", loc="left", fontsize="medium")
    deepest_first = sorted(soft["depths"], key=lambda each: -each["depth_cm"])
    rows = [
        bar_of(
            label,
            colour or looks[f"{each['depth_cm']:g} cm"]["color"],
            each,
            each["truth"] if method == LOAD_CELL else each["k_s"].get(method),
        )
        for method, (label, colour) in BARS.items()
        for each in (deepest_first[:1] if method == KNOWN_COMPENSATED else deepest_first)
    ]
    names, values, sds, colours, texts, hatches = zip(*rows, strict=True)
    drawn = bars.bar(range(len(names)), values, 0.7, yerr=sds, color=colours, edgecolor=INK, hatch=hatches, capsize=4)
    bars.bar_label(drawn, texts, fontsize="small")
    bars.set_xticks(range(len(names)), names, fontsize="small")
    bars.margins(y=0.12)
    bars.set(ylabel="$k_s$ (N/cm³)", ylim=(0.0, None))
    bars.set_title("B   $k_s$ by method", loc="left", fontsize="medium")
    return figure


def bar_of(
    label: str, colour: Any, depth: Mapping[str, Any], found: GatheredCoefficient | float | None
) -> tuple[str, float, float, Any, str, str]:
    """Return name, value, standard deviation of the trials, colour, text and hatch; a lower bound is hatched."""
    gathered = found if isinstance(found, GatheredCoefficient) else None
    value_n_m3 = gathered.value if gathered else found
    value = value_n_m3 / N_CM3 if isinstance(value_n_m3, float) else nan
    bound = gathered is not None and gathered.at_least
    return (
        f"{label}\n{depth['depth_cm']:g} cm",
        value,
        stdev(gathered.trials) / N_CM3 if gathered and len(gathered.trials) > 1 else 0.0,
        colour,
        f"{'≥ ' * bound}{number(value)}",
        "//" * bound,
    )
