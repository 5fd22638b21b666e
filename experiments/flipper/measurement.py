"""A single flipper on a fixed base strides through muds, after the paper's sections II-C and III-B: plan and trials.

The robot's own daemon makes the strides, at 0.1 m/s with pauses of 3 s for the mud to relax, and reports the
coefficients of each stride. Angles and forces come from its log, and so do the coefficients by the other methods. The
first stride of a trial counts, because the resistance of the same hole falls by 15 to 20 % with each stroke.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from control.records import TWO_FLIPPERS, Phase, Rig
from experiments.flipper.base_check import INVALID_M, load_remarks, moved_text, pose_remarks, surface_remarks
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import arm, rest, walk
from experiments.study.notebook import Entry
from experiments.study.session import Show
from experiments.trials.estimation_methods import DEFAULT, PAPER, configured_method, strides_by_method
from experiments.trials.mud_trials import Bench, InvalidTrialError, PlannedTrial, conduct_trials
from experiments.trials.stride_profile import Floats, StrideProfile, profile_of, profile_row, thinned
from firmware_host.configuration.configuration import Configuration
from logs.files.log_reader import Log

MUDS = ("47.6", "48.6", "49.5", "50.3", "51.2")  # the paper's, by their water content in percent
METHODS = (DEFAULT, PAPER)
SETTLING_S = 0.5  # in free air after the stride
LEAST_N = 0.25  # mean force over the end of a stroke: less is air
PROTOCOL = "single_flipper"


@dataclass(frozen=True)
class FlipperTrials:
    muds: tuple[str, ...] = MUDS
    trials: int = 3
    depth_m: float = 0.03
    strides: int = 1
    flipper: str = "right"
    simulated: bool = False
    motors: int = len(TWO_FLIPPERS.joints)  # of the simulated robot; with 2, `flipper` is its only one

    @property
    def simulated_rig(self) -> Rig:
        return TWO_FLIPPERS if self.motors == len(TWO_FLIPPERS.joints) else Rig((self.flipper,))

    @property
    def identity(self) -> dict[str, Any]:
        """The settings that must not change when an experiment is continued; muds and trials may be added."""
        rig = {} if self.simulated_rig == TWO_FLIPPERS else {"motors": self.motors}
        return {
            "experiment": "flipper",
            "depth_m": self.depth_m,
            "strides": self.strides,
            "flipper": self.flipper,
            "simulated": self.simulated,
        } | rig

    @property
    def planned(self) -> list[PlannedTrial]:
        return [
            PlannedTrial(f"{mud}/{number}", mud, number, self.trials)
            for mud in self.muds
            for number in range(1, self.trials + 1)
        ]


def require_fixed_base(configuration: Configuration) -> None:
    """Raises BenchError with the keys to set."""
    protocol = tomllib.loads(configuration.text).get("gait", {}).get("protocol")
    missing = ['gait.protocol = "single_flipper"'] * (protocol != PROTOCOL)
    missing += ["estimation.fixed_base = true"] * (not configuration.estimation.fixed_base)
    if missing:
        raise BenchError(
            f"the daemon is configured for walking: set {' and '.join(missing)} in its configuration, then "
            "'systemctl restart mudskipper'"
        )


def require_flipper(configuration: Configuration, flipper: str) -> None:
    """Raises BenchError where the robot has no such flipper."""
    own = configuration.rig.flippers
    if flipper not in own:
        raise BenchError(f"the robot has no {flipper} flipper, rig.flippers is {list(own)}: give --flipper {own[0]}")


def run(bench: Bench, plan: FlipperTrials, show: Show) -> None:
    """Make every trial that is not in the notebook yet. Raises BenchError."""
    require_fixed_base(bench.robot.configuration)
    require_flipper(bench.robot.configuration, plan.flipper)
    conduct_trials(bench, plan.planned, lambda trial: measure(bench, plan, trial), show)


def measure(bench: Bench, plan: FlipperTrials, trial: PlannedTrial) -> Entry:
    """Make one trial. Raises InvalidTrialError, BenchError."""
    robot = bench.robot
    arm(robot, bench.operator)
    before_m = robot.call("status")["body_x_m"]
    walked = walk(robot, plan.depth_m, plan.strides)
    robot.wait(SETTLING_S)
    after = robot.call("status")
    log = robot.record(walked.from_s, after["now_s"])
    rest(robot)  # on a slow computer, reading the log takes longer than the robot may be left unattended
    strides = strides_by_method(walked.strides, log, robot.configuration, plan.flipper, METHODS)
    own = strides[configured_method(robot.configuration.estimation)]
    entry: Entry = {"mud": trial.group, "trial": trial.number, "strides": strides}
    entry |= {"truths": bench.bed.truths(plan.flipper), "from_s": walked.from_s, "to_s": after["now_s"]}
    entry |= _profile_and_remarks(log, own, robot.configuration, plan.flipper)
    invalid = moved_text(before_m, after["body_x_m"], INVALID_M)
    if invalid:
        raise InvalidTrialError(invalid, entry)
    entry["remarks"] += pose_remarks(before_m, after["body_x_m"])
    return entry


def _profile_and_remarks(
    log: Log, own: Sequence[dict[str, Any]], configuration: Configuration, flipper: str
) -> dict[str, Any]:
    """Return the profile of the first stride, and remarks for the operator. Raises InvalidTrialError."""
    if not own:
        raise InvalidTrialError(f"the daemon closed no stride of the {flipper} flipper")
    profile = profile_of(log, flipper, own[0]["t_start_s"])
    require_mud(profile)
    remarks = load_remarks(log, configuration, flipper) + surface_remarks(own[0])
    return {"course": profile_row(thinned(profile)), "remarks": remarks}


def require_mud(profile: StrideProfile) -> None:
    """Raises InvalidTrialError where neither insertion nor stance met a force."""
    insertion_n = _late_mean_n(profile.force_z_n, profile.during(Phase.INSERTION))
    stance_n = _late_mean_n(profile.force_x_n, profile.during(Phase.STANCE))
    if max(insertion_n, stance_n) < LEAST_N:
        raise InvalidTrialError(
            "the flipper met no mud: check that it hangs over the mud, and measure the height of its axes "
            "(geometry.axis_height_m)"
        )


def _late_mean_n(force_n: Floats, rows: NDArray[np.bool_]) -> float:
    """Average over the last third of a stroke."""
    late = force_n[rows][2 * int(rows.sum()) // 3 :]
    late = late[np.isfinite(late)]
    return float(late.mean()) if len(late) else 0.0
