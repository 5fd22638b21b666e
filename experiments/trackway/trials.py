"""Table I at the bench: a person levels the mud, the robot walks over the trackway, and the pose says how far it came.

After section III-D of the paper. Each trial begins with the sweep axes over the beginning of the first mud; the body's
place there is the trackway's zero. The trials of the gaits alternate, so that mud which dries or softens meanwhile
falls on none of them alone. A walk is stopped where the plates go down behind the last mud, after 90 s in one mud, or
by a fault. One that somebody or a fault has stopped is no trial, unless a person says so. Its strides are read from the
log (log_strides.py), and the table is that of the simulated trackway.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import accumulate
from math import radians, sin
from typing import Any, NamedTuple, Protocol

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
    reported_by,
    wait_until,
)
from experiments.robot.prompt import GO_ON, REDO, SKIP, Operator
from experiments.trackway.comparison import STUCK_S, paper_report
from experiments.trackway.depth_rule import DepthRule
from experiments.trackway.log_strides import walked_strides
from experiments.trackway.paper_table import ADAPTIVE, FIXED_DEPTHS_M
from experiments.trackway.walk import Walk, speed_m_s, walk_of
from experiments.trials.notebook import Notebook
from experiments.trials.session import Show
from firmware_host.configuration.configuration import Configuration
from firmware_host.operator.counted_nouns import counted

PATIENCE_S = 900.0  # for a whole walk
UNSEEN_S = 2.0  # without a pose, before a walk or on it: nobody knows where its end is
BACKWARDS_M = 0.2  # behind the start: no mud pushes a body back so far
LOOK_S = 0.05
BEHIND = ""  # the last mud
UNSEEN = "the body's place is not told any more: see that the robot is seen"
BACKWARDS = "the body's place falls as the robot walks: turn pose.axis, or the sign of metres_per_count, round"
KEEP = "k"
WALKED = {GO_ON: "keep it", REDO: "walk it again", SKIP: "leave it out"}
STOPPED = {GO_ON: "walk it again", KEEP: "keep it", SKIP: "leave it out"}


class Trackway(Protocol):
    """What a person does between two trials."""

    def prepare(self, trial: str) -> BenchRobot:
        """The robot at the start, the mud levelled."""

    def evaluate(self, reported: str, stopped: bool) -> str:
        """GO_ON, SKIP to keep this trial out, or REDO it; `stopped` before its end."""


class AskedTrackway:
    """A Trackway: a person's."""

    def __init__(self, robot: BenchRobot, operator: Operator) -> None:
        self._robot = robot
        self._operator = operator

    def prepare(self, trial: str) -> BenchRobot:
        disarm(self._robot)
        ask_to_clear_faults(self._robot, self._operator)
        question = (
            f"{trial}. Torque is off: level the mud, and put the sweep axes over the beginning of the first mud. Take"
            " the hands away: the robot walks next"
        )
        self._operator.ask(question, {GO_ON: "the robot may walk"}, self._meanwhile)
        ask_to_clear_faults(self._robot, self._operator)
        return self._robot

    def evaluate(self, reported: str, stopped: bool) -> str:
        answer = self._operator.ask(reported, STOPPED if stopped else WALKED, self._meanwhile)
        return {GO_ON: REDO, KEEP: GO_ON}.get(answer, answer) if stopped else answer

    def _meanwhile(self) -> None:
        self._robot.wait(LOOK_S)


@dataclass(frozen=True)
class Mud:
    name: str
    length_m: float


class LoggedTime(NamedTuple):
    """Where a walk is in the logs."""

    run: str  # of a daemon
    from_s: float
    to_s: float


class End(NamedTuple):
    why: str = ""  # nothing at the proper end
    stopped: bool = False  # by somebody or a fault: a walk that comes to nothing is a result


@dataclass(frozen=True)
class LoggedWalk(Walk):
    stopped: bool
    logged: LoggedTime


@dataclass(frozen=True)
class Plan:
    muds: tuple[Mud, ...]
    trials: int = 3  # of each gait, as the paper
    depths_m: tuple[float, ...] = tuple(FIXED_DEPTHS_M.values())

    @property
    def kept(self) -> dict[str, Any]:
        """What may not change where an experiment goes on."""
        return {
            "experiment": "trackway",
            "muds": [[mud.name, mud.length_m] for mud in self.muds],
            "depths_m": list(self.depths_m),
        }

    @property
    def rules(self) -> tuple[DepthRule, ...]:
        """The adaptive one chooses by the method that the robot is configured with."""
        fixed = (DepthRule(f"{100.0 * depth_m:g} cm", depth_m) for depth_m in self.depths_m)
        return (*fixed, DepthRule(ADAPTIVE, 0.0, "configured"))

    def orders(self) -> Iterator[tuple[str, DepthRule]]:
        """By key in the notebook."""
        for trial in range(1, self.trials + 1):
            for rule in self.rules:
                yield f"{rule.name}, trial {trial}", rule

    def mud_at(self, position_m: float) -> str:
        """Where the plates go down; BEHIND the last one, and the first one also before its beginning."""
        ends_m = accumulate(mud.length_m for mud in self.muds)
        return next((mud.name for mud, end_m in zip(self.muds, ends_m, strict=True) if position_m < end_m), BEHIND)


def run(plan: Plan, trackway: Trackway, notebook: Notebook, show: Show) -> dict[str, Any]:
    """The report. Raises BenchError where the robot cannot walk; what was walked is in the notebook."""
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
    verdict = trackway.evaluate(reported_of(trial, walk), walk.stopped)
    if verdict == REDO:
        return
    notebook.write(key, walk.entry | {"arm_m": arm_m, "skipped": verdict == SKIP, "logged": walk.logged})


def walk_over(robot: BenchRobot, plan: Plan, rule: DepthRule) -> LoggedWalk:
    """One trial, from torque on to torque off. Raises BenchError, with torque off where the robot can be reached."""
    _require_place(robot)
    arm(robot)
    before = _require_place(robot)
    start_m = before["body_x_m"]
    robot.call("walk", **({} if rule.method else {"depth_m": rule.depth_m}))
    end = _follow(robot, plan, start_m)
    after = wait_until(robot, lambda now: now["mode"] not in UNDER_WAY, RAISING_S, "raising the flippers")
    if not end.why and after["mode"] != "hold":
        end = End(reported_by(after), stopped=True)
    disarm(robot)
    log = robot.record(before["now_s"], after["now_s"])
    strides = walked_strides(log, robot.configuration, lambda position_m: plan.mud_at(position_m - start_m))
    placed = [stride._replace(position_m=stride.position_m - start_m) for stride in strides]
    logged = LoggedTime(log.metadata["run_id"], before["now_s"], after["now_s"])
    return LoggedWalk(placed, end.why, end.stopped, logged)


def _require_place(robot: BenchRobot) -> Status:
    """The status that tells it. Raises BenchError, with torque off."""
    status: Status = robot.call("status")
    begun_s = status["now_s"]
    while status["body_x_m"] is None:
        if status["now_s"] - begun_s > UNSEEN_S:
            disarm(robot)
            why = status["pose"]["trouble"] or "motion capture or rail encoder tell nothing; see [pose]."
            raise BenchError(f"the body's place is not known: {why} 'mudskipper check' says what to do")
        robot.wait(LOOK_S)
        status = robot.call("status")
    return status


def _follow(robot: BenchRobot, plan: Plan, start_m: float) -> End:
    """Until the walk is over, or has to be stopped."""
    zero_m = start_m - reach_of(robot.configuration)
    end, status = follow_walk(robot, lambda now_s: Progress(plan, zero_m, now_s).evaluate)
    return End(reported_by(status), stopped=True) if end is None else end


def reach_of(configuration: Configuration) -> float:
    """How far in front of the body the plates go down."""
    return configuration.geometry.flipper_length_m * sin(radians(configuration.gait.sweep_angle_deg))


class Progress:
    """Owns which mud the plates go down in, since when, and when the body was seen."""

    def __init__(self, plan: Plan, zero_m: float, now_s: float) -> None:
        """`zero_m`: where the body is when the plates go down at the trackway's beginning."""
        self._plan, self._zero_m = plan, zero_m
        self._mud = plan.muds[0].name
        self._begun_s = self._entered_s = self._seen_s = now_s

    def evaluate(self, status: Status) -> End | None:
        """None while the walk is to go on."""
        now_s, body_m = status["now_s"], status["body_x_m"]
        if body_m is None:
            return End(UNSEEN, stopped=True) if now_s - self._seen_s > UNSEEN_S else None
        self._seen_s = now_s
        plates_m = body_m - self._zero_m
        mud = self._plan.mud_at(plates_m)
        if mud != self._mud:
            self._mud, self._entered_s = mud, now_s
        if mud == BEHIND and status["phase"] == "insertion":
            return End()
        if plates_m < -BACKWARDS_M:
            return End(BACKWARDS, stopped=True)
        stuck = mud != BEHIND and now_s - self._entered_s > STUCK_S or now_s - self._begun_s > PATIENCE_S
        return End(f"stuck in {mud or 'the end'}") if stuck else None


def reported_of(key: str, walk: Walk) -> str:
    """A trial in a line."""
    seen = [stride for stride in walk.strides if stride.step_m == stride.step_m]
    speed = f"{100.0 * speed_m_s(seen):.1f} cm/s" if seen else "no stride with a pose"
    lost = len(walk.strides) - len(seen)
    without = f", {lost} of them without a pose" if lost else ""
    return f"{key}: {counted(len(walk.strides), 'stride')}{without}, {speed}{'; ' + walk.fault if walk.fault else ''}"


def first_walks(plan: Plan, notebook: Notebook) -> dict[str, LoggedTime]:
    """Of each gait the first one that counts, by key in the notebook."""
    first: dict[str, tuple[str, LoggedTime]] = {}
    for key, rule in plan.orders():
        entry = notebook.entries[key]
        if entry["strides"] and not entry["skipped"] and "logged" in entry:
            first.setdefault(rule.name, (key, LoggedTime(*entry["logged"])))
    return dict(first.values())


def report_of(plan: Plan, notebook: Notebook) -> dict[str, Any]:
    """Strides without a place or a length are told of and not counted; nor do those behind the last mud count."""
    walks: dict[str, list[Walk]] = {rule.name: [] for rule in plan.rules}
    ends: dict[str, dict[str, int]] = {rule.name: {} for rule in plan.rules}
    unseen, left_out, arm_m = 0, 0, 0.0
    for key, rule in plan.orders():
        entry = notebook.entries[key]
        if entry["skipped"]:
            left_out += 1
            continue
        walk = walk_of(entry)
        seen = [stride for stride in walk.strides if stride.step_m == stride.step_m]
        unseen, arm_m = unseen + len(walk.strides) - len(seen), entry["arm_m"]
        walks[rule.name].append(Walk([stride for stride in seen if stride.mud != BEHIND], walk.fault))
        end = walk.fault or "past the end"
        ends[rule.name][end] = ends[rule.name].get(end, 0) + 1
    return paper_report(walks, [mud.name for mud in plan.muds], arm_m) | {
        "ends": ends,
        "left_out": left_out,
        "strides_without_place": unseen,
        "settings": {
            "seeds": plan.trials,
            "mud_length_cm": {mud.name: 100.0 * mud.length_m for mud in plan.muds},
            "muds": [asdict(mud) for mud in plan.muds],
        },
    }
