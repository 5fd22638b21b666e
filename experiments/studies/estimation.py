"""The accuracy of the mud coefficients: estimates against a virtual load cell, over muds, trials and methods.

After the paper's sections III-B and III-C: a single flipper on a fixed base through five muds, the walking robot
through three muds and over their borders, and through the same three with the protocol `measuring`, in the simulator's
clay with the disturbances of the authors' logs. Each trial is simulated once, and every method estimates from the same
samples.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from itertools import chain
from math import isfinite
from typing import Annotated, Any, Literal, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from pandas import DataFrame

from estimation.estimation_parameters import EstimationParameters
from experiments.reports.error_table import COEFFICIENTS, error_rows, evaluation_of, plate_rows
from experiments.reports.mud_names import mud_text
from experiments.reports.text_tables import number
from experiments.study.option import Option, OptionError
from experiments.study.result import Figure, Result, Table
from experiments.study.trials import Trials
from experiments.trials.estimation_methods import COMPENSATED, DEFAULT, PAPER, with_method
from experiments.trials.latency import LATENCY_S
from experiments.trials.load_cell_truth import LoadCellTruth, load_cell_truth
from experiments.trials.transitions import transition_rows, transitions_of
from experiments.trials.trial import (
    MEASURING_WALK,
    SINGLE,
    TORQUE_ERROR,
    WALKING,
    Setup,
    Trial,
    replay_trial,
    run_trial,
)
from simulation.mud.clay import Clay, clay_of_water
from simulation.mud.disturbances import LAB, NONE, Disturbances
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
COLOURS = {"default": "tab:blue", "paper": "tab:red", "paper compensated": "tab:orange"}
HIGHEST_PERCENT = 150.0  # higher values are drawn at the edge
Row = dict[str, Any]
Columns = Mapping[str, tuple[str, Callable[[Any], str]]]  # by head: the key in a row, and how its value is shown


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
    evaluated = DataFrame(list(chain.from_iterable(measured["evaluated"])))
    errors, plates = error_rows(evaluated), plate_rows(evaluated)
    boundaries = transition_rows(DataFrame(list(chain.from_iterable(measured["transitions"]))))
    settings = settings_of(muds, seeds, layers)
    summary = {"errors": errors, "plates": plates, "boundaries": boundaries, "settings": settings}
    return Result(
        tables=[
            _table("errors", "", errors, ERROR_COLUMNS),
            _table("plates", "The paper's upright plate (section II-E)", plates, PLATE_COLUMNS),
            *[_table("boundaries", "Mud boundaries", boundaries, BOUNDARY_COLUMNS)] * bool(boundaries),
        ],
        figures=[Figure("estimation", "", partial(draw_errors, errors))],
        summary=summary,
        notes=[] if boundaries else ["Mud boundaries: no walk over any"],
    )


def settings_of(muds: Mapping[str, Sequence[Clay]], seeds: int, layers: Sequence[str]) -> dict[str, Any]:
    """Return what the summary says of the simulated trials."""
    return {
        "seeds": seeds,
        **{
            f"{name}_strength_pa": {clay.name: round(clay.strength_pa, 1) for clay in own} for name, own in muds.items()
        },
        "disturbances": asdict(disturbances_of(layers)),
        "repeats": REPEATS in layers,
        "torque_error": TORQUE_ERROR if TORQUE in layers else 0.0,
        "latency_s": LATENCY_S if LATENCY in layers else 0.0,  # the largest of a trial
    }


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


def disturbances_of(layers: Sequence[str]) -> Disturbances:
    """Return the laboratory's disturbances of these names, without all others."""
    return replace(NONE, **{field: getattr(LAB, field) for layer, field in FIELD_OF_LAYER.items() if layer in layers})


class Method(NamedTuple):
    name: str
    setup: str  # its name in the table
    with_pose: bool
    parameters: EstimationParameters


def methods_of(setup: Setup) -> list[Method]:
    """Return the methods to evaluate. All know how uneven the mud is, as an operator would see."""
    known = EstimationParameters(fixed_base=setup.fixed_base, surface_error_m=LAB.surface_error_m)
    names = (DEFAULT, PAPER) if setup.fixed_base else (DEFAULT, PAPER, COMPENSATED)
    methods = [Method(name, setup.name, True, with_method(known, name)) for name in names]
    without_pose = Method(DEFAULT, f"{setup.name} without pose", False, known)
    return methods if setup.fixed_base else [*methods, without_pose]


def run_part(
    setup: str, muds: Sequence[Sequence[Any]], strides: int, seed: int, layers: Sequence[str]
) -> dict[str, list[Row]]:
    """Simulate one trial and evaluate every method on it, or its transitions between muds.

    With the layer `repeats` rows come more often than new samples, with `torque` torque constants have errors, and with
    `latency` currents or angles are late.
    """
    clays, disturbances = [Clay(*each) for each in muds], disturbances_of(layers)
    track = Track([(ENDLESS_M if len(clays) == 1 else COMPARTMENT_M, clay) for clay in clays])
    own = SETUPS[setup] if REPEATS in layers else replace(SETUPS[setup], row_period_s=0.0)
    torque_error = TORQUE_ERROR if TORQUE in layers else 0.0
    trial = run_trial(own, track, disturbances, strides, seed, torque_error, LATENCY_S if LATENCY in layers else 0.0)
    truths = {
        (truth.flipper, truth.index): load_cell_truth(
            truth, trial.configuration.geometry, disturbances.relaxation, own.gait.pause_s
        )
        for truth in trial.truths
    }
    if len(clays) > 1:
        return {"evaluated": [], "transitions": transitions_of(trial, truths)}
    evaluated = [_evaluate_method(method, clays[0].name, trial, truths, seed) for method in methods_of(own)]
    return {"evaluated": list(chain.from_iterable(evaluated)), "transitions": []}


def _evaluate_method(
    method: Method, mud: str, trial: Trial, truths: Mapping[tuple[str, int], LoadCellTruth], seed: int
) -> Iterator[Row]:
    for stride, _ in replay_trial(trial, method.parameters, method.with_pose):
        truth = truths.get((stride.flipper, stride.index))
        for name in COEFFICIENTS if truth else ():
            estimate, leaning, upright = (getattr(each, name) for each in (stride, *(truth or ())))
            if isfinite(leaning):
                yield evaluation_of(
                    method.setup, mud, name, method.name, estimate, leaning, upright, f"{seed} {stride.flipper}"
                )


# tables and figure


def _table(
    name: str, title: str, rows: Sequence[Row], columns: Mapping[str, tuple[str, Callable[[Any], str]]]
) -> Table:
    shown = [{head: show(row[key]) for head, (key, show) in columns.items()} for row in rows]
    return Table(name, title, {}, DataFrame(shown))


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.1f} %"


ERROR_COLUMNS: Columns = {
    "setup": ("setup", str),
    "mud": ("mud", mud_text),
    "": ("coefficient", str),
    "method": ("method", str),
    "median": ("median", _percent),
    "p95": ("p95", _percent),
    "bias": ("bias", _percent),
    "in 95 %": ("coverage", _percent),
    "chi": ("chi", number),
    "strides": ("strides", str),
    "bounds": ("bounds", str),
    "hold": ("bounds_hold", _percent),
    "not valid": ("not_valid", str),
}
PLATE_COLUMNS: Columns = {
    "setup": ("setup", str),
    "mud": ("mud", mud_text),
    "": ("coefficient", str),
    "upright / leaning plate": ("upright_over_leaning", number),
    "estimate / upright": ("estimate_over_upright", number),
    "fraction due to the lean": ("lean_fraction", _percent),
}
BOUNDARY_COLUMNS: Columns = {
    "from": ("from", mud_text),
    "to": ("to", mud_text),
    "transitions": ("transitions", str),
    "followed within two strides": ("within_two", _percent),
    "most strides": ("most_strides", str),
}


def draw_errors(errors: Sequence[Row]) -> Drawing:
    """Draw median and 95th percentile of the error by setup, coefficient, mud and method."""
    setups = list(dict.fromkeys(row["setup"] for row in errors))
    figure = Drawing(figsize=(4.0 * len(COEFFICIENTS), 2.8 * len(setups)))
    panels = figure.subplots(len(setups), len(COEFFICIENTS), squeeze=False)
    for panel_row, setup in zip(panels, setups, strict=True):
        panel_row[0].set_ylabel("error (%)")
        for panel, name in zip(panel_row, COEFFICIENTS, strict=True):
            _draw_panel(panel, [each for each in errors if (each["setup"], each["coefficient"]) == (setup, name)])
            panel.set_title(f"{setup}: ${name}$")
    methods = {
        name: line for panel in panels.flat for line, name in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(methods.values(), methods.keys(), loc="outside upper center", ncols=len(COLOURS))
    return figure


def _draw_panel(panel: Axes, rows: Sequence[Row]) -> None:
    muds = list(dict.fromkeys(row["mud"] for row in rows))
    for method, colour in COLOURS.items():
        if method == "paper compensated" and rows and rows[0]["coefficient"] != "k_s":
            continue  # it compensates k_s alone
        known = [row for row in rows if row["method"] == method and row["median"] is not None]
        xs = [muds.index(row["mud"]) for row in known]
        medians, highest = ([min(100.0 * row[key], HIGHEST_PERCENT) for row in known] for key in ("median", "p95"))
        panel.vlines(xs, medians, highest, color=colour, linewidth=2)
        panel.plot(xs, medians, "o", color=colour, label=method)
    for row in rows:
        if row["method"] == "default" and row["bounds"] and not row["strides"]:
            panel.text(muds.index(row["mud"]), 2.0, "bounds", ha="center", color=COLOURS["default"], fontsize="small")
    panel.axhline(10.0, color="grey", linewidth=0.8, linestyle=":")
    panel.set_xticks(range(len(muds)), list(map(mud_text, muds)))
    panel.set_xlim(-0.5, max(len(muds), 1) - 0.5)
    panel.set_ylim(0.0, HIGHEST_PERCENT)
    panel.set_yscale("symlog", linthresh=20.0)
    panel.set_yticks([0, 5, 10, 20, 50, 100], ["0", "5", "10", "20", "50", "100"])
    panel.set_xlabel("mud")
