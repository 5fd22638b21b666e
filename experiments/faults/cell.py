"""One cell: a fault in one phase, and all that was seen after it, judged.

Ticks are those that the loop made after the cause. The reaction is there when the mode is at least as hard as the
fault's kind demands; where it was that before, and where a fault only stands against arming, when the fault is told.
Torque is what the simulated motors exert. After the cause is gone the robot is watched for a while: nothing may arm it.
"""

from __future__ import annotations

from dataclasses import asdict
from math import radians
from random import Random
from typing import Any

from control.faults import Blocks, FaultKind, Reaction
from control.modes import ENERGISED, Mode, Request
from control.monitors.joint_monitor import REST_S, STILL_RAD
from control.rate import PERIOD_S
from experiments.faults.bench import FaultBench
from experiments.faults.evaluation import LONGEST_STOP_S, Cell, problems
from experiments.faults.injection import BY_NAME, REPORTED_S, Way
from experiments.faults.phases import bench_for, bring

HARDNESS = {  # in arming there is no torque yet
    Mode.BOOT: 4, Mode.IDLE: 4, Mode.FAULT: 4, Mode.DAMPING: 3, Mode.STOPPING: 2, Mode.HOLD: 1, Mode.ARMING: 1,
    Mode.WALKING: 0,
}  # fmt: skip
WATCHDOG_TICKS = 40  # 0.1 s, and one tick on the way to the drive and back
BUG_BOUND_TICKS = 2
FORBIDDEN_TICKS = 80  # two heartbeats: a drive tells that it is in closed loop, and is told again to go idle
ON_THE_WAY_TICKS = 2  # from the loop's torque to the motor's
SLEWING_TICKS = 3  # from full torque one way to the most of damping the other way, at the torques' rate
AFTER_S = 1.0  # to see whether anything comes back
WALKED_ON_S = 0.3  # with a fault that ends nothing


def run_cell(name: str, phase: str, seed: int) -> dict[str, Any]:
    """Everything of it follows from its three arguments."""
    way, random = BY_NAME[name], Random(f"{name} {phase} {seed}")
    joint = random.choice(way.joints(phase))
    cell = Cell(way.fault, name, phase, seed, joint, _reaction_text(way), _bound_ticks(way))
    try:
        _live_through(way, cell, random)
    except Exception as problem:  # noqa: BLE001 - the one thing that must never happen is a cell as any other
        cell.exception = f"{type(problem).__name__}: {problem}"
        cell.why.append(f"an exception escaped: {cell.exception}")
    cell.why = list(dict.fromkeys(problems(cell, way)))
    cell.ok = not cell.why
    return asdict(cell)


def _live_through(way: Way, cell: Cell, random: Random) -> None:
    bench = bench_for(cell.phase, random, hopeless=way.fault == "flipper_stuck")
    bring(bench, cell.phase, random)
    with way.cause(bench, cell.joint):
        watch = Watch(bench, way, cell)
        watch.run(way.lasts_s, until_reported=way.lasts_s == REPORTED_S)
    watch.run_on()


def _reaction_text(way: Way) -> str:
    if way.kind:
        return way.kind.reaction.name.lower()
    return "none" if way.fault == "none" else "drives_idle"


def _bound_ticks(way: Way) -> int | None:
    if way.kind:
        return way.bound_ticks or way.kind.bound_ticks
    return {"none": None, "bug_in_the_tick": BUG_BOUND_TICKS}.get(way.fault, WATCHDOG_TICKS)


class Watch:
    """Owns what is counted after the cause, up to the moment."""

    def __init__(self, bench: FaultBench, way: Way, cell: Cell) -> None:
        self._bench = bench
        self._way = way
        self._cell = cell
        self._steps = 0
        self._first_tick = bench.ticks_made
        self._first_text = len(bench.rows.texts)
        self._mode_before = bench.loop.mode
        self._angles_rad = bench.robot.plant.angles_rad
        self._last_torque_steps = 0
        self._damping_steps = 0
        self._stopping_since: int | None = None
        self._disarmed_steps = 0
        self._missing_rows = bench.ticks_made - bench.rows.ticks
        self._travel_rad = 0.0

    def run(self, duration_s: float, until_reported: bool = False) -> None:
        mode_reason = self._way.kind.bound_ticks * 2 + 10 if until_reported and self._way.kind else 0
        for _ in range(mode_reason or round(duration_s / PERIOD_S)):
            self._step()
            if until_reported and self._cell.reported_ticks is not None:
                return

    def run_on(self) -> None:
        """Until the robot is at rest, and a while longer."""
        kind, loop = self._way.kind, self._bench.loop
        longest = round((LONGEST_STOP_S + 1.0) / PERIOD_S) if kind and kind.reaction >= Reaction.SOFT_STOP else 0
        for _ in range(longest):
            if loop.mode not in ENERGISED:
                break
            self._step()
        self.run(WALKED_ON_S if self._walks_on else AFTER_S)
        self._end()

    @property
    def _walks_on(self) -> bool:
        kind = self._way.kind
        if kind is None:
            return self._way.fault == "none"
        return kind.reaction < Reaction.HOLD and self._cell.phase != "idle"

    def _step(self) -> None:
        self._bench.step()
        self._steps += 1
        self._look_at_loop()
        self._look_at_robot()

    # the loop

    @property
    def _ticks(self) -> int:
        return self._bench.ticks_made - self._first_tick

    def _look_at_loop(self) -> None:
        cell, mode, kind = self._cell, self._bench.loop.mode, self._way.kind
        if kind is not None:
            self._look_for_reported(kind)
            if cell.reaction_ticks is None and self._has_reacted(kind, mode):
                cell.reaction_ticks = self._ticks
        if mode in (Mode.STOPPING, Mode.DAMPING) and self._stopping_since is None:
            self._stopping_since = self._steps
        if mode not in ENERGISED and self._stopping_since is not None and cell.stop_s is None:
            cell.stop_s = (self._steps - self._stopping_since) * PERIOD_S

    def _has_reacted(self, kind: FaultKind, mode: Mode) -> bool:
        """Where the mode has nothing to say it counts that the fault is told."""
        if self._only_reported(kind):
            return self._cell.reported_ticks is not None
        return HARDNESS[mode] >= _needed(kind)

    def _only_reported(self, kind: FaultKind) -> bool:
        """The mode was as hard before, or the fault asks for nothing."""
        return kind.reaction < Reaction.HOLD or HARDNESS[self._mode_before] >= _needed(kind)

    def _look_for_reported(self, kind: FaultKind) -> None:
        if self._cell.reported_ticks is not None:
            return
        loop = self._bench.loop
        if any(fault.kind is kind for fault in loop.faults.present):
            self._cell.reported_ticks = self._ticks
            refusing = self._cell.phase == "idle" and _stands_against_arming(kind)
            if refusing and loop.request(Request.ARM, self._bench.now_s) is None:
                self._cell.why.append("arming was not refused")

    # the robot

    def _look_at_robot(self) -> None:
        cell, bench = self._cell, self._bench
        torque_nm = max(map(abs, bench.torques_nm()))
        cell.peak_torque_nm = max(cell.peak_torque_nm, torque_nm)
        if torque_nm:
            self._last_torque_steps = self._steps
        self._look_at_damping(torque_nm)
        moved = (abs(now - before) for now, before in zip(bench.robot.plant.angles_rad, self._angles_rad, strict=True))
        self._travel_rad = max(self._travel_rad, *moved)
        self._look_at_joints()
        self._look_whether_off(torque_nm)

    def _look_whether_off(self, torque_nm: float) -> None:
        """Once it is off, neither mode nor drives may come back. A request to arm takes a tick to be heeded."""
        off = self._ticks > 0 and self._bench.loop.mode not in ENERGISED or self._bench.dead
        came_back = self._disarmed_steps > 0 and not off
        self._disarmed_steps = self._disarmed_steps + 1 if off else 0
        if came_back or torque_nm and self._disarmed_steps > self._longest_off_ticks or self._rearmed:
            self._cell.disarmed = False

    def _look_at_joints(self) -> None:
        """What may be told of them, since the plant knows it too."""
        plant, configuration = self._bench.robot.plant, self._bench.loop.configuration
        margin_rad = radians(configuration.limits.position_margin_deg)
        true = {"joint_moving"} if max(map(abs, plant.velocities_rad_s)) > STILL_RAD / REST_S else set()
        if max(map(abs, plant.velocities_rad_s)) > configuration.limits.velocity_rad_s:
            true.add("joint_velocity")
        for angle_rad, span in zip(plant.angles_rad, configuration.joint_ranges, strict=True):
            if not span.min_rad - margin_rad <= angle_rad <= span.max_rad + margin_rad:
                true.add("joint_position")
        self._cell.true_too = sorted(true.union(self._cell.true_too))

    @property
    def _rearmed(self) -> bool:
        """Closed loop, for longer than it takes to hear of it and to forbid it."""
        if self._disarmed_steps <= FORBIDDEN_TICKS or self._way.fault == "drive_energised":  # that is the cause itself
            return False
        return any(drive.energised for drive in self._bench.robot.drives)

    @property
    def _longest_off_ticks(self) -> int:
        return WATCHDOG_TICKS if self._way.deaf or self._bench.dead and not self._bench.bug else ON_THE_WAY_TICKS

    def _look_at_damping(self, torque_nm: float) -> None:
        damping = self._bench.loop.mode is Mode.DAMPING
        self._damping_steps = self._damping_steps + 1 if damping else 0
        deaf = self._way.deaf and self._steps <= WATCHDOG_TICKS
        if self._damping_steps > SLEWING_TICKS + ON_THE_WAY_TICKS and not deaf:
            self._cell.damping_torque_nm = max(self._cell.damping_torque_nm, torque_nm)

    def _end(self) -> None:
        cell, bench = self._cell, self._bench
        cell.mode = bench.loop.mode.name.lower()
        texts = bench.rows.texts[self._first_text :]
        cell.reported = list(dict.fromkeys(text.split()[1] for text in texts if text.startswith("fault ")))
        cell.exception = bench.bug
        cell.rows_lost = bench.ticks_made - bench.rows.ticks - self._missing_rows
        if self._steps - self._last_torque_steps > ON_THE_WAY_TICKS:
            cell.zero_torque_ticks = self._last_torque_steps
        if not self._walks_on:
            cell.travel_rad = self._travel_rad
        if self._way.kind is None and self._way.fault != "none":
            cell.reaction_ticks = cell.zero_torque_ticks


def _needed(kind: FaultKind) -> int:
    return max(0, kind.reaction - Reaction.WARN)


def _stands_against_arming(kind: FaultKind) -> bool:
    return kind.blocks is not Blocks.NO or kind.reaction >= Reaction.HOLD
