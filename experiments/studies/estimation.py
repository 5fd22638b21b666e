"""The accuracy of the mud coefficients: estimates against a virtual load cell, over muds, trials and methods.

After the paper's sections III-B and III-C: a single flipper on a fixed base through five muds, the walking robot
through three muds and over their borders, and through the same three with the protocol `measuring`, in the simulator's
clay with the disturbances of the authors' logs. Each trial is simulated once, and every method estimates from the same
samples.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, product
from typing import Annotated, Any, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from pandas import DataFrame

from control.records import COEFFICIENTS
from estimation.estimation_parameters import EstimationParameters
from experiments.reports.coefficient_table import compared_frame
from experiments.reports.error_table import error_rows, plate_rows
from experiments.reports.mud_names import mud_text
from experiments.reports.style import FAINT, WIDTH_IN
from experiments.reports.text_tables import number
from experiments.study.option import Option, OptionError
from experiments.study.result import Figure, Result, Table
from experiments.study.trials import Trials
from experiments.trials.estimation_methods import COMPENSATED, DEFAULT, PAPER, with_method
from experiments.trials.load_cell_truth import true_strides
from experiments.trials.transitions import transition_rows, transitions_of
from experiments.trials.trial import (
    LATENCY_S,
    MEASURING_WALK,
    SINGLE,
    TORQUE_ERROR,
    WALKING,
    Setup,
    compared_trial,
    run_trial,
)
from simulation.mud.clay import Clay, clay_of_water
from simulation.mud.disturbances import LAB, NONE
from simulation.mud.track import Track

SCHEMA = 2
SINGLE_WATERS = (47.6, 48.6, 49.5, 50.3, 51.2)  # figure 5 of the paper
WALKING_WATERS = (47.6, 49.5, 51.2)  # figure 6
SETUPS = {"single": SINGLE, "walking": WALKING, "measuring": MEASURING_WALK}
WATERS = {"single": SINGLE_WATERS, "walking": WALKING_WATERS, "measuring": WALKING_WATERS}
STRIDES = {"single": 2, "walking": 8, "measuring": 8}
TRANSITION_STRIDES = 24
ENDLESS_M = 100.0
COMPARTMENT_M = 0.5
REPEATS, TORQUE, LATENCY = "repeats", "torque", "latency"  # of the samples and of what is known, not of mud and drives
FIELD_OF_LAYER = {
    "clinging": "clinging_n",
    "shaking": "shaken_fraction",
    "remoulding": "remoulding",
    "relaxation": "relaxation",
    "surface": "surface_sd_m",
    "trial-surface": "trial_surface_sd_m",
    "sweep-friction": "sweep_friction_nm",
    "adduction-friction": "adduction_friction_nm",
    "noise": "current_noise_a",
    "saturation": "current_limit_a",
}
LAYERS = (*FIELD_OF_LAYER, REPEATS, TORQUE, LATENCY)
DODGE = 0.15  # between the methods of one mud
COLOURS = {DEFAULT: "C0", PAPER: "C1", COMPENSATED: "C3"}
LINEAR_PERCENT, HIGHEST_PERCENT = 20.0, 150.0  # where the logarithmic scale begins, and its end
ERRORS = (
    "Error of each estimate by setup, coefficient, mud and method. A dot is the median, its line ends at the 95th "
    f"percentile. The scale is logarithmic above {LINEAR_PERCENT:g} % and ends at {HIGHEST_PERCENT:g} %, where higher "
    "values are drawn. The dotted line is at 10 %. 'bounds': all estimates are lower bounds, which have no error."
)
Row = dict[str, Any]


def parse_layers(text: str) -> tuple[str, ...]:
    """Parse names of disturbances, separated by commas. Raises OptionError for an unknown one."""
    layers = tuple(name for name in text.split(",") if name) if text != "none" else ()
    for layer in layers:
        if layer not in LAYERS:
            raise OptionError(f"layer {layer!r}: must be one of {', '.join(LAYERS)}, or none")
    return layers


def parse_water(text: str) -> Clay:
    """Parse the water content of a mud in percent. Raises OptionError outside of what can be simulated."""
    try:
        return clay_of_water(float(text))
    except ValueError as problem:
        raise OptionError(str(problem)) from None


Layers = Annotated[
    tuple[str, ...],
    Option("disturbances, separated by commas, or none (default: all)", metavar="A,B", parse=parse_layers, joined=True),
]


def study(
    trials: Trials,
    *,
    setup: Annotated[
        Literal["single", "walking", "measuring", "all"],
        Option("one flipper on a fixed base, the gait `walking`, the gait `measuring`, or all"),
    ] = "all",
    seeds: Annotated[int, Option("trials of each mud", low=1, high=1000)] = 10,
    mud: Annotated[
        tuple[Clay, ...], Option("water content in percent (default: the paper's)", metavar="W", parse=parse_water)
    ] = (),
    strength: Annotated[
        tuple[float, ...], Option("of muds, instead of their water", low=50, high=50000, unit="Pa")
    ] = (),
    layers: Layers = LAYERS,
) -> Result:
    """Estimated coefficients against a load cell."""
    if mud and strength:
        raise OptionError("--mud: not allowed with --strength, which names the same muds by another quantity")
    named = mud or tuple(Clay(f"{strength_pa:g} Pa", strength_pa) for strength_pa in strength)
    muds = {
        name: (named or tuple(map(clay_of_water, waters))) if setup in (name, "all") else ()
        for name, waters in WATERS.items()
    }
    measured = trials.run(run_part, parts_of(muds, seeds, layers))
    evaluated = compared_frame(chain.from_iterable(measured["evaluated"]))
    errors, plates = error_rows(evaluated), plate_rows(evaluated)
    boundaries = transition_rows(DataFrame(list(chain.from_iterable(measured["transitions"]))))
    strengths_pa = {name: {clay.name: round(clay.strength_pa, 1) for clay in own} for name, own in muds.items()}
    settings = {"seeds": seeds} | {f"{name}_strength_pa": own for name, own in strengths_pa.items()} | world_of(layers)
    summary = {"errors": errors, "plates": plates, "boundaries": boundaries, "settings": settings}
    return Result(
        tables=[
            _table("errors", "", errors),
            _table("plates", "The paper's upright plate (section II-E)", plates),
            *[_table("boundaries", "Mud boundaries", boundaries)] * bool(boundaries),
        ],
        figures=[Figure("estimation", ERRORS, partial(draw_errors, errors))],
        summary=summary,
        notes=[] if boundaries else ["Mud boundaries: no walk over any"],
    )


def parts_of(muds: Mapping[str, Sequence[Clay]], seeds: int, layers: Sequence[str]) -> list[Row]:
    """Return the trials, the longest first, so that the last ones end together."""
    numbers, walking = range(1, seeds + 1), tuple(muds["walking"])
    parts = [
        ("walking", walking[::-1] if seed % 2 else walking, TRANSITION_STRIDES, seed)
        for seed in numbers
        if len(walking) > 1
    ]
    parts += [(name, (clay,), STRIDES[name], seed) for name in SETUPS for clay in muds[name] for seed in numbers]
    return [
        {"setup": name, "muds": [[*clay[:2]] for clay in clays], "strides": strides, "seed": seed, "layers": [*layers]}
        for name, clays, strides, seed in parts
    ]


def world_of(layers: Sequence[str]) -> dict[str, Any]:
    """Return the laboratory's disturbances of these names, without all others."""
    known = {field: getattr(LAB, field) for layer, field in FIELD_OF_LAYER.items() if layer in layers}
    return {
        "disturbances": replace(NONE, **known),
        "repeats": REPEATS in layers,  # rows come more often than new samples
        "torque_error": TORQUE_ERROR if TORQUE in layers else 0.0,  # of torque constants
        "latency_s": LATENCY_S if LATENCY in layers else 0.0,  # of currents or angles, the largest of a trial
    }


def methods_of(setup: Setup) -> Iterator[tuple[dict[str, str], bool, EstimationParameters]]:
    """Yield the names of each method and its setup, whether it has the pose, and its parameters.

    All know how uneven the mud is, as an operator would see.
    """
    known = EstimationParameters(fixed_base=setup.fixed_base, surface_error_m=LAB.surface_error_m)
    for name in (DEFAULT, PAPER) if setup.fixed_base else (DEFAULT, PAPER, COMPENSATED):
        yield {"setup": setup.name, "method": name}, True, with_method(known, name)
    if not setup.fixed_base:
        yield {"setup": f"{setup.name} without pose", "method": DEFAULT}, False, known


def run_part(
    setup: str, muds: Sequence[Sequence[Any]], strides: int, seed: int, layers: Sequence[str]
) -> dict[str, list[Row]]:
    """Simulate one trial and evaluate every method on it, or its transitions between muds."""
    clays, world = [Clay(*each) for each in muds], world_of(layers)
    track = Track([(ENDLESS_M if len(clays) == 1 else COMPARTMENT_M, clay) for clay in clays])
    own = SETUPS[setup] if world["repeats"] else replace(SETUPS[setup], row_period_s=0.0)
    trial = run_trial(own, track, world["disturbances"], strides, seed, world["torque_error"], world["latency_s"])
    known = trial.truths, trial.configuration, world["disturbances"].relaxation
    leaning = true_strides(*known)
    if len(clays) > 1:
        return {"evaluated": [], "transitions": transitions_of(trial, leaning)}
    plates, evaluated = (leaning, true_strides(*known, upright=True)), list[Row]()
    for names, with_pose, parameters in methods_of(own):
        evaluated += compared_trial(trial, parameters, plates, with_pose, mud=clays[0].name, **names)
    return {"evaluated": evaluated, "transitions": []}


# tables and figure


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.1f} %"


SHOWN: dict[str, Callable[[Any], str]] = {  # by key of a row; others as they are
    **dict.fromkeys(("mud", "from", "to"), mud_text),
    **dict.fromkeys(("median", "p95", "bias", "coverage", "bounds_hold", "lean_fraction", "within_two"), _percent),
    **dict.fromkeys(("chi", "upright_over_leaning", "estimate_over_upright"), number),
}
HEADS = {  # by key; others are their keys
    "coefficient": "",
    "coverage": "in 95 %",
    "bounds_hold": "hold",
    "not_valid": "not valid",
    "upright_over_leaning": "upright / leaning plate",
    "estimate_over_upright": "estimate / upright",
    "lean_fraction": "fraction due to the lean",
    "within_two": "followed within two strides",
    "most_strides": "most strides",
}
NOT_SHOWN = ("bound_over_truth", "truth_n_m3")


def _table(name: str, title: str, rows: Sequence[Row]) -> Table:
    cells = [{key: SHOWN.get(key, str)(value) for key, value in row.items() if key not in NOT_SHOWN} for row in rows]
    return Table(name, title, {}, DataFrame(cells).rename(columns=HEADS))


def draw_errors(errors: Sequence[Row]) -> Drawing:
    """Draw median and 95th percentile of the error by setup, coefficient, mud and method."""
    rows = DataFrame(errors)
    setups = rows["setup"].unique()
    figure = Drawing(figsize=(WIDTH_IN, 2.8 * len(setups)))
    panels = figure.subplots(len(setups), len(COEFFICIENTS), squeeze=False)
    for (setup, name), panel in zip(product(setups, COEFFICIENTS), panels.flat, strict=True):
        _draw_panel(panel, rows[(rows["setup"] == setup) & (rows["coefficient"] == name)])
        panel.set_title(f"{setup}: ${name}$")
    for panel in panels[:, 0]:
        panel.set_ylabel("error (%)")
    methods = {
        name: line for panel in panels.flat for line, name in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(methods.values(), methods.keys(), loc="outside upper center", ncols=len(COLOURS))
    return figure


def _draw_panel(panel: Axes, rows: DataFrame) -> None:
    muds = rows["mud"].unique().tolist()
    for n, (method, colour) in enumerate(COLOURS.items()):
        if method == COMPENSATED and "k_s" not in rows["coefficient"].unique():
            continue  # it compensates k_s alone
        known = rows[(rows["method"] == method) & rows["median"].notna()]
        xs = known["mud"].map(muds.index).astype(float) + DODGE * (n - 1)
        medians, highest = ((100.0 * known[key].astype(float)).clip(upper=HIGHEST_PERCENT) for key in ("median", "p95"))
        panel.vlines(xs, medians, highest, color=colour, linewidth=2)
        panel.plot(xs, medians, "o", color=colour, label=method)
    for mud in rows.loc[(rows["method"] == DEFAULT) & (rows["bounds"] > 0) & (rows["strides"] == 0), "mud"]:
        panel.text(
            muds.index(mud) - DODGE, 0.5, "bounds", rotation=90, ha="center", va="bottom", color=COLOURS[DEFAULT]
        )
    panel.axhline(10.0, color=FAINT, linewidth=0.8, linestyle=":")
    panel.set_xticks(range(len(muds)), list(map(mud_text, muds)))
    panel.set_yscale("symlog", linthresh=LINEAR_PERCENT)
    panel.set_yticks([0, 5, 10, 20, 50, 100], ["0", "5", "10", "20", "50", "100"])
    panel.set(xlabel="mud", xlim=(-0.5, max(len(muds), 1) - 0.5), ylim=(0.0, HIGHEST_PERCENT))
