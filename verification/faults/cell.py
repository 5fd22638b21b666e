"""One cell of the fault matrix: a failure injected in one phase, the measurements after it, and their evaluation.

Ticks are counted by the loop from the injection on. The robot has reacted when its mode is at least as strict as the
fault's kind demands; where the mode was that strict before, or the fault only blocks arming, when the fault is
reported. Torque and energy are those of the simulated motors. After the failure is over, the robot is observed for a
while: nothing may arm it.
"""

from math import radians
from random import Random

from control.faults import Blocks, FaultKind, Reaction
from control.modes import ENERGISED, Mode, Request
from control.monitors.joint_monitor import REST_S, STILL_RAD
from control.rate import PERIOD_S
from drivers.drive_types import DEFAULT
from drivers.fault_injection.failure_table import REPORTED_S, FailureMode
from firmware_host.log.rows import EVENT, EVENT_KIND, TICK_KIND
from simulation.harness.joint_energy import JointEnergy
from verification.faults.energy_bounds import (
    DELAY_TICKS,
    SLEWING_TICKS,
    WATCHDOG_TICKS,
    energy_bound_j,
    pushing_bound_ticks,
)
from verification.faults.evaluation import LONGEST_STOP_S, Cell, problems
from verification.faults.failing_robot import FaultBench
from verification.faults.injection import inject
from verification.faults.phases import bench_for, enter_phase
from verification.faults.protocol_differences import mode_of

STRICTNESS = {  # arming has no torque yet
    Mode.BOOT: 4, Mode.IDLE: 4, Mode.FAULT: 4, Mode.DAMPING: 3, Mode.STOPPING: 2, Mode.HOLD: 1, Mode.ARMING: 1,
    Mode.WALKING: 0,
}  # fmt: skip
BUG_BOUND_TICKS = 2
FORBIDDEN_TICKS = 80  # two heartbeats: a drive reports closed loop and is commanded idle again
AFTER_S = 1.0  # in which nothing may come back
WALKED_ON_S = 0.3  # with a fault that does not stop the robot


def run_cell(mode_name: str, phase: str, seed: int, drive: str = DEFAULT) -> Cell:
    """Run one cell, which depends on nothing but its arguments; `drive` is the type of the robot's drives."""
    mode, random = mode_of(mode_name, drive), Random(f"{mode_name} {phase} {seed}")
    joint = random.choice(mode.joints(phase))
    reaction, bound_ticks = _demanded(mode)
    cell = Cell(
        fault=mode.fault,
        mode_name=mode_name,
        phase=phase,
        seed=seed,
        joint=joint,
        reaction=reaction,
        bound_ticks=bound_ticks,
    )
    try:
        _inject_and_measure(mode, cell, random, drive)
    except Exception as problem:  # noqa: BLE001 - an escaped exception is a result of the cell
        cell.exception = f"{type(problem).__name__}: {problem}"
        cell.why.append(f"an exception escaped: {cell.exception}")
    cell.why = list(dict.fromkeys(problems(cell, mode)))
    cell.ok = not cell.why
    return cell


def _inject_and_measure(mode: FailureMode, cell: Cell, random: Random, drive: str) -> None:
    bench = bench_for(cell.phase, random, hopeless=mode.fault == "flipper_stuck", drive=drive)
    enter_phase(bench, cell.phase, random)
    with inject(bench, mode, cell.joint):
        measurement = Measurement(bench, mode, cell)
        measurement.run(mode.lasts_s, until_reported=mode.lasts_s == REPORTED_S)
    measurement.run_on()


def _demanded(mode: FailureMode) -> tuple[str, int | None]:
    """Return the reaction that the failure demands, and the ticks within which it must come."""
    if mode.fault_kind and mode.demands_reaction:
        return mode.fault_kind.reaction.name.lower(), mode.bound_ticks or mode.fault_kind.bound_ticks
    if mode.ends_loop:
        return "drives_idle", BUG_BOUND_TICKS if mode.raises else WATCHDOG_TICKS
    return "none", None


class Measurement:
    """Owns the counts since the injection."""

    def __init__(self, bench: FaultBench, mode: FailureMode, cell: Cell) -> None:
        self._bench = bench
        self._failure = mode
        self._kind = mode.fault_kind
        self._cell = cell
        self._steps = 0
        self._first_tick = bench.loop_ticks
        self._first_row = len(bench.rows.rows)
        self._strictness = max(0, self._kind.reaction - Reaction.WARN) if self._kind else 0
        self._only_reported = self._kind is not None and (  # the mode was as strict before, or none is demanded
            self._kind.reaction < Reaction.HOLD or STRICTNESS[bench.loop.mode] >= self._strictness
        )
        self._angles_rad = bench.robot.plant.angles_rad
        self._last_torque_steps = 0
        self._damping_steps = 0
        self._stopping_since: int | None = None
        self._disarmed_steps = 0
        self._travel_rad = 0.0
        self._restarted = mode.restarted
        self._walked_s = 0.0
        self._work = JointEnergy(bench.robot, bench.loop.configuration.joint_ranges)

    def run(self, duration_s: float, until_reported: bool = False) -> None:
        most_ticks = self._failure.fault_kind.bound_ticks * 2 + 10 if until_reported and self._failure.fault_kind else 0
        for _ in range(most_ticks or round(duration_s / PERIOD_S)):
            self._step()
            if until_reported and self._cell.reported_ticks is not None:
                return

    def run_on(self) -> None:
        """Measure until the robot is at rest, and for a while longer."""
        self._restarted = False
        kind, loop = self._kind, self._bench.loop
        longest = round((LONGEST_STOP_S + 1.0) / PERIOD_S) if kind and kind.reaction >= Reaction.SOFT_STOP else 0
        for _ in range(longest):
            if loop.mode not in ENERGISED:
                break
            self._step()
        self.run(WALKED_ON_S if self._walks_on else AFTER_S)
        self._end()

    @property
    def _walks_on(self) -> bool:
        if self._kind is None:
            return not self._failure.ends_loop
        return self._kind.reaction < Reaction.HOLD and self._cell.phase != "idle"

    def _step(self) -> None:
        self._bench.step()
        self._steps += 1
        self._measure_loop()
        self._measure_robot()

    # the loop

    @property
    def _ticks(self) -> int:
        return self._bench.loop_ticks - self._first_tick

    def _measure_loop(self) -> None:
        cell, mode = self._cell, self._bench.loop.mode
        if self._kind is not None:
            self._measure_report(self._kind)
            is_reported, is_strict = cell.reported_ticks is not None, STRICTNESS[mode] >= self._strictness
            if cell.reaction_ticks is None and (is_reported if self._only_reported else is_strict):
                cell.reaction_ticks = self._ticks
        if mode in (Mode.STOPPING, Mode.DAMPING) and self._stopping_since is None:
            self._stopping_since = self._steps
        if mode not in ENERGISED and self._stopping_since is not None and cell.stop_s is None:
            cell.stop_s = (self._steps - self._stopping_since) * PERIOD_S

    def _measure_report(self, kind: FaultKind) -> None:
        if self._cell.reported_ticks is not None:
            return
        loop = self._bench.loop
        if any(fault.name in self._failure.names for fault in loop.faults.present):
            self._cell.reported_ticks = self._ticks
            blocks = kind.blocks is not Blocks.NO or kind.reaction >= Reaction.HOLD
            refusing = self._cell.phase == "idle" and blocks
            forced = self._bench.forced if kind.value != self._bench.forced else ""
            if refusing and loop.request(Request.ARM, self._bench.now_s, forced=forced) is None:
                self._cell.why.append("arming was not refused")

    # the robot

    def _measure_robot(self) -> None:
        cell, bench = self._cell, self._bench
        if bench.loop.mode in (Mode.WALKING, Mode.STOPPING):
            self._walked_s += PERIOD_S
        torque_nm = max(map(abs, bench.torques_nm()))
        cell.peak_torque_nm = max(cell.peak_torque_nm, torque_nm)
        if torque_nm:
            self._last_torque_steps = self._steps
        self._measure_damping(torque_nm)
        moved = (abs(now - before) for now, before in zip(bench.robot.plant.angles_rad, self._angles_rad, strict=True))
        self._travel_rad = max(self._travel_rad, *moved)
        self._record_true_faults()
        self._check_torque_off(torque_nm)

    def _check_torque_off(self, torque_nm: float) -> None:
        """Check that mode and drives stay off once torque is off. A request to arm takes effect a tick later."""
        if self._restarted:
            return
        off = self._ticks > 0 and self._bench.loop.mode not in ENERGISED or self._bench.dead
        came_back = self._disarmed_steps > 0 and not off
        self._disarmed_steps = self._disarmed_steps + 1 if off else 0
        if came_back or torque_nm and self._disarmed_steps > self._longest_off_ticks or self._rearmed:
            self._cell.disarmed = False

    def _record_true_faults(self) -> None:
        """Record the faults of joints that are true in the plant as well and may be reported."""
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
        """Return whether a drive is in closed loop for longer than the loop needs to see it and stop it."""
        mode = self._failure
        lost_steps = (
            round(mode.lasts_s / PERIOD_S) if mode.loses_commands and not mode.demands_reaction else 0
        )  # in which it may hear no command
        if self._disarmed_steps <= FORBIDDEN_TICKS or self._steps <= lost_steps + FORBIDDEN_TICKS:
            return False
        if mode.fault == "drive_energised":  # that is the injected failure
            return False
        return any(drive.energised for drive in self._bench.robot.drives)

    @property
    def _longest_off_ticks(self) -> int:
        unreachable = self._failure.loses_commands or self._bench.dead and not self._bench.bug
        return WATCHDOG_TICKS if unreachable else DELAY_TICKS

    def _measure_damping(self, torque_nm: float) -> None:
        damping = self._bench.loop.mode is Mode.DAMPING
        self._damping_steps = self._damping_steps + 1 if damping else 0
        if self._damping_steps > SLEWING_TICKS + self._longest_off_ticks:
            self._cell.damping_torque_nm = max(self._cell.damping_torque_nm, torque_nm)

    def _end(self) -> None:
        cell, bench = self._cell, self._bench
        cell.mode = bench.loop.mode.name.lower()
        rows = bench.rows.rows[self._first_row :]
        texts = [EVENT.decode(row)["text"] for kind, row in rows if kind == EVENT_KIND]
        cell.reported = list(dict.fromkeys(text.split()[1] for text in texts if text.startswith("fault ")))
        cell.exception = bench.bug
        cell.rows_lost = self._ticks - sum(kind == TICK_KIND for kind, _ in rows)
        if self._steps - self._last_torque_steps > DELAY_TICKS:
            cell.zero_torque_ticks = self._last_torque_steps
        cell.energy_j, cell.pushed_ticks = self._work.energy_j, round(self._work.pushed_s / PERIOD_S)
        cell.energy_bound_j = energy_bound_j(bench.loop.configuration, self._failure, cell.reported, self._walked_s)
        cell.pushed_bound_ticks = pushing_bound_ticks(self._failure)
        if not self._walks_on:
            cell.travel_rad = self._travel_rad
        if self._failure.ends_loop:
            cell.reaction_ticks = cell.zero_torque_ticks
