"""A single flipper on a fixed base strides through muds, after the paper's sections II-C and III-B.

Its simulated bench is a robot on a fixed base over strips of muds, with the disturbances of a laboratory.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from control.records import TWO_FLIPPERS, Rig
from experiments.flipper.measurement import measure, require_bench
from experiments.flipper.report import result_of
from experiments.reports.mud_names import mud_name
from experiments.robot.lockstep_robot import simulated_configuration
from experiments.study.notebook import Notebook
from experiments.study.option import Option
from experiments.study.prompt import Operator
from experiments.study.result import Result
from experiments.study.session import Session
from experiments.trials.mud_trials import Bench, PlannedTrial, open_bench, require_named, run_trials
from experiments.trials.simulated_bed import simulated_bench
from experiments.trials.trial import BENCH_CURRENT_A, BENCH_TORQUE_NM
from experiments.trials.truth_file import load_truth
from firmware_host.configuration.configuration import Configuration
from simulation.devices.motion_capture_parameters import AT_EVERY_TICK
from simulation.mud.clay import clay_of_water
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track

MUDS = ("47.6", "48.6", "49.5", "50.3", "51.2")  # the paper's, by their water content in percent
INSTRUCTIONS = (
    "Torque is off and the flippers are down. Level the mud to its nominal height and put the flipper over a fresh "
    "spot, or re-mix the mud: the same hole loses 15 to 20 % with each stroke. Take your hands away: the flipper moves "
    "next"
)
TRIAL_M = 0.2  # between the simulated trials in one mud: every stroke is in fresh mud
STRIP_M = 100.0  # of each simulated mud
SECTIONS = f"""\
[gait]
protocol = "single_flipper"

[estimation]
fixed_base = true
surface_error_m = {LAB.surface_error_m:.4g}  # as an operator would see it

[limits]
torque_nm = {BENCH_TORQUE_NM}

[recovery]
lead_deg = 12.0  # reaches that torque with the default stiffness
"""
DRIVE = f"current_limit_a = {BENCH_CURRENT_A}"
Depth = Annotated[float, Option("of insertion", above=0.0, high=20.0, unit="cm")]
TruthFile = Annotated[Path | None, Option("summary.json of a loadcell experiment")]


def study(
    session: Session,
    *,
    mud: Annotated[tuple[str, ...], Option("as its water in percent")] = (),
    trials: Annotated[int, Option("of each mud", low=1, high=100)] = 3,
    depth: Depth = 3.0,
    strides: Annotated[int, Option("of each trial", low=1, high=100)] = 1,
    flipper: Annotated[Literal["left", "right"], Option("in the mud")] = "right",
    motors: Annotated[Literal[2, 4], Option("of the simulated robot: 2 for that flipper alone")] = 4,
    truth: TruthFile = None,
) -> Result:
    """A single flipper on a fixed base: coefficients of muds."""
    muds = tuple(dict.fromkeys(mud_name(each) for each in mud)) or (MUDS if session.simulated else ())
    require_named(muds, session, "in the order of the trials, --mud 47.6 --mud 49.5")
    numbers = range(1, trials + 1)
    planned = [PlannedTrial(f"{each}/{number}", each, number, trials) for each in muds for number in numbers]
    settings = {  # that must be the same when the experiment continues; muds and trials may be added
        "experiment": "flipper",
        "depth_m": depth / 100.0,
        "strides": strides,
        "flipper": flipper,
        "simulated": session.simulated,
    } | ({"motors": motors} if motors == 2 else {})
    known = load_truth(truth) if truth else None
    rig = Rig((flipper,)) if motors == 2 else TWO_FLIPPERS
    simulated = partial(flipper_bench, session.operator, muds=muds, rig=rig)
    bench = open_bench(session, settings, lambda trial: INSTRUCTIONS, simulated, partial(require_bench, flipper))
    measure_trial = partial(measure, bench, flipper, depth / 100.0, strides)
    return result_of(settings, muds, run_trials(bench, session, planned, measure_trial), known)


def bench_configuration(rig: Rig = TWO_FLIPPERS) -> Configuration:
    return simulated_configuration(SECTIONS, DRIVE, rig=rig)


def flipper_bench(operator: Operator, notebook: Notebook, muds: Sequence[str], rig: Rig = TWO_FLIPPERS) -> Bench:
    """Make a robot over strips of muds, named after their water content. Raises ValueError for an unknown mud."""
    track = Track([(STRIP_M, clay_of_water(float(mud))) for mud in muds])

    def position_m(trial: PlannedTrial, prepared: int) -> float:
        return STRIP_M * muds.index(trial.group) + TRIAL_M * (prepared + 1)

    return simulated_bench(operator, notebook, bench_configuration(rig), track, position_m, AT_EVERY_TICK)
