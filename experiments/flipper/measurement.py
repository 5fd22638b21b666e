"""A trial of the single flipper on a fixed base, after the paper's sections II-C and III-B.

The robot's own daemon makes the strides, at 0.1 m/s with pauses of 3 s for the mud to relax, and reports the
coefficients of each stride. Angles and forces come from its log, and so do the coefficients by the other methods. The
first stride of a trial counts, because the resistance of the same hole falls by 15 to 20 % with each stroke.
"""

import tomllib

from pandas import DataFrame

from control.records import Phase
from experiments.flipper.base_check import INVALID_M, load_remarks, pose_remarks, surface_remarks
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import arm, rest, walk
from experiments.study.notebook import Entry
from experiments.trials.estimation_methods import DEFAULT, PAPER, configured_method, strides_by_method
from experiments.trials.mud_trials import Bench, InvalidTrialError, PlannedTrial
from experiments.trials.stride_profile import profile_lists, profile_of, stroke_of, thinned
from firmware_host.configuration.configuration import Configuration

METHODS = (DEFAULT, PAPER)
SETTLING_S = 0.5  # in free air after the stride
LEAST_N = 0.25  # mean force over the end of a stroke: less is air
PROTOCOL = "single_flipper"


def require_bench(flipper: str, configuration: Configuration) -> None:
    """Raises BenchError for a robot without that flipper or a fixed base, with the keys to set."""
    protocol = tomllib.loads(configuration.text).get("gait", {}).get("protocol")
    missing = ['gait.protocol = "single_flipper"'] * (protocol != PROTOCOL)
    missing += ["estimation.fixed_base = true"] * (not configuration.estimation.fixed_base)
    if missing:
        raise BenchError(
            f"the daemon is configured for walking: set {' and '.join(missing)} in its configuration, then "
            "'systemctl restart mudskipper'"
        )
    own = configuration.rig.flippers
    if flipper not in own:
        raise BenchError(f"the robot has no {flipper} flipper, rig.flippers is {list(own)}: give --flipper {own[0]}")


def measure(bench: Bench, flipper: str, depth_m: float, number: int, trial: PlannedTrial) -> Entry:
    """Make one trial of a number of strides. Raises InvalidTrialError, BenchError."""
    robot = bench.robot
    arm(robot, bench.operator)
    before_m = robot.call("status")["body_x_m"]
    walked = walk(robot, depth_m, number)
    robot.wait(SETTLING_S)
    after = robot.call("status")
    log = robot.record(walked.from_s, after["now_s"])
    rest(robot)  # on a slow computer, reading the log takes longer than the robot may be left unattended
    strides = strides_by_method(walked.strides, log, robot.configuration, flipper, METHODS)
    own = strides[configured_method(robot.configuration.estimation)]
    if not own:
        raise InvalidTrialError(f"the daemon closed no stride of the {flipper} flipper")
    profile = profile_of(log, flipper, own[0]["t_start_s"])
    require_mud(profile)
    entry: Entry = {
        "mud": trial.group,
        "trial": trial.number,
        "strides": strides,
        "truths": bench.truths(flipper),
        "from_s": walked.from_s,
        "to_s": after["now_s"],
        "course": profile_lists(thinned(profile)),
        "remarks": load_remarks(log, robot.configuration, flipper) + surface_remarks(own[0]),
    }
    for invalid in pose_remarks(before_m, after["body_x_m"], INVALID_M):
        raise InvalidTrialError(invalid, entry)
    entry["remarks"] += pose_remarks(before_m, after["body_x_m"])
    return entry


def require_mud(profile: DataFrame) -> None:
    """Raises InvalidTrialError where neither insertion nor stance met a force over the last third of the stroke."""
    forces_n = stroke_of(profile, Phase.INSERTION)["force_z_n"], stroke_of(profile, Phase.STANCE)["force_x_n"]
    if not any(force_n.iloc[2 * len(force_n) // 3 :].mean() >= LEAST_N for force_n in forces_n):  # NaN is no force
        raise InvalidTrialError(
            "the flipper met no mud: check that it hangs over the mud, and measure the height of its axes "
            "(geometry.axis_height_m)"
        )
