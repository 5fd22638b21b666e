"""Table I at the bench: an operator levels the mud, the robot walks over the trackway, and the pose gives its position.

After section III-D of the paper. Each trial begins with the sweep axes over the beginning of the first mud; the body's
position there is the zero of the track. The trials of the gaits alternate, so that a mud that dries or softens with
time affects all gaits alike. A walk is stopped when the plates go down past the last mud, after 90 s in one mud, or by
a fault. A walk that the operator or a fault stopped counts only if the operator says so. Its strides are read from the
log (log_strides.py), and the table is the same as for the simulated trackway.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from math import isfinite, radians, sin
from typing import NamedTuple, Protocol

from experiments.robot.bench_robot import (
    RAISING_S,
    UNDER_WAY,
    BenchError,
    BenchRobot,
    Status,
    arm,
    ask_to_clear_faults,
    disarm,
    follow_walk,
    mode_reason,
    wait_until,
)
from experiments.robot.prompt import GO_ON, REDO, SKIP, Operator
from experiments.trackway.depth_rule import DepthRule
from experiments.trackway.log_strides import walked_strides
from experiments.trackway.paper_table import ADAPTIVE, FIXED_DEPTHS_M
from experiments.trackway.report import Settings, TrackwayReport, table_report
from experiments.trackway.simulation import STUCK_S
from experiments.trackway.walk import Walk, WalkedStride, speed_m_s, walk_of
from experiments.trials.notebook import Notebook
from experiments.trials.session import Show
from firmware_host.configuration.configuration import Configuration
from firmware_host.operator.counted_nouns import counted

PATIENCE_S = 900.0  # longest time of a whole walk
UNSEEN_S = 2.0  # longest time without a pose, before or during a walk: the end of the track is unknown then
BACKWARDS_M = 0.2  # distance behind the start; no mud pushes the body back so far
POLL_S = 0.05  # interval at which the status and the prompt are checked
PAST_END = ""  # name of the mud past the end of the trackway
UNSEEN = "the pose of the body is lost: check that the cameras see the robot's markers"
BACKWARDS = "the measured position falls while the robot walks: reverse pose.axis, or the sign of metres_per_count"
KEEP = "k"
ANSWERS = {GO_ON: "keep it", REDO: "walk it again", SKIP: "leave it out"}
ANSWERS_IF_STOPPED = {GO_ON: "walk it again", KEEP: "keep it", SKIP: "leave it out"}


class Trackway(Protocol):
    """The operator's work between two trials."""

    def prepare(self, trial: str) -> BenchRobot:
        """Return the robot at the start of a levelled track."""

    def evaluate(self, summary: str, stopped: bool) -> str:
        """Return GO_ON to count the trial, SKIP to leave it out, or REDO. `stopped`: it ended early."""


class PromptedTrackway:
    """A Trackway that asks the operator on the terminal."""

    def __init__(self, robot: BenchRobot, operator: Operator) -> None:
        self._robot = robot
        self._operator = operator

    def prepare(self, trial: str) -> BenchRobot:
        disarm(self._robot)
        ask_to_clear_faults(self._robot, self._operator)
        question = (
            f"{trial}. Torque is off: level the mud, and put the sweep axes over the beginning of the first mud. Take"
            " your hands away: the robot walks next"
        )
        self._operator.ask(question, {GO_ON: "the robot may walk"}, self._wait)
        ask_to_clear_faults(self._robot, self._operator)
        return self._robot

    def evaluate(self, summary: str, stopped: bool) -> str:
        answer = self._operator.ask(summary, ANSWERS_IF_STOPPED if stopped else ANSWERS, self._wait)
        return {GO_ON: REDO, KEEP: GO_ON}.get(answer, answer) if stopped else answer

    def _wait(self) -> None:
        self._robot.wait(POLL_S)


@dataclass(frozen=True)
class Mud:
    name: str
    length_m: float


class LoggedTime(NamedTuple):
    """The time of a walk in the logs."""

    run: str  # of the daemon
    from_s: float
    to_s: float


class End(NamedTuple):
    why: str = ""  # empty for a walk that arrived past the last mud
    stopped: bool = False  # by the operator or a fault; a robot that gets stuck is a result, not a stopped walk


@dataclass(frozen=True)
class LoggedWalk(Walk):
    stopped: bool
    logged: LoggedTime


@dataclass(frozen=True)
class BenchSettings(Settings):
    muds: Sequence[Mud]


@dataclass(frozen=True, kw_only=True)
class BenchReport(TrackwayReport):
    settings: BenchSettings
    left_out: int  # trials
    strides_without_position: int = field(metadata={"key": "strides_without_place"})


@dataclass(frozen=True)
class Plan:
    muds: tuple[Mud, ...]
    trials: int = 3  # of each gait, as in the paper
    depths_m: tuple[float, ...] = tuple(FIXED_DEPTHS_M.values())

    @property
    def identity(self) -> dict[str, object]:
        """The settings that must not change when an experiment is continued."""
        return {
            "experiment": "trackway",
            "muds": [[mud.name, mud.length_m] for mud in self.muds],
            "depths_m": list(self.depths_m),
        }

    @property
    def rules(self) -> tuple[DepthRule, ...]:
        """The fixed depths, and the adaptive gait by the method that the robot is configured with."""
        fixed = (DepthRule(f"{100.0 * depth_m:g} cm", depth_m) for depth_m in self.depths_m)
        return (*fixed, DepthRule(ADAPTIVE, 0.0, "configured"))

    def orders(self) -> Iterator[tuple[str, DepthRule]]:
        """Yield each trial's key in the notebook and its rule."""
        for trial in range(1, self.trials + 1):
            for rule in self.rules:
                yield f"{rule.name}, trial {trial}", rule

    def mud_at(self, position_m: float) -> str:
        """Name the mud at a position of the plates: PAST_END after the last, and the first also before the start."""
        ends_m = accumulate(mud.length_m for mud in self.muds)
        return next((mud.name for mud, end_m in zip(self.muds, ends_m, strict=True) if position_m < end_m), PAST_END)


def run(plan: Plan, trackway: Trackway, notebook: Notebook, show: Show) -> BenchReport:
    """Walk every trial that is not in the notebook yet. Raises BenchError where the robot cannot walk."""
    orders = list(plan.orders())
    for done, (key, rule) in enumerate(orders):
        show(done, len(orders))
        while key not in notebook.entries:
            _walk_trial(plan, key, rule, trackway, notebook)
    return report_of(plan, notebook)


def _walk_trial(plan: Plan, key: str, rule: DepthRule, trackway: Trackway, notebook: Notebook) -> None:
    trial = f"{key} of {plan.trials}"
    robot = trackway.prepare(trial)
    arm_m = robot.configuration.geometry.flipper_length_m
    walk = walk_over(robot, plan, rule)
    verdict = trackway.evaluate(trial_text(trial, walk), walk.stopped)
    if verdict == REDO:
        return
    notebook.write(key, walk.entry | {"arm_m": arm_m, "skipped": verdict == SKIP, "logged": walk.logged})


def walk_over(robot: BenchRobot, plan: Plan, rule: DepthRule) -> LoggedWalk:
    """Walk one trial, from torque on to torque off. Raises BenchError, with torque off where the robot answers."""
    _require_pose(robot)
    arm(robot)
    before = _require_pose(robot)
    start_m = before["body_x_m"]
    robot.call("walk", **({} if rule.method else {"depth_m": rule.depth_m}))
    end = _follow(robot, plan, start_m)
    after = wait_until(robot, lambda now: now["mode"] not in UNDER_WAY, RAISING_S, "raising the flippers")
    if not end.why and after["mode"] != "hold":
        end = End(mode_reason(after), stopped=True)
    disarm(robot)
    log = robot.record(before["now_s"], after["now_s"])
    strides = walked_strides(log, robot.configuration, lambda position_m: plan.mud_at(position_m - start_m))
    shifted = [stride._replace(position_m=stride.position_m - start_m) for stride in strides]
    logged = LoggedTime(log.metadata["run_id"], before["now_s"], after["now_s"])
    return LoggedWalk(shifted, end.why, end.stopped, logged)


def _require_pose(robot: BenchRobot) -> Status:
    """Return a status with the body's position. Raises BenchError, with torque off, where there is none."""
    status: Status = robot.call("status")
    begun_s = status["now_s"]
    while status["body_x_m"] is None:
        if status["now_s"] - begun_s > UNSEEN_S:
            disarm(robot)
            why = status["pose"]["trouble"] or "no pose arrives from motion capture or rail encoder; see [pose]."
            raise BenchError(f"the position of the body is not known: {why} 'mudskipper check' says what to do")
        robot.wait(POLL_S)
        status = robot.call("status")
    return status


def _follow(robot: BenchRobot, plan: Plan, start_m: float) -> End:
    """Wait until the walk is over, or stop it."""
    zero_m = start_m - reach_of(robot.configuration)
    end, status = follow_walk(robot, lambda now_s: Progress(plan, zero_m, now_s).evaluate)
    return End(mode_reason(status), stopped=True) if end is None else end


def reach_of(configuration: Configuration) -> float:
    """Return how far in front of the body the plates go down."""
    return configuration.geometry.flipper_length_m * sin(radians(configuration.gait.sweep_angle_deg))


class Progress:
    """Owns the mud that the plates are in, since when, and when the last pose arrived."""

    def __init__(self, plan: Plan, zero_m: float, now_s: float) -> None:
        """`zero_m` is the position of the body at which the plates go down at the beginning of the trackway."""
        self._plan, self._zero_m = plan, zero_m
        self._mud = plan.muds[0].name
        self._begun_s = self._entered_s = self._seen_s = now_s

    def evaluate(self, status: Status) -> End | None:
        """Return None while the walk shall go on, else how it ends."""
        now_s, body_m = status["now_s"], status["body_x_m"]
        if body_m is None:
            return End(UNSEEN, stopped=True) if now_s - self._seen_s > UNSEEN_S else None
        self._seen_s = now_s
        plates_m = body_m - self._zero_m
        mud = self._plan.mud_at(plates_m)
        if mud != self._mud:
            self._mud, self._entered_s = mud, now_s
        if mud == PAST_END and status["phase"] == "insertion":
            return End()
        if plates_m < -BACKWARDS_M:
            return End(BACKWARDS, stopped=True)
        stuck = mud != PAST_END and now_s - self._entered_s > STUCK_S or now_s - self._begun_s > PATIENCE_S
        return End(f"stuck in {mud or 'the end'}") if stuck else None


def trial_text(key: str, walk: Walk) -> str:
    """Summarise a trial in one line."""
    with_pose = _with_pose(walk)
    speed = f"{100.0 * speed_m_s(with_pose):.1f} cm/s" if with_pose else "no stride with a pose"
    lost = len(walk.strides) - len(with_pose)
    lost_text = f", {lost} of them without a pose" if lost else ""
    fault = f"; {walk.fault}" if walk.fault else ""
    return f"{key}: {counted(len(walk.strides), 'stride')}{lost_text}, {speed}{fault}"


def _with_pose(walk: Walk) -> list[WalkedStride]:
    return [stride for stride in walk.strides if isfinite(stride.step_m)]


def first_walks(plan: Plan, notebook: Notebook) -> dict[str, LoggedTime]:
    """Return the first walk of each gait that counts, by its key in the notebook."""
    first: dict[str, tuple[str, LoggedTime]] = {}
    for key, rule in plan.orders():
        entry = notebook.entries[key]
        if entry["strides"] and not entry["skipped"] and "logged" in entry:
            first.setdefault(rule.name, (key, LoggedTime(*entry["logged"])))
    return dict(first.values())


def report_of(plan: Plan, notebook: Notebook) -> BenchReport:
    """Report all trials. Strides without a position or a length are only counted; those past the end are left out."""
    walks: dict[str, list[Walk]] = {rule.name: [] for rule in plan.rules}
    ends: dict[str, Counter[str]] = {rule.name: Counter() for rule in plan.rules}
    without_pose, left_out, arm_m = 0, 0, 0.0
    for key, rule in plan.orders():
        entry = notebook.entries[key]
        if entry["skipped"]:
            left_out += 1
            continue
        walk, arm_m = walk_of(entry), entry["arm_m"]
        located = _with_pose(walk)
        without_pose += len(walk.strides) - len(located)
        walks[rule.name].append(Walk([stride for stride in located if stride.mud != PAST_END], walk.fault))
        ends[rule.name][walk.fault or "past the end"] += 1
    lengths_cm = {mud.name: 100.0 * mud.length_m for mud in plan.muds}
    report = table_report(walks, arm_m, ends, BenchSettings(plan.trials, lengths_cm, plan.muds))
    return BenchReport(**vars(report), left_out=left_out, strides_without_position=without_pose)
