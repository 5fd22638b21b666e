"""The walking robot over several muds, and in soft mud at two depths, after the paper's section III-C."""

from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from experiments.reports.mud_names import mud_name
from experiments.study.option import Option
from experiments.study.result import Result
from experiments.study.session import Session
from experiments.trackway.bench import Mud, parse_mud, require_own_names
from experiments.trials.mud_trials import SEED, PlannedTrial, open_bench, require_named, run_trials
from experiments.trials.truth_file import load_truth
from experiments.walk.measurement import MUDS, SOFT, WalkTrials, run
from experiments.walk.report import report_of
from experiments.walk.simulation import walking_bench
from experiments.walk.text import result_of

TRACKWAY_INSTRUCTIONS = (
    "Torque is off. Re-mix the surface of all muds and level it to its nominal height, and put the robot so that the "
    "sweep axes are over the beginning of the first mud. Take your hands away: the robot walks next"
)
SOFT_INSTRUCTIONS = (
    "Torque is off. Re-mix and level the soft mud, and put the robot where it has at least 80 cm of it ahead. Take "
    "your hands away: the robot walks next"
)


def study(
    session: Session,
    *,
    mud: Annotated[
        tuple[Mud, ...],
        Option(
            "as its water in percent, and its length (default: 61), in the order of the trackway",
            metavar="NAME[=CM]",
            parse=parse_mud,
        ),
    ] = (),
    trials: Annotated[int, Option("over the muds", low=1, high=100)] = 3,
    depth: Annotated[float, Option("of insertion", above=0.0, high=20.0, unit="cm")] = 3.0,
    soft: Annotated[tuple[str, ...], Option("mud for additional walks at 3 and at 5 cm")] = (),
    flipper: Annotated[Literal["left", "right"], Option("to evaluate")] = "right",
    truth: Annotated[Path | None, Option("summary.json of a loadcell experiment")] = None,
) -> Result:
    """The walking robot over several muds: their coefficients."""
    muds = mud or (MUDS if session.simulated else ())
    softs = tuple(dict.fromkeys(map(mud_name, soft))) or (SOFT if session.simulated else ())
    names = [each.name for each in muds]
    require_named(names + list(softs if names else ()), session, "of the track in order, --mud 47.6=61 --mud 49.5=61")
    require_own_names(muds)
    plan = WalkTrials(
        muds=muds, trials=trials, depth_m=depth / 100.0, soft=softs, flipper=flipper, simulated=session.simulated
    )
    known = load_truth(truth) if truth else None
    bench = open_bench(session, plan.identity, _instructions, partial(walking_bench, session.folder, plan, SEED))
    configuration, entries, logs = run_trials(bench, session, lambda: run(bench, plan, session.show))
    report = report_of(plan, entries, configuration, known, bench.notebook.left_out)
    return result_of(report, plan, entries, configuration, known, logs)


def _instructions(trial: PlannedTrial) -> str:
    return TRACKWAY_INSTRUCTIONS if trial.key.startswith("walk/") else SOFT_INSTRUCTIONS
