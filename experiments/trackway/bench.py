"""Table I at the bench: an operator levels the mud, the robot walks over the trackway, and the pose gives its position.

After section III-D of the paper. Each trial begins with the sweep axes over the beginning of the first mud; the body's
position there is the zero of the track. The trials of the gaits alternate, so that a mud that dries or softens with
time affects all gaits alike. A walk is stopped when the plates go down past the last mud, after 90 s in one mud, or by
a fault. The operator decides on each walk; one that the operator or a fault stopped is repeated unless a key keeps it.
The strides are read from the log, and the table is the same as for the simulated trackway.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import isfinite, radians, sin
from typing import NamedTuple

from experiments.reports.counted_nouns import counted
from experiments.reports.mud_names import mud_name
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import (
    RAISING_S,
    UNDER_WAY,
    BenchRobot,
    Status,
    arm,
    disarm,
    follow_walk,
    mode_reason,
    wait_until,
)
from experiments.study.notebook import Entry
from experiments.study.option import OptionError
from experiments.trackway.simulated_walk import STUCK_S
from experiments.trackway.table_one import ADAPTIVE, FIXED_DEPTHS_M, Summary, table_one
from experiments.trackway.walk import Walk, WalkedStride, logged_strides, speed_m_s, walk_of
from experiments.trials.mud_trials import Bench, InvalidTrialError, PlannedTrial
from firmware_host.configuration.configuration import Configuration

PATIENCE_S = 900.0  # longest time of a whole walk
UNSEEN_S = 2.0  # longest time without a pose, before or during a walk: the end of the track is unknown then
BACKWARDS_M = 0.2  # distance before the start; no mud pushes the body back so far
POLL_S = 0.05  # interval at which the status is checked
Muds = tuple[tuple[str, float], ...]  # names, which differ, and lengths in m
PAST_END = ""  # name of the mud past the end of the trackway
UNSEEN = "the pose of the body is lost: check that the cameras see the robot's markers"
REVERSE = "reverse pose.axis, or the sign of metres_per_count"


def muds_of(typed: Sequence[tuple[str, float]]) -> Muds:
    """Return muds whose lengths were typed in cm. Raises OptionError where two have the same name."""
    muds = tuple((mud_name(name), length_cm / 100.0) for name, length_cm in typed)
    if len(dict(muds)) < len(muds):
        raise OptionError("--mud: two muds have the same name; give each its own")
    return muds


class LoggedTime(NamedTuple):
    """The time of a walk in the logs."""

    run: str  # of the daemon
    from_s: float
    to_s: float


class End(NamedTuple):
    why: str = ""  # empty for a walk that arrived past the last mud
    stopped: bool = False  # by the operator or a fault; a robot that gets stuck is a result, not a stopped walk


@dataclass(frozen=True)
class Trackway:
    """The muds of a real trackway, and the trials on it."""

    muds: Muds
    trials: int = 3  # of each gait, as in the paper
    depths_m: tuple[float, ...] = tuple(FIXED_DEPTHS_M.values())

    @property
    def identity(self) -> Entry:
        """The settings that must not change when an experiment is continued."""
        return {
            "experiment": "trackway",
            "muds": self.muds,
            "depths_m": list(self.depths_m),
        }

    @property
    def gaits(self) -> dict[str, dict[str, float]]:
        """By name, what is ordered: a fixed depth, or the method of adaptation that the robot is configured with."""
        return {f"{100.0 * depth_m:g} cm": {"depth_m": depth_m} for depth_m in self.depths_m} | {ADAPTIVE: {}}

    @property
    def planned(self) -> list[PlannedTrial]:
        return [
            PlannedTrial(f"{gait}, trial {number}", gait, number, self.trials)
            for number in range(1, self.trials + 1)
            for gait in self.gaits
        ]

    def mud_at(self, position_m: float) -> str:
        """Name the mud at a position of the plates: PAST_END after the last, and the first also before the start."""
        ends_m = accumulate(length_m for _, length_m in self.muds)
        return next((name for (name, _), end_m in zip(self.muds, ends_m, strict=True) if position_m < end_m), PAST_END)


def measure(bench: Bench, trackway: Trackway, trial: PlannedTrial) -> Entry:
    """Walk one trial, from torque on to torque off. Raises InvalidTrialError for one that was stopped, BenchError."""
    robot = bench.robot
    _require_pose(robot)
    arm(robot, bench.operator)
    before = _require_pose(robot)
    start_m = before["body_x_m"]
    zero_m = start_m - reach_of(robot.configuration)
    robot.call("walk", **trackway.gaits[trial.group])
    end, status = follow_walk(robot, lambda now_s: Progress(trackway, zero_m, now_s).evaluate)
    after = wait_until(robot, lambda now: now["mode"] not in UNDER_WAY, RAISING_S, "raising the flippers")
    if end is None or not end.why and after["mode"] != "hold":
        end = End(mode_reason(after if end else status), stopped=True)
    disarm(robot)
    log = robot.record(before["now_s"], after["now_s"])
    strides = logged_strides(log, robot.configuration, lambda position_m: trackway.mud_at(position_m - start_m))
    walk = Walk([stride._replace(position_m=stride.position_m - start_m) for stride in strides], end.why)
    logged = LoggedTime(log.metadata["run_id"], before["now_s"], after["now_s"])
    if end.stopped:
        raise InvalidTrialError(summary_of(walk), walk.entry | {"logged": logged, "remarks": []})
    return walk.entry | {"logged": logged, "remarks": [summary_of(walk)]}


def _require_pose(robot: BenchRobot) -> Status:
    """Return a status with the body's position. Raises BenchError where there is none."""
    status: Status = robot.call("status")
    begun_s = status["now_s"]
    while status["body_x_m"] is None:
        if status["now_s"] - begun_s > UNSEEN_S:
            why = status["pose"]["trouble"] or "no pose arrives from motion capture or rail encoder; see [pose]."
            raise BenchError(f"the position of the body is not known: {why} 'mudskipper check' says what to do")
        robot.wait(POLL_S)
        status = robot.call("status")
    return status


def reach_of(configuration: Configuration) -> float:
    """Return how far in front of the body the plates go down."""
    return configuration.geometry.flipper_length_m * sin(radians(configuration.gait.sweep_angle_deg))


class Progress:
    """Owns the mud that the plates are in, since when, and when the last pose arrived."""

    def __init__(self, trackway: Trackway, zero_m: float, now_s: float) -> None:
        """`zero_m` is the position of the body at which the plates go down at the beginning of the trackway."""
        self._trackway, self._zero_m = trackway, zero_m
        self._mud = trackway.muds[0][0]
        self._begun_s = self._entered_s = self._seen_s = now_s

    def evaluate(self, status: Status) -> End | None:
        """Return None while the walk shall go on, else how it ends."""
        now_s, body_m = status["now_s"], status["body_x_m"]
        if body_m is None:
            return End(UNSEEN, stopped=True) if now_s - self._seen_s > UNSEEN_S else None
        self._seen_s = now_s
        plates_m = body_m - self._zero_m
        mud = self._trackway.mud_at(plates_m)
        if mud != self._mud:
            self._mud, self._entered_s = mud, now_s
        if mud == PAST_END and status["phase"] == "insertion":
            return End()
        if plates_m < -BACKWARDS_M:
            fell = f"{-100.0 * plates_m:.0f} cm, more than {100.0 * BACKWARDS_M:g} cm, while the robot walked"
            return End(f"the measured position fell by {fell}: {REVERSE}", stopped=True)
        stuck = mud != PAST_END and now_s - self._entered_s > STUCK_S or now_s - self._begun_s > PATIENCE_S
        return End(f"stuck in {mud or 'the end'}") if stuck else None


def summary_of(walk: Walk) -> str:
    located = located_strides(walk)
    speed = f"{100.0 * speed_m_s(located):.1f} cm/s" if located else "no stride with a pose"
    lost = len(walk.strides) - len(located)
    lost_text = f", {lost} of them without a pose" if lost else ""
    fault = f"; {walk.fault}" if walk.fault else ""
    return f"{counted(len(walk.strides), 'stride')}{lost_text}, {speed}{fault}"


def located_strides(walk: Walk) -> list[WalkedStride]:
    """Return the strides with a pose at both ends."""
    return [stride for stride in walk.strides if isfinite(stride.step_m)]


def first_walks(trackway: Trackway, entries: Mapping[str, Entry]) -> dict[str, LoggedTime]:
    """Return the first walk of each gait that counts and has strides, by its key in the notebook."""
    first: dict[str, tuple[str, LoggedTime]] = {}
    for trial in trackway.planned:
        entry = entries.get(trial.key)
        if entry and entry["strides"] and "logged" in entry:
            first.setdefault(trial.group, (trial.key, LoggedTime(*entry["logged"])))
    return dict(first.values())


def report_of(trackway: Trackway, entries: Mapping[str, Entry], arm_m: float) -> Summary:
    """Report the trials that count. Strides without a position are only counted; those past the end are left out."""
    walks: dict[str, list[Walk]] = {gait: [] for gait in trackway.gaits}
    counting = {trial.key: trial.group for trial in trackway.planned if trial.key in entries}
    without_pose = 0
    for key, gait in counting.items():
        walk = walk_of(entries[key])
        located = located_strides(walk)
        without_pose += len(walk.strides) - len(located)
        walks[gait].append(Walk([stride for stride in located if stride.mud != PAST_END], walk.fault))
    ends = {gait: Counter(walk.fault or "past the end" for walk in own) for gait, own in walks.items()}
    settings = {
        "seeds": trackway.trials,
        "mud_length_cm": {name: 100.0 * length_m for name, length_m in trackway.muds},
        "muds": [{"name": name, "length_m": length_m} for name, length_m in trackway.muds],
    }
    return table_one(walks, arm_m, ends, settings) | {
        "left_out": len(trackway.planned) - len(counting),
        "strides_without_position": without_pose,
    }
