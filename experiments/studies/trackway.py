"""Three muds in a row, walked at fixed and at chosen depths: Table I and figure 8F of the paper.

The report compares each gait with the best that a constant depth could do: the simulated robot walks at every depth in
each mud alone, on an endless track.
"""

from collections import Counter
from dataclasses import asdict
from functools import partial
from math import fsum
from typing import Annotated, Any

from pandas import DataFrame

from control.parameters.adaptation_parameters import Method
from experiments.reports.mud_names import mud_label
from experiments.reports.text_tables import number
from experiments.study.option import Option
from experiments.study.result import Figure, Result, Table
from experiments.study.session import Session
from experiments.study.trials import Trials
from experiments.study.values import MudLengths
from experiments.trackway import bench
from experiments.trackway.figures import walk_figures
from experiments.trackway.plots import draw_trackway
from experiments.trackway.simulated_walk import (
    CONSTANT_STRIDES,
    arm_m,
    best_depth,
    constant_rows,
    end_of,
    mean_speeds_cm_s,
    walk_in_mud,
    walk_trackway,
    walking_world,
    walks_in,
)
from experiments.trackway.table_one import (
    ADAPTIVE,
    FIXED_DEPTHS_M,
    PAPER_TABLE,
    Summary,
    failure_table,
    short_note,
    speed_table,
    table_one,
)
from experiments.trials.mud_trials import open_bench, run_trials
from simulation.mud.clay import MUDS
from simulation.mud.disturbances import TRACKWAY
from simulation.mud.track import COMPARTMENT_M

SCHEMA = 2
TITLE = "The trackway: Table I of the paper"
TRIALS = 3  # of each gait, as in the paper
CONSTANT_SEEDS = 1
PAPERS_MUDS = tuple((name, COMPARTMENT_M) for name in PAPER_TABLE[ADAPTIVE])
INSTRUCTIONS = (
    "Torque is off: level the mud, and put the sweep axes over the beginning of the first mud. Take your hands away: "
    "the robot walks next"
)
WALKS_AND_TABLE = (
    "Left, as in the paper's figure 8: the first walk of each gait. Right: Table I, the paper's three trials as grey "
    "bars and ours as dots, each with one standard deviation."
)
Number = Annotated[int, Option("of each gait", low=1, high=1000, also="--seeds")]


def study(
    walks: Trials,
    *,
    trials: Number = TRIALS,
    method: Annotated[tuple[Method, ...], Option("of adaptation, the first of the adaptive row")] = ("default",),
    compartment: Annotated[
        float, Option("length of each simulated mud", low=0.2, high=100.0, unit="m")
    ] = COMPARTMENT_M,
) -> Result:
    """Three muds in a row, at fixed and at adapted depths."""
    gaits = gaits_of(method)
    seeds, length_m = range(1, trials + 1), compartment * len(MUDS)
    strengths_pa = {mud: clay.strength_pa for mud, clay in MUDS.items()}
    walks.require_same(**walking_world())
    rows = [{"compartment_m": compartment, "seed": seed} | gait for gait in gaits.values() for seed in seeds]
    walked = walks_in(walks.run(walk_trackway, rows))
    by_gait = {name: walked[i * trials : (i + 1) * trials] for i, name in enumerate(gaits)}
    constant = walks.run(walk_in_mud, constant_rows(list(strengths_pa.values()), CONSTANT_SEEDS))
    speeds = {
        mud: mean_speeds_cm_s(constant[constant["strength_pa"] == strength]) for mud, strength in strengths_pa.items()
    }
    settings = {
        "seeds": trials,
        "mud_length_cm": dict.fromkeys(MUDS, 100.0 * compartment),
        "methods": {name: gait["method"] for name, gait in gaits.items() if "method" in gait},
        "strength_pa": strengths_pa,
        "constant_strides": CONSTANT_STRIDES,
        "constant_seeds": CONSTANT_SEEDS,
        "disturbances": asdict(TRACKWAY),
    }
    ends = {
        name: Counter(walk.fault or end_of(walk.strides, length_m) for walk in own) for name, own in by_gait.items()
    }
    report = table_one(by_gait, arm_m(), ends, settings)
    report |= compare_with_best(report["table"], speeds)
    return Result(
        tables=[speed_table(report), failure_table(report), _best_table(report)],
        figures=[Figure("trackway", WALKS_AND_TABLE, partial(draw_trackway, report), "Table I")],
        summary=report,
        title=TITLE,
        notes=short_note(report),
    )


def gaits_of(methods: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Return the parameters of each row of the table: the fixed depths, the first method as "adaptive", the others."""
    first, *others = dict.fromkeys(methods)
    adaptive = {ADAPTIVE: first} | {f"{ADAPTIVE}, {each}": each for each in others}
    fixed = {name: {"depth_m": depth_m} for name, depth_m in FIXED_DEPTHS_M.items()}
    return fixed | {name: {"method": each} for name, each in adaptive.items()}


def compare_with_best(table: Summary, speeds: dict[str, dict[float, float]]) -> Summary:
    """Return each gait's speed over that of the best constant depth. `speeds` are by mud and depth in metres."""
    best = {mud: best_depth(by_depth) for mud, by_depth in speeds.items()}
    return {
        "best_constant_depth": best,
        "best_constant_mean_over_muds": round(fsum(each["mean"] for each in best.values()) / len(best), 3),
        "over_best": {
            gait: {mud: _ratio(cell["mean"], best[mud]["mean"]) for mud, cell in row.items()}
            for gait, row in table.items()
        },
        "constant_depth_cm_s": {
            mud: {f"{100.0 * depth_m:g}": round(speed, 3) for depth_m, speed in by_depth.items()}
            for mud, by_depth in speeds.items()
        },
    }


def _ratio(mean: float | None, best: float) -> float | None:
    return None if mean is None or best <= 0.0 else round(mean / best, 3)


def _best_table(report: Summary) -> Table:
    best, over_best = report["best_constant_depth"], report["over_best"]
    rows = [
        {"": "depth"} | {mud: f"{each['depth_cm']:g} cm" for mud, each in best.items()},
        {"": "speed"} | {mud: f"{each['mean']:.2f} cm/s" for mud, each in best.items()},
    ]
    rows[1]["all muds"] = f"{report['best_constant_mean_over_muds']:.2f} cm/s"
    for gait in report["settings"]["methods"]:
        rows.append({"": f"{gait} over best"} | {mud: number(ratio) for mud, ratio in over_best[gait].items()})
    table = DataFrame(rows).rename(columns=mud_label).fillna("")
    return Table("best", "Best constant depth in each mud alone", {}, table, "Table I")


def robot(
    session: Session,
    *,
    trials: Number = TRIALS,
    mud: MudLengths = (),
) -> Result:
    """Walk the real trackway. Raises BenchError."""
    trackway = bench.Trackway(bench.muds_of(mud) or PAPERS_MUDS, trials)
    robot_bench = open_bench(session, trackway.identity, lambda trial: INSTRUCTIONS)
    measure = partial(bench.measure, robot_bench, trackway)
    configuration, entries, _, logs = run_trials(robot_bench, session, trackway.planned, measure)
    report = bench.report_of(trackway, entries, configuration.geometry.flipper_length_m)
    notes = [f"Trials left out: {report['left_out']}."] if report["left_out"] else []
    if without := report["strides_without_position"]:
        notes.append(f"Strides not counted, because their start or end has no pose: {without}.")
    return Result(
        tables=[speed_table(report), failure_table(report)],
        figures=[
            Figure("trackway", WALKS_AND_TABLE, partial(draw_trackway, report), "Table I"),
            *walk_figures(bench.first_walks(trackway, entries), session.folder, session.operator),
        ],
        summary=report,
        title=TITLE,
        notes=[*notes, *short_note(report)],
        logs=logs,
    )
