"""The robot walks over several muds and maps their coefficients, after the paper's sections II-D and III-C.

Each trial is one walk at a fixed depth over all muds. A stride is assigned to the mud in which its plate went down and
slipped, by the position of the body since the start of the trial; without a pose, by the order of the strides. Then
follow short walks at 3 and 5 cm in soft mud, if there is any: the paper shows there that a flipper measures the body's
drag and not the mud's strength while the body moves. Every method of estimation gets the same log.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import chain
from math import ceil
from typing import Any

from experiments.pictures.mud_layout import MudLayout, layout_of_lengths
from experiments.reports.error_table import COEFFICIENTS
from experiments.robot.bench_robot import (
    RAISING_S,
    UNDER_WAY,
    Status,
    arm,
    count_strides,
    fetch_strides,
    follow_walk,
    mode_reason,
    rest,
    wait_until,
    walk,
)
from experiments.study.notebook import Entry
from experiments.trackway.bench import UNSEEN, UNSEEN_S, Muds, reach_of
from experiments.trials.estimation_methods import COMPENSATED, DEFAULT, PAPER, configured_method, strides_by_method
from experiments.trials.mud_trials import Bench, InvalidTrialError, PlannedTrial
from experiments.trials.stride_profile import profile_of, profile_of_walk, profile_row, slip_m, thinned
from experiments.walk.known_surface import strides_with_known_surface
from logs.files.log_reader import Log

MUDS: Muds = tuple((name, 0.61) for name in ("47.6", "49.5", "51.2"))  # figure 6 of the paper
# The first is that of figure 7, called 53.8 % there; in simulation the second yields at 3 cm and not at 5 cm.
SOFT = ("53.1", "51.2")
SOFT_DEPTHS_M = (0.03, 0.05)
METHODS = (DEFAULT, PAPER, COMPENSATED)
STUCK_S, ADVANCED_M = 60.0, 0.03  # longest time in which the body advances by less
SLIP_ALLOWANCE = 4  # ordered strides, as a multiple of those of a robot that never slips
DRAWN_STRIDE = 2  # of a walk in soft mud, counted from 0: the first ones start from a standing body


@dataclass(frozen=True)
class WalkTrials:
    muds: Muds = MUDS
    trials: int = 3  # as in the paper
    depth_m: float = 0.03
    soft: tuple[str, ...] = ()  # muds in which to walk at SOFT_DEPTHS_M
    soft_strides: int = 4
    flipper: str = "right"
    simulated: bool = False

    @property
    def identity(self) -> dict[str, Any]:
        """The settings that must not change when an experiment is continued; trials may be added."""
        return {"experiment": "walk"} | {key: value for key, value in asdict(self).items() if key != "trials"}

    @property
    def planned(self) -> list[PlannedTrial]:
        """The walks over all muds, then those at both depths in each soft mud."""
        over = {"walk": " ".join(name for name, _ in self.muds)}
        groups = over | {f"soft {name}": name for name, *_ in self.soft_walks}
        numbers = range(1, self.trials + 1)
        return [
            PlannedTrial(f"{key}/{number}", group, number, self.trials)
            for key, group in groups.items()
            for number in numbers
        ]

    @property
    def soft_walks(self) -> list[tuple[str, str, float]]:
        """The name of each group of walks in soft mud, its mud and its depth."""
        return [(soft_name(mud, depth_m), mud, depth_m) for mud in self.soft for depth_m in SOFT_DEPTHS_M]

    @property
    def layout(self) -> MudLayout:
        return layout_of_lengths(self.muds)


def soft_name(mud: str, depth_m: float) -> str:
    return f"{mud} at {100.0 * depth_m:g} cm"


def measure(bench: Bench, plan: WalkTrials, trial: PlannedTrial) -> Entry:
    """Make one walk. Raises InvalidTrialError, BenchError."""
    depths_m = {name: depth_m for name, _, depth_m in plan.soft_walks}
    if trial.group in depths_m:
        return _walk_in_soft(bench, plan, trial, depths_m[trial.group])
    return _walk_over(bench, plan, trial)


def _walk_over(bench: Bench, plan: WalkTrials, trial: PlannedTrial) -> Entry:
    """Walk until the plates go down past the last mud."""
    robot = bench.robot
    arm(robot, bench.operator)
    before: Status = robot.call("status")
    start_m, reach_m = before["body_x_m"], reach_of(robot.configuration)
    length_m = plan.layout.ends_m[-1]
    ordered = ceil(length_m / (2.0 * reach_m))  # without a pose no more: they cannot lead beyond the end
    ordered *= 1 if start_m is None else SLIP_ALLOWANCE
    robot.call("walk", depth_m=plan.depth_m, strides=ordered)
    end, _ = follow_walk(robot, lambda now_s: Advance(start_m, length_m - reach_m, now_s).evaluate)
    after = wait_until(robot, lambda now: now["mode"] not in UNDER_WAY, RAISING_S, "raising the flippers")
    if after["mode"] != "hold":
        raise InvalidTrialError(mode_reason(after))
    made = count_strides(fetch_strides(robot, before["strides_closed"]))
    log = robot.record(before["now_s"], after["now_s"])
    remarks = [] if start_m is not None else ["no pose arrives: strides are assigned to the muds by their order"]
    entry = _entry(bench, plan, trial, log, before["strides_closed"]) | {
        "start_m": start_m,
        "course": profile_row(profile_of_walk(log, plan.flipper)),
        "remarks": remarks + [end] * bool(end),
    }
    arm_m = robot.configuration.geometry.flipper_length_m
    strides = list(chain.from_iterable(entry["strides"].values()))  # of all methods, which begin at the same times
    starts_s = {stride["t_start_s"] for stride in strides}
    slips_m = {start_s: slip_m(profile_of(log, plan.flipper, start_s), arm_m) for start_s in starts_s}
    for stride in strides:
        stride["slip_m"] = slips_m[stride["t_start_s"]]
    if after["notice"]:
        raise InvalidTrialError(after["notice"], entry)
    if end is None and made < ordered:
        raise InvalidTrialError(f"the walk was stopped by another client in stride {made + 1}", entry)
    return entry


class Advance:
    """Owns the progress of a walk. A walk without a position at its start makes all of its strides."""

    def __init__(self, start_m: float | None, length_m: float, now_s: float) -> None:
        self._start_m = start_m
        self._length_m = length_m
        self._farthest_m = start_m or 0.0
        self._seen_s = self._advanced_s = now_s

    def evaluate(self, status: Status) -> str | None:
        """Return None while the walk goes on, else why it ends; empty at the proper end. Raises InvalidTrialError."""
        now_s, body_m = status["now_s"], status["body_x_m"]
        if self._start_m is None:
            return None
        if body_m is None:
            if now_s - self._seen_s > UNSEEN_S:
                raise InvalidTrialError(UNSEEN)
            return None
        self._seen_s = now_s
        if body_m > self._farthest_m + ADVANCED_M:
            self._farthest_m, self._advanced_s = body_m, now_s
        if body_m - self._start_m >= self._length_m and status["phase"] == "insertion":
            return ""
        if now_s - self._advanced_s > STUCK_S:
            return f"the robot got stuck after {100.0 * (self._farthest_m - self._start_m):.0f} cm"
        return None


def require_mud(strides: Sequence[Mapping[str, Any]], flipper: str) -> None:
    """Raises InvalidTrialError where no stride measured any coefficient."""
    if not strides:
        raise InvalidTrialError(f"the daemon closed no stride of the {flipper} flipper")
    if not any(stride[name]["valid"] for stride in strides for name in COEFFICIENTS):
        raise InvalidTrialError("no stride met mud: measure the height of the axes (geometry.axis_height_m)")


def _walk_in_soft(bench: Bench, plan: WalkTrials, trial: PlannedTrial, depth_m: float) -> Entry:
    robot = bench.robot
    arm(robot, bench.operator)
    before: Status = robot.call("status")
    walked = walk(robot, depth_m, plan.soft_strides)
    log = robot.record(walked.from_s, walked.to_s)
    entry = _entry(bench, plan, trial, log, before["strides_closed"])
    own = entry["strides"][configured_method(robot.configuration.estimation)]
    shown = own[min(DRAWN_STRIDE, len(own) - 1)]
    profile = thinned(profile_of(log, plan.flipper, shown["t_start_s"]))
    return entry | {"depth_m": depth_m, "course": profile_row(profile), "remarks": []}


def _entry(bench: Bench, plan: WalkTrials, trial: PlannedTrial, log: Log, closed: int) -> Entry:
    """Return the part of an entry that all walks have. Raises InvalidTrialError."""
    robot = bench.robot
    rest(robot)  # on a slow computer, the estimation takes longer than the robot may be left unattended
    reported = fetch_strides(robot, closed)
    strides = strides_by_method(reported, log, robot.configuration, plan.flipper, METHODS)
    own = strides[configured_method(robot.configuration.estimation)]
    require_mud(own, plan.flipper)
    strides |= strides_with_known_surface(strides[DEFAULT], log, robot.configuration, plan.flipper)
    return {"trial": trial.number, "strides": strides, "truths": bench.bed.truths(plan.flipper)}
