"""The promises of the robot, each checked from the simulated mechanics and the operators' calls.

No promise relies on a monitor of the robot, except to check that it is silent when nothing is wrong. `update` runs
after every tick and yields a text for each broken promise.
"""

from collections.abc import Iterator

from control.controller import SOFT_STOP_S
from control.faults import Clears, FaultKind, Reaction
from control.modes import ENERGISED, HELD, Mode
from control.monitors.encoder_monitor import YIELDING_NM
from control.monitors.joint_monitor import STALLED_S
from control.records import JOINTS, NEVER_S, Phase, Torques
from drivers.fault_injection.failures import MOST_DELAY_S
from firmware_host.fault_monitor import IN_MUD
from simulation.body.plant import END_STOPS_RAD
from simulation.harness.joint_energy import AT_STOP_RAD
from tests.dst.operated_robot import OperatedRobot
from tests.dst.reachability import AFTERMATH_S, WATCHDOG_S, Reachability
from verification.faults.energy_bounds import energy_bounds

ROUNDING_NM = 1e-6  # also of a current that decays exponentially and never is zero
ON_THE_WAY_TICKS = 3  # from a change of mode until the motor obeys
CLAMP_S = 0.01  # after a joint was too fast: the current of the drive's clamp decays
WEAKEST = 0.2  # gain of a motor
STOP_TICKS = 4  # from an accepted request, beyond the time of the stop itself


class Promise:
    """One promise, and its state during a run."""

    def __init__(self, robot: OperatedRobot, reach: Reachability) -> None:
        self.robot = robot
        self.loop = robot.loop
        self.mechanics = robot.lockstep.robot
        self.reach = reach
        self.broken: list[str] = []  # found in the steps of the mechanics since the last tick
        self.begin()
        if type(self).measure is not Promise.measure:
            self.mechanics.observers.append(self.measure)

    def begin(self) -> None:
        """Set the state before the first tick."""

    def measure(self, dt_s: float, torques_nm: Torques) -> None:
        """Observe a step of the mechanics."""

    def update(self) -> Iterator[str]:
        yield from self.broken
        self.broken = []


class NoTorqueWithoutMode(Promise):
    """A motor has no torque in a mode without torque, as soon as a command or its watchdog can reach the drive."""

    def begin(self) -> None:
        self._off_since_s: float | None = None

    def measure(self, dt_s: float, torques_nm: Torques) -> None:
        if self._off_since_s is None:
            return
        off_s = self.mechanics.now_s - self._off_since_s
        for index, torque_nm in enumerate(torques_nm):
            least_nm = self.reach.cogging_nm + ROUNDING_NM + self.reach.half_codes_nm[index]
            if abs(torque_nm) > least_nm and off_s > self.reach.longest_s(index, ON_THE_WAY_TICKS):
                self.broken.append(f"{JOINTS[index]} has {torque_nm:.3f} N·m in mode {self.loop.mode.name.lower()}")

    def update(self) -> Iterator[str]:
        off = self.loop.mode not in ENERGISED or self.robot.ended
        self._off_since_s = (self._off_since_s or self.robot.now_s) if off else None
        return super().update()


class LimitedMotors(Promise):
    """No motor exceeds the torque limit, except where it brakes, and none exceeds the slew rate."""

    def begin(self) -> None:
        limits = self.loop.configuration.limits
        self._largest_nm, self._rate_nm_s = limits.torque_nm, limits.torque_rate_nm_s
        self._least_nm = WEAKEST * self._largest_nm  # less is within the limit for any gain of the motor
        self._torques_nm: Torques | None = None  # one step of the mechanics ago
        drives = self.mechanics.drives
        self._fast_rad_s = [min(limits.velocity_rad_s, each.no_load_rad_s) for each in drives]
        self._before_nm = [drive.torque_nm(self.mechanics.now_s) for drive in drives]  # as commanded
        self._fast_s = [NEVER_S] * len(JOINTS)
        self._changed_s = [self.robot.now_s] * len(JOINTS)

    def measure(self, dt_s: float, torques_nm: Torques) -> None:
        """Check the motors whose torque changed or is large."""
        robot = self.mechanics
        self._torques_nm = self._torques_nm or torques_nm
        for index, torque_nm in enumerate(torques_nm):
            speed_rad_s = robot.plant.velocities_rad_s[index] if torque_nm else 0.0
            if abs(speed_rad_s) > self._fast_rad_s[index]:  # the drive's own clamp brakes it, or its voltage is used up
                self._fast_s[index] = robot.now_s
            if torque_nm != self._torques_nm[index] or abs(torque_nm) > self._least_nm:
                self._check(index, torque_nm, speed_rad_s, robot.now_s)
        self._torques_nm = torques_nm

    def _check(self, index: int, torque_nm: float, speed_rad_s: float, now_s: float) -> None:
        """Check what a motor was commanded: its true torque over the gain of a harmed motor."""
        gain = self.reach.gains[index]
        commanded_nm, rounding_nm = torque_nm / gain, ROUNDING_NM + self.reach.cogging_nm / abs(gain)
        rounding_nm += self.reach.half_codes_nm[index]
        if now_s - self._fast_s[index] > CLAMP_S and not self.reach.is_foreign(index):
            braking = commanded_nm * speed_rad_s < 0.0
            if abs(commanded_nm) > self._largest_nm + rounding_nm and not braking:
                self.broken.append(f"{JOINTS[index]} has {commanded_nm:.3f} N·m of {self._largest_nm:g} N·m")
            self._check_slew(index, commanded_nm, 2.0 * rounding_nm + self.reach.half_codes_nm[index], now_s)
        if abs(commanded_nm - self._before_nm[index]) > rounding_nm:  # cogging is no command
            self._before_nm[index], self._changed_s[index] = commanded_nm, now_s

    def _check_slew(self, index: int, torque_nm: float, rounding_nm: float, now_s: float) -> None:
        """A torque may always fall towards zero; it grows by the slew rate since the command before."""
        before_nm = self._before_nm[index]
        since_s = now_s - self._changed_s[index] + self.reach.bunched_s(index)
        grown_nm = abs(torque_nm) - abs(before_nm) if torque_nm * before_nm > 0.0 else abs(torque_nm)
        if grown_nm > self._rate_nm_s * since_s + rounding_nm:
            step = f"{before_nm:.3f} to {torque_nm:.3f} N·m"
            self.broken.append(f"{JOINTS[index]} goes from {step} within {1e3 * since_s:.1f} ms")


class StopInTime(Promise):
    """After `stop` no joint follows a path for longer than the soft stop."""

    def begin(self) -> None:
        self.since_s: float | None = None

    def update(self) -> Iterator[str]:
        travels = self.loop.mode in (Mode.WALKING, Mode.STOPPING) or self.loop.controller.moving
        if self.robot.accepted("walk", "move"):
            self.since_s = None
        if self.robot.accepted("stop"):
            self.since_s = self.since_s or self.robot.now_s
        elif not travels or self.robot.ended:
            self.since_s = None
        if self.since_s is not None:
            longest_s = SOFT_STOP_S + STOP_TICKS * self.loop.period_s + self.reach.stalled_s
            if self.robot.now_s - self.since_s > longest_s:
                yield f"{self.robot.now_s - self.since_s:.2f} s after stop the robot is {self.loop.mode.name.lower()}"


class DisarmAtOnce(Promise):
    """`disarm` ends every mode with torque in the next tick."""

    def begin(self) -> None:
        self._ticks: int | None = None  # of the loop since the request

    def update(self) -> Iterator[str]:
        if self._ticks is not None:
            self._ticks += 1
            if self.loop.mode in ENERGISED and not self.robot.ended:
                yield f"{self._ticks} ticks after disarm the robot is in mode {self.loop.mode.name.lower()}"
            self._ticks = None
        if self.robot.accepted("disarm"):
            self._ticks = 0


class ArmedByRequest(Promise):
    """Torque comes on only in the tick after an accepted `arm`."""

    def begin(self) -> None:
        self._before = self.loop.mode
        self._requested = False
        self._energised_s = [0.0] * len(JOINTS)

    def update(self) -> Iterator[str]:
        if self._before not in ENERGISED and self.loop.mode in ENERGISED and not self._requested:
            yield f"from {self._before.name.lower()} to {self.loop.mode.name.lower()} without a request to arm"
        self._before = self.loop.mode
        self._requested = self.robot.accepted("arm")
        yield from self._check_drives()

    def _check_drives(self) -> Iterator[str]:
        off = self.loop.mode not in ENERGISED
        for index, drive in enumerate(self.mechanics.drives):
            on = off and drive.energised and not self.reach.is_energised_by_others(index)
            self._energised_s[index] = self._energised_s[index] + self.loop.period_s if on else 0.0
            if self._energised_s[index] > self.reach.longest_idling_s(index):
                yield f"the drive of {JOINTS[index]} stays in closed loop in mode {self.loop.mode.name.lower()}"


class LeaseHeld(Promise):
    """While a program holds the lease, no other one moves the robot, unless it takes the robot over."""

    def update(self) -> Iterator[str]:
        for call in self.robot.calls:
            if call.against_lease and not call.refused:
                yield f"{call.method} is accepted under another program's lease"


class SilentLoop(Promise):
    """No motor drives its joint any longer than its watchdog lasts once no command can reach it, as with SIGSTOP.

    A drive may brake on: a moteus whose watchdog has expired damps. A current that lags decays from then on. A drive
    that others armed is commanded zero, which its protocol may round to half a code.
    """

    LONGEST_S = WATCHDOG_S + MOST_DELAY_S + AFTERMATH_S
    LAGS = 14.0  # time constants in which the largest torque decays to ROUNDING_NM: ln(1e6)

    def measure(self, dt_s: float, torques_nm: Torques) -> None:
        robot = self.mechanics
        silent_s = robot.now_s - self.robot.heard_s
        if silent_s < self.LONGEST_S:
            return
        velocities_rad_s = robot.plant.velocities_rad_s
        for index, torque_nm in enumerate(torques_nm):
            rounded_nm = self.reach.half_codes_nm[index] if self.reach.is_energised_by_others(index) else 0.0
            least_nm = self.reach.cogging_nm + ROUNDING_NM + rounded_nm
            decays = silent_s < self.LONGEST_S + self.LAGS * robot.drives[index].parameters.current_lag_s
            drives = abs(torque_nm) > least_nm and torque_nm * velocities_rad_s[index] > 0.0 and not decays
            if drives and not self.reach.is_foreign(index):
                self.broken.append(f"{JOINTS[index]} is driven with {torque_nm:.3f} N·m although the loop is silent")


class TrueTorque(Promise):
    """A motor that is at least STRONG times as strong as configured is found before it does much work of its own.

    What a right motor would have done with the same commands is its command's work along the true path. The rest is
    bounded for each time that torque is on, and so is the time for which the true torque exceeds what any command of a
    right motor may be: a stride, in which every joint moves through air once, and until a flipper that the mud holds is
    joint_not_following. In mud, whose resistance is unknown, no torque constant shows: there the time alone is bounded,
    but for a recovery, which pulls on purpose.

    A drive with coarse codes of torque hums in its held pose, even with a right motor: a DM10010L, whose codes are
    0.1 N·m apart, by 4 mrad and 3 mW, and with 2.3 times its constant by 11 mrad and 0.1 W. It lasts as long as the
    pose, so a power is allowed there in place of an energy. It is a thirtieth of what a walk takes from four joints.
    """

    STRONG = 2.0
    MOST_J = 0.5
    COARSE_NM, HUM_W = 0.05, 0.1

    def begin(self) -> None:
        self._limit_nm = self.STRONG * self.loop.configuration.limits.torque_nm
        self._longest_s = energy_bounds(self.loop.configuration).stride_s + STALLED_S
        self._reset()

    def _reset(self) -> None:
        self._excess_j, self._lowest_j = [0.0] * len(JOINTS), [0.0] * len(JOINTS)
        self._beyond_s = [0.0] * len(JOINTS)

    def measure(self, dt_s: float, torques_nm: Torques) -> None:
        if max(self.reach.gains) < self.STRONG:
            return
        velocities_rad_s = self.mechanics.plant.velocities_rad_s
        phase = self.loop.controller.target.phase
        for index, (torque_nm, gain) in enumerate(zip(torques_nm, self.reach.gains, strict=True)):
            if gain < self.STRONG or self.reach.is_foreign(index):
                continue
            if self.loop.mode is Mode.HOLD and 2.0 * self.reach.half_codes_nm[index] > self.COARSE_NM:
                self._excess_j[index] -= self.HUM_W * dt_s
            if phase not in IN_MUD:
                self._excess_j[index] += (1.0 - 1.0 / gain) * torque_nm * velocities_rad_s[index] * dt_s
            self._lowest_j[index] = min(self._lowest_j[index], self._excess_j[index])
            if abs(torque_nm) > self._limit_nm and phase is not Phase.RECOVERY:
                self._beyond_s[index] += dt_s

    def update(self) -> Iterator[str]:
        if self.loop.mode not in ENERGISED:
            self._reset()
            return
        for index, joint in enumerate(JOINTS):
            excess_j = self._excess_j[index] - self._lowest_j[index]
            if excess_j > self.MOST_J:
                yield f"{joint} received {excess_j:.2f} J more than from a right motor"
            if self._beyond_s[index] > self._longest_s:
                yield f"{joint} had more than {self._limit_nm:.2f} N·m for {self._beyond_s[index]:.2f} s"


class WithinStops(Promise):
    """No motor presses its joint against the mechanical stop, by its true torque and the joint's true angle.

    An encoder that freezes at zero speed shows only in a torque that changes by more than YIELDING_NM: until then the
    robot cannot distinguish it from a joint that mud holds, and the torque at that time may press the joint.
    """

    PRESSING_NM = 0.3
    LONGEST_S = 0.5
    RELEASED_S = 0.1  # a joint that was free for this long begins again

    def begin(self) -> None:
        self._pressed_s = [0.0] * len(JOINTS)
        self._free_s = [0.0] * len(JOINTS)
        self._frozen_nm: dict[int, tuple[float, float]] = {}  # lowest and highest torque since the encoder froze

    def measure(self, dt_s: float, torques_nm: Torques) -> None:
        if max(torques_nm) < self.PRESSING_NM and min(torques_nm) > -self.PRESSING_NM and not any(self._pressed_s):
            return
        angles_rad = self.mechanics.plant.angles_rad
        for index, (torque_nm, angle_rad) in enumerate(zip(torques_nm, angles_rad, strict=True)):
            inwards_nm = torque_nm if angle_rad > 0.0 else -torque_nm
            pressed = inwards_nm >= self.PRESSING_NM and abs(angle_rad) > END_STOPS_RAD[index % 2] - AT_STOP_RAD
            if pressed and not self.reach.is_foreign(index) and not self._is_hidden(index):
                self._pressed_s[index] += dt_s
                self._free_s[index] = 0.0
            elif self._pressed_s[index]:
                self._free_s[index] += dt_s
                self._pressed_s[index] = self._pressed_s[index] if self._free_s[index] < self.RELEASED_S else 0.0

    def update(self) -> Iterator[str]:
        for joint, pressed_s in zip(JOINTS, self._pressed_s, strict=True):
            if pressed_s > self.LONGEST_S:
                yield f"{joint} is pressed against its stop for {pressed_s:.2f} s"

    def _is_hidden(self, index: int) -> bool:
        if not self.mechanics.drives[index].parameters.encoder_frozen:
            self._frozen_nm.pop(index, None)
            return False
        torque_nm = self.loop.sent.torques_nm[index]
        lowest_nm, highest_nm = self._frozen_nm.get(index, (torque_nm, torque_nm))
        lowest_nm, highest_nm = min(lowest_nm, torque_nm), max(highest_nm, torque_nm)
        self._frozen_nm[index] = lowest_nm, highest_nm
        return abs(torque_nm) < YIELDING_NM or highest_nm - lowest_nm <= YIELDING_NM


class EnergyRise:
    """Owns the largest rise of each joint's energy since the last reset, at the resolution of ticks."""

    def __init__(self, robot: OperatedRobot, reach: Reachability) -> None:
        self._work, self._reach = robot.work, reach
        self.reset()

    def reset(self) -> None:
        self._lowest_j = [joint.work_j for joint in self._work.joints]

    def skip(self, index: int) -> None:
        """Do not count what this joint received up to now."""
        self._lowest_j[index] = self._work.joints[index].work_j

    def largest_j(self) -> tuple[float, str]:
        """Return the largest rise up to now by our torque, and its joint."""
        rises_j = []
        for index, joint in enumerate(self._work.joints):
            if self._reach.is_foreign(index):
                self.skip(index)
            self._lowest_j[index] = min(self._lowest_j[index], joint.work_j)
            rises_j.append((joint.work_j - self._lowest_j[index], JOINTS[index]))
        return max(rises_j)


class LittleEnergy(Promise):
    """While the robot brakes its joints, our torque puts hardly any energy into one.

    The work until the end of the tick that enters DAMPING is that of the commands before, which BoundedEnergy counts:
    after a stall that is all that the last torque did until a watchdog ended it. A joint whose encoder fails gets none,
    but an ODrive brakes one beyond its velocity limit by itself; a motor that turns the wrong way then speeds it up.
    """

    MOST_J = 1.0  # a motor with inverted torque is detected by then

    def begin(self) -> None:
        self._rise = EnergyRise(self.robot, self.reach)
        self._was_damping = False

    def update(self) -> Iterator[str]:
        was_damping, self._was_damping = self._was_damping, self.loop.mode is Mode.DAMPING
        if not (was_damping and self._was_damping):
            self._rise.reset()
            return
        for index, trusted in enumerate(self.loop.fault_monitor.trusted):
            if not trusted:
                self._rise.skip(index)
        energy_j, joint = self._rise.largest_j()
        if energy_j > self.MOST_J:
            yield f"{joint} received {energy_j:.2f} J while damping"


class BoundedEnergy(Promise):
    """After the first failure our torque puts no more energy into a joint than the published bounds allow.

    The bounds are those of the faults that stopped the robot, plus that of the gait for the time on a path.
    """

    def begin(self) -> None:
        self._bounds = energy_bounds(self.loop.configuration)
        self._rise = EnergyRise(self.robot, self.reach)
        self._held_s = self._stopping_j = self._excess_j = 0.0
        self._before_s = self.mechanics.now_s
        self._strongest, self._was_on, self._was_held = 1.0, False, False

    def update(self) -> Iterator[str]:
        now_s = self.mechanics.now_s  # of the mechanics, which go on while the process stands still
        since_s, self._before_s = now_s - self._before_s, now_s
        was_held, self._was_held = self._was_held, self.loop.mode in HELD
        if not self.robot.harmed:
            self._rise.reset()
            return
        self._allow_strong_motors()
        if was_held or self._was_held:
            self._held_s += since_s
        for fault in self.loop.faults.begun:
            if fault.kind.reaction >= Reaction.SOFT_STOP:
                self._stopping_j = max(self._stopping_j, self._bounds.fault_j(fault.kind))
        most_j = self._strongest * (self._bounds.walking_j(self._held_s) + self._stopping_j) + self._excess_j
        energy_j, joint = self._rise.largest_j()
        if energy_j > most_j:
            yield f"{joint} received {energy_j:.2f} J since the first failure, the bound is {most_j:.2f} J"

    def _allow_strong_motors(self) -> None:
        """Scale the bound with motors that are stronger than configured; what air shows has its own bound."""
        strongest, is_on = max(self.reach.gains), self.loop.mode in ENERGISED
        in_mud = self.loop.controller.target.phase in IN_MUD
        self._strongest = max(self._strongest, strongest if in_mud else min(strongest, TrueTorque.STRONG))
        if strongest >= TrueTorque.STRONG and is_on and not self._was_on:
            self._excess_j += TrueTorque.MOST_J
        self._was_on = is_on and strongest >= TrueTorque.STRONG


class NoFalseAlarm(Promise):
    """Nothing stops a robot with which nothing is wrong, except its mud and its operators.

    An operator who disarms it in the middle of an extraction lets the flipper coast out of the mud, up to its stop,
    where its speed jumps.
    """

    EXPECTED = frozenset({FaultKind.LEASE_LOST, FaultKind.FLIPPER_STUCK, FaultKind.JOINT_NOT_FOLLOWING})
    COASTING = frozenset({FaultKind.JOINT_POSITION, FaultKind.JOINT_VELOCITY, FaultKind.ENCODER_JUMP})

    def update(self) -> Iterator[str]:
        if self.robot.harmed:
            return
        for fault in self.loop.faults.begun:
            if fault.kind in self.COASTING and self.loop.mode not in ENERGISED:
                continue
            if fault.kind.reaction >= Reaction.HOLD and fault.kind not in self.EXPECTED:
                yield f"{fault.name} {fault.subject} without a failure"


class NoBug(Promise):
    """No exception escapes, and nothing happens that only a bug can cause."""

    def update(self) -> Iterator[str]:
        if self.robot.bug:
            yield self.robot.bug
        for fault in self.loop.faults.begun:
            if fault.kind.clears is Clears.BY_RESTART:
                yield f"the fault {fault.name}, which only a bug causes"


PROMISES: tuple[type[Promise], ...] = (
    NoTorqueWithoutMode,
    LimitedMotors,
    StopInTime,
    DisarmAtOnce,
    ArmedByRequest,
    LeaseHeld,
    SilentLoop,
    TrueTorque,
    WithinStops,
    LittleEnergy,
    BoundedEnergy,
    NoFalseAlarm,
    NoBug,
)
