"""A single flipper on a fixed base strides through muds, after the paper's sections II-C and III-B."""

from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from experiments.flipper.measurement import MUDS, FlipperTrials, run
from experiments.flipper.report import report_of
from experiments.flipper.simulation import flipper_bench
from experiments.flipper.text import result_of
from experiments.reports.mud_names import mud_name
from experiments.study.option import Option
from experiments.study.result import Result
from experiments.study.session import Session
from experiments.trials.mud_trials import SEED, open_bench, require_named, run_trials
from experiments.trials.truth_file import load_truth

INSTRUCTIONS = (
    "Torque is off and the flippers are down. Level the mud to its nominal height and put the flipper over a fresh "
    "spot, or re-mix the mud: the same hole loses 15 to 20 % with each stroke. Take your hands away: the flipper moves "
    "next"
)


def study(
    session: Session,
    *,
    mud: Annotated[tuple[str, ...], Option("as its water in percent")] = (),
    trials: Annotated[int, Option("of each mud", low=1, high=100)] = 3,
    depth: Annotated[float, Option("of insertion", above=0.0, high=20.0, unit="cm")] = 3.0,
    strides: Annotated[int, Option("of each trial", low=1, high=100)] = 1,
    flipper: Annotated[Literal["left", "right"], Option("in the mud")] = "right",
    motors: Annotated[Literal[2, 4], Option("of the simulated robot: 2 for that flipper alone")] = 4,
    truth: Annotated[Path | None, Option("summary.json of a loadcell experiment")] = None,
) -> Result:
    """A single flipper on a fixed base: coefficients of muds."""
    muds = tuple(dict.fromkeys(mud_name(each) for each in mud)) or (MUDS if session.simulated else ())
    require_named(muds, session, "in the order of the trials, --mud 47.6 --mud 49.5")
    plan = FlipperTrials(
        muds=muds,
        trials=trials,
        depth_m=depth / 100.0,
        strides=strides,
        flipper=flipper,
        simulated=session.simulated,
        motors=motors,
    )
    known = load_truth(truth) if truth else None
    simulated = partial(flipper_bench, session.folder, plan.muds, SEED, plan.simulated_rig)
    bench = open_bench(session, plan.identity, lambda trial: INSTRUCTIONS, simulated)
    configuration, entries, logs = run_trials(bench, session, lambda: run(bench, plan, session.show))
    report = report_of(plan, entries, configuration, known, bench.notebook.left_out)
    return result_of(report, plan, entries, configuration, logs)
