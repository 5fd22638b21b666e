"""The walking robot over several muds, and in soft mud at two depths, after the paper's section III-C.

Its simulated bench has fresh copies of the trackway along one track, and then the soft muds.
"""

from functools import partial
from math import fsum
from typing import Annotated, Literal

from experiments.flipper.measurement import require_flipper
from experiments.reports.mud_names import mud_name
from experiments.robot.lockstep_robot import simulated_configuration
from experiments.studies.flipper import Depth, TruthFile
from experiments.study.notebook import Notebook
from experiments.study.option import Option
from experiments.study.prompt import Operator
from experiments.study.result import Result
from experiments.study.session import Session
from experiments.study.values import MudLengths
from experiments.trackway.bench import muds_of
from experiments.trials.mud_trials import (
    MOST_ATTEMPTS,
    Bench,
    PlannedTrial,
    open_bench,
    require_named,
    run_trials,
)
from experiments.trials.simulated_bed import simulated_bench
from experiments.trials.truth_file import load_truth
from experiments.walk.measurement import MUDS, SOFT, WalkTrials, measure
from experiments.walk.report import result_of
from simulation.mud.clay import clay_of_water
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track

TRACKWAY_INSTRUCTIONS = (
    "Torque is off. Re-mix the surface of all muds and level it to its nominal height, and put the robot so that the "
    "sweep axes are over the beginning of the first mud. Take your hands away: the robot walks next"
)
SOFT_INSTRUCTIONS = (
    "Torque is off. Re-mix and level the soft mud, and put the robot where it has at least 80 cm of it ahead. Take "
    "your hands away: the robot walks next"
)
TAIL_M = 0.5  # the last simulated mud is longer, so that no stride meets the next copy
SOFT_WALK_M, STRIP_M = 2.0, 1000.0  # length for a walk in soft mud, length of each soft mud
SECTIONS = f"[estimation]\nsurface_error_m = {LAB.surface_error_m:.4g}  # as an operator would see it\n"


def study(
    session: Session,
    *,
    mud: MudLengths = (),
    trials: Annotated[int, Option("over the muds", low=1, high=100)] = 3,
    depth: Depth = 3.0,
    soft: Annotated[tuple[str, ...], Option("mud for additional walks at 3 and at 5 cm")] = (),
    flipper: Annotated[Literal["left", "right"], Option("to evaluate")] = "right",
    truth: TruthFile = None,
) -> Result:
    """The walking robot over several muds: their coefficients."""
    muds = muds_of(mud) or (MUDS if session.simulated else ())
    softs = tuple(dict.fromkeys(map(mud_name, soft))) or (SOFT if session.simulated else ())
    names = [name for name, _ in muds]
    require_named(names + list(softs if names else ()), session, "of the track in order, --mud 47.6=61 --mud 49.5=61")
    plan = WalkTrials(
        muds=muds, trials=trials, depth_m=depth / 100.0, soft=softs, flipper=flipper, simulated=session.simulated
    )
    known = load_truth(truth) if truth else None
    simulated = partial(walking_bench, session.operator, plan)
    bench = open_bench(session, plan.identity, _instructions, simulated, partial(require_flipper, flipper))
    return result_of(plan, run_trials(bench, session, plan.planned, partial(measure, bench, plan)), known)


def _instructions(trial: PlannedTrial) -> str:
    return TRACKWAY_INSTRUCTIONS if trial.key.startswith("walk/") else SOFT_INSTRUCTIONS


def walking_bench(operator: Operator, plan: WalkTrials, notebook: Notebook) -> Bench:
    """Make a robot over the plan's muds, named after their water content. Raises ValueError for an unknown mud."""
    lengths_m = [length_m for _, length_m in plan.muds]
    lengths_m[-1] += TAIL_M
    trackway = [
        (length_m, clay_of_water(float(name))) for length_m, (name, _) in zip(lengths_m, plan.muds, strict=True)
    ]
    copies = MOST_ATTEMPTS * plan.trials
    soft = [(STRIP_M, clay_of_water(float(mud))) for mud in plan.soft]
    strips = {name: plan.soft.index(mud) for name, mud, _ in plan.soft_walks}

    def position_m(trial: PlannedTrial, prepared: int) -> float:
        if trial.key.startswith("walk/"):
            return prepared * fsum(lengths_m)
        return copies * fsum(lengths_m) + STRIP_M * strips[trial.group] + SOFT_WALK_M * (prepared + 1)

    return simulated_bench(
        operator, notebook, simulated_configuration(SECTIONS), Track(trackway * copies + soft), position_m
    )
