"""Detects a drive that follows other torques than the commanded ones, by the set-point of the current that it reports.

A drive computes its set-point from the newest torque command that it received. So a set-point that lies outside of the
range of the last few commands belongs to another program's command, or to an old one: commands come late or are lost.
In health no report differs. A program that commands every tenth time makes 10 % of them differ, one after every
command of ours half of them, and commands that are 5 to 20 ms late most of them while the torque changes. The score
rises by WEIGHT for a report that differs and falls by 1 for one that does not, so a rate below 1 / (1 + WEIGHT) = 4 %
is never a fault, and 10 % is one after some 80 reports. FOUND is more than five reports alone add.

A set-point of zero is also what a drive reports that left closed loop by itself, before its heartbeat says so. Such
reports count only when the next heartbeat still says closed loop.

A drive may reduce torque near its velocity limit without reporting it. A set-point that this explains does not count.

A drive that reports no set-point may be judged by the torque that it measures, of which only the first of several
reports in a row that differ counts: torque that stays away for a while is missing (control/monitors/joint_monitor.py),
torque that is another one again and again is another program's.

No command of this program exceeds the torque limit. So one set-point that does, by more than the tolerances, is enough:
it belongs to another program, however rarely that sends. A measured torque is no set-point, and may overshoot.
"""

from collections import deque
from math import inf, isfinite, pi

from control.rate import PERIOD_S

TOLERANCE_NM = 0.05  # a drive with compensation of its cogging adds as much
TOLERANCE_FRACTION = 0.2  # two conventions of a torque constant differ by 15.5 %: 8.27 / KV and 9.55 / KV
WEIGHT, FOUND = 24, 125
REPORTS_OF_FOUND = 6  # that differ, as many as one beyond the limit counts
TURN_RAD = 2.0 * pi
SPEED_UP_TURN_S = 0.5  # of a joint at full torque, from one report to the next


class SetpointMonitor:
    """Torques are the motor's. Owns the last commands."""

    def __init__(
        self,
        command_delay_s: float,
        velocity_limit_turn_s: float = inf,
        velocity_gain_nm_s_turn: float = inf,
        tolerance_nm: float = TOLERANCE_NM,
        measured: bool = False,
    ) -> None:
        """The drive may report any command of the last `command_delay_s`, and clamps torque to its velocity limit.

        `measured`: it reports torque and no set-point.
        """
        self._tolerance_nm, self._measured = tolerance_nm, measured
        followed = max(round(command_delay_s / PERIOD_S), 1)  # any of so many commands
        self._commands: deque[float] = deque(maxlen=followed)
        self._clamp_from_rad_s = (velocity_limit_turn_s - SPEED_UP_TURN_S) * TURN_RAD
        self._clamp_nm_s_rad = velocity_gain_nm_s_turn / TURN_RAD
        self.limit_commands(inf)
        self.reset()

    def limit_commands(self, largest_nm: float) -> None:
        """State the largest torque that this program ever commands."""
        self._largest_nm = largest_nm
        tolerance_nm = self._tolerance_nm + TOLERANCE_FRACTION * largest_nm
        self._beyond_nm = inf if self._measured else largest_nm + tolerance_nm

    def reset(self) -> None:
        self.forget_commands()
        self._score = 0
        self._differed = False  # the last report
        self._absent = 0  # reports without torque since the last heartbeat
        self.found = False
        self.example = (0.0, 0.0)  # set-point and command of the last report that differed

    def forget_commands(self) -> None:
        """Accept every set-point until enough commands have been sent: some may not have left."""
        self._newest_nm = inf
        self._commands.extend((inf, -inf) * (self._commands.maxlen or 1))

    def on_command(self, torque_nm: float) -> None:
        self._newest_nm = torque_nm
        self._commands.append(torque_nm)

    def on_report(self, setpoint_nm: float, velocity_rad_s: float) -> None:
        """Compare a report of a drive in closed loop."""
        if not -self._beyond_nm <= setpoint_nm <= self._beyond_nm and isfinite(setpoint_nm):
            forward_rad_s = velocity_rad_s if setpoint_nm < 0.0 else -velocity_rad_s
            if not self._may_clamp(forward_rad_s, self._largest_nm):
                self.example = (setpoint_nm, self._newest_nm)
                self._rise(REPORTS_OF_FOUND)
                return
        difference_nm = setpoint_nm - self._newest_nm
        if -self._tolerance_nm < difference_nm < self._tolerance_nm or self._may_follow(setpoint_nm, velocity_rad_s):
            self._differed = False
            if self._score:
                self._score -= 1
                self.found = self.found and self._score > 0
            return
        again, self._differed = self._differed, True
        if again and self._measured:
            return
        if setpoint_nm == 0.0 or not isfinite(setpoint_nm):
            self._absent += 1
            self.example = (0.0, self._newest_nm)
        else:
            self.example = (setpoint_nm, self._newest_nm)
            self._rise(1)

    def _may_follow(self, setpoint_nm: float, velocity_rad_s: float) -> bool:
        """Return whether the set-point belongs to one of the last commands, or the drive may clamp it."""
        lowest_nm, highest_nm = min(self._commands), max(self._commands)
        largest_nm = max(-lowest_nm, highest_nm)
        tolerance_nm = self._tolerance_nm + TOLERANCE_FRACTION * largest_nm
        if setpoint_nm > highest_nm + tolerance_nm:
            return self._may_clamp(-velocity_rad_s, largest_nm)
        if setpoint_nm < lowest_nm - tolerance_nm:
            return self._may_clamp(velocity_rad_s, largest_nm)
        return True

    def _may_clamp(self, velocity_rad_s: float, torque_nm: float) -> bool:
        """Return whether a drive that turns this fast forward may reduce this torque, down to braking."""
        return (self._clamp_from_rad_s - velocity_rad_s) * self._clamp_nm_s_rad < torque_nm

    def _rise(self, reports: int) -> None:
        self._score = min(self._score + WEIGHT * reports, 2 * FOUND)
        self.found = self.found or self._score >= FOUND

    def problem(self, sign: int) -> str:
        """Return what was found, for people, with the joint's torques; empty while the drive follows its commands."""
        if not self.found:
            return ""
        followed_nm, commanded_nm = (sign * torque_nm for torque_nm in self.example)
        return f"{followed_nm:.3g} N·m where {commanded_nm:.3g} N·m was commanded"

    def on_heartbeat(self, closed_loop: bool) -> None:
        absent, self._absent = self._absent, 0
        if not closed_loop:
            self._score, self.found = 0, False
        elif absent:
            self._rise(absent)
