"""A trial of the single flipper on a fixed base, after the paper's sections II-C and III-B.

The robot's own daemon makes the strides, at 0.1 m/s with pauses of 3 s for the mud to relax, and reports the
coefficients of each stride. Angles and forces come from its log, and so do the coefficients by the other methods. The
first stride of a trial counts, because the resistance of the same hole falls by 15 to 20 % with each stroke.

Whether the base moved in a trial is seen by its pose, by the loads of the joints in free air, and by the surface.
Before its insertion and after its stride a flipper is at the same position above the mud. The loads of its joints there
should be equal, except for mud that clings to the flipper, which loads the adduction joint alone. A surface that is
found far from its configured height means that the base or the mud is at another height.
"""

import tomllib
from math import isfinite
from typing import Any

import numpy as np
from pandas import DataFrame

from control.modes import Mode
from control.records import Phase
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import arm, rest, walk
from experiments.study.notebook import Entry
from experiments.trials.estimation_methods import DEFAULT, PAPER, configured_method, strides_by_method
from experiments.trials.mud_trials import Bench, InvalidTrialError, PlannedTrial
from experiments.trials.stride_profile import profile_lists, profile_of, stroke_of, thinned
from firmware_host.configuration.configuration import Configuration
from logs.files.log_reader import Log

METHODS = (DEFAULT, PAPER)
SETTLING_S = 0.5  # in free air after the stride
LEAST_N = 0.25  # mean force over the end of a stroke: less is air
PROTOCOL = "single_flipper"
# from which a motion of the base is reported
POSE_M = 0.002
INVALID_M = 0.01  # a tenth of a stance: 10 % of travel and speed, which changes the mud's resistance by 0.6 %
SWEEP_NM = 0.05  # three times the repeatability of the paper's motors at 0.5 N·m
ADDUCTION_NM = 0.25  # 2 N of clinging mud, twice that of the authors' logs
SURFACE_M = 0.01
WINDOW_S = 0.1


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
    require_flipper(flipper, configuration)


def require_flipper(flipper: str, configuration: Configuration) -> None:
    """Raises BenchError for a robot without that flipper."""
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


# the base


def pose_remarks(before_m: float | None, after_m: float | None, bound_m: float = POSE_M) -> list[str]:
    """Describe a motion of the base beyond the bound; return nothing where it is smaller or unknown."""
    if before_m is None or after_m is None or abs(after_m - before_m) <= bound_m:
        return []
    moved = f"{1000.0 * (after_m - before_m):.1f} mm, more than {1000.0 * bound_m:g} mm"
    return [f"the base moved by {moved}: clamp it, and measure again"]


def load_remarks(log: Log, configuration: Configuration, flipper: str) -> list[str]:
    """Compare the loads before the first insertion and at the end of the log, when the robot holds its pose."""
    ticks, stamps_s = log.ticks, log.ticks["stamp_s"]
    inserting = (ticks["mode"] == Mode.WALKING) & (ticks["phase"] == Phase.INSERTION)
    inserted_s = stamps_s[inserting].min(initial=np.inf)
    before = ticks[(stamps_s >= inserted_s - WINDOW_S) & (stamps_s < inserted_s)]
    after = ticks[(ticks["mode"] == Mode.HOLD) & (stamps_s >= stamps_s[-1] - WINDOW_S)]
    if not (len(before) and len(after)):
        return []
    remarks = []
    sweep = log.rig.joints_of(flipper).start
    for joint, bound_nm in ((sweep, SWEEP_NM), (sweep + 1, ADDUCTION_NM)):
        change_a = float(after["current_a"][:, joint].mean() - before["current_a"][:, joint].mean())
        change_nm = abs(configuration.torque_constants_nm_a[joint] * change_a)
        if isfinite(change_nm) and change_nm > bound_nm:
            change = f"{change_nm:.2f} N·m, more than {bound_nm:g} N·m,"
            remarks.append(
                f"the load of {log.rig.joints[joint]} in free air changed by {change}"
                " during the stride: clean the flipper, check that the base is firm, and measure again"
            )
    return remarks


def surface_remarks(stride: dict[str, Any]) -> list[str]:
    surface_m = stride["surface_m"]
    if surface_m is None or abs(surface_m) <= SURFACE_M:
        return []
    where = "below" if surface_m > 0.0 else "above"
    bound = f"more than {1000.0 * SURFACE_M:g} mm"
    return [
        f"the mud was met {1000.0 * abs(surface_m):.0f} mm {where} its nominal height, {bound}: "
        "fill it up to geometry.axis_height_m below the axes, or measure that height again"
    ]
