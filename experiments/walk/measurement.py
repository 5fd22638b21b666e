"""The robot walks over several muds and maps their coefficients, after the paper's sections II-D and III-C.

Each trial is one walk at a fixed depth over all muds. A stride is assigned to the mud in which its plate went down and
slipped, by the position of the body since the start of the trial; without a pose, by the order of the strides. Then
follow short walks at 3 and 5 cm in soft mud, if there is any: the paper shows there that a flipper measures the body's
drag and not the mud's strength while the body moves. Every method of estimation gets the same log.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from math import ceil
from typing import Any

from pandas import DataFrame

from control.records import COEFFICIENTS
from experiments.pictures.mud_layout import MudLayout, layout_of_lengths
from experiments.robot.bench_robot import (
    RAISING_S,
    UNDER_WAY,
    Status,
    WalkMonitor,
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
from experiments.trials.stride_profile import WALK_PERIOD, profile_lists, profile_of, slip_m, thinned, walk_profile
from experiments.walk.known_surface import KNOWN, KNOWN_COMPENSATED, k_s_of
from firmware_host.configuration.configuration import Configuration
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
    def over(self) -> str:
        """The name of the group of walks over all muds."""
        return " ".join(name for name, _ in self.muds)

    @property
    def planned(self) -> list[PlannedTrial]:
        """The walks over all muds, then those at both depths in each soft mud."""
        groups = {"walk": self.over} | {f"soft {name}": name for name, *_ in self.soft_walks}
        return [
            PlannedTrial(f"{key}/{number}", group, number, self.trials)
            for key, group in groups.items()
            for number in range(1, self.trials + 1)
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
    end, _ = follow_walk(robot, partial(monitor_advance, start_m, length_m - reach_m))
    after = wait_until(robot, lambda now: now["mode"] not in UNDER_WAY, RAISING_S, "raising the flippers")
    if after["mode"] != "hold":
        raise InvalidTrialError(mode_reason(after))
    made = count_strides(fetch_strides(robot, before["strides_closed"]))
    log = robot.record(before["now_s"], after["now_s"])
    remarks = [] if start_m is not None else ["no pose arrives: strides are assigned to the muds by their order"]
    entry = _entry(bench, plan, trial, log, before["strides_closed"]) | {
        "start_m": start_m,
        "course": profile_lists(walk_profile(log, plan.flipper, WALK_PERIOD)),
        "remarks": remarks + [end] * bool(end),
    }
    if after["notice"]:
        raise InvalidTrialError(after["notice"], entry)
    if end is None and made < ordered:
        raise InvalidTrialError(f"the walk was stopped by another client in stride {made + 1}", entry)
    return entry


def monitor_advance(start_m: float | None, length_m: float, begun_s: float) -> WalkMonitor[str]:
    """Return what says how a walk ends: empty at the proper end; it raises InvalidTrialError.

    A walk without a position at its start makes all of its strides.
    """
    farthest_m, seen_s, advanced_s = start_m or 0.0, begun_s, begun_s

    def evaluate(status: Status) -> str | None:
        nonlocal farthest_m, seen_s, advanced_s
        now_s, body_m = status["now_s"], status["body_x_m"]
        if start_m is None:
            return None
        if body_m is None:
            if now_s - seen_s > UNSEEN_S:
                raise InvalidTrialError(UNSEEN)
            return None
        seen_s = now_s
        if body_m > farthest_m + ADVANCED_M:
            farthest_m, advanced_s = body_m, now_s
        if body_m - start_m >= length_m and status["phase"] == "insertion":
            return ""
        stuck = now_s - advanced_s > STUCK_S
        return f"the robot got stuck after {100.0 * (farthest_m - start_m):.0f} cm" if stuck else None

    return evaluate


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
    return entry | {"depth_m": depth_m, "course": profile_lists(profile), "remarks": []}


def _entry(bench: Bench, plan: WalkTrials, trial: PlannedTrial, log: Log, closed: int) -> Entry:
    """Return the part of an entry that all walks have: strides by every method. Raises InvalidTrialError."""
    robot, configuration = bench.robot, bench.robot.configuration
    rest(robot)  # on a slow computer, the estimation takes longer than the robot may be left unattended
    strides = strides_by_method(fetch_strides(robot, closed), log, configuration, plan.flipper, METHODS)
    require_mud(strides[configured_method(configuration.estimation)], plan.flipper)
    profiles = [profile_of(log, plan.flipper, stride["t_start_s"]) for stride in strides[DEFAULT]]
    strides[KNOWN] = _with_known_surface(strides[DEFAULT], profiles, configuration, 0.0)
    drag_n = configuration.adaptation.body_drag_n
    strides[KNOWN_COMPENSATED] = _with_known_surface(strides[DEFAULT], profiles, configuration, drag_n)
    slips_m = [slip_m(profile, configuration.geometry.flipper_length_m) for profile in profiles]
    for own in strides.values():  # the strides of all methods begin at the same times
        for stride, own_slip_m in zip(own, slips_m, strict=True):
            stride["slip_m"] = own_slip_m
    return {"trial": trial.number, "strides": strides, "truths": bench.truths(plan.flipper)}


def _with_known_surface(
    strides: Sequence[Entry], profiles: Sequence[DataFrame], configuration: Configuration, drag_n: float
) -> list[Entry]:
    """Return the strides with the k_s that follows from a known surface, and without k_p and k_e."""
    return [
        stride | {"k_p": None, "k_e": None, "k_s": k_s_of(profile, stride, configuration, drag_n)}
        for stride, profile in zip(strides, profiles, strict=True)
    ]
