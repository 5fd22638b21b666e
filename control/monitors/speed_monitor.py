"""Compares a joint's angle with its reported speed over seconds: an encoder that slips, a speed in a wrong range.

Angle and speed come from one encoder, so play, friction and mud change both alike. Over every tenth of a second the
angle changes by Δθ and the integral of the speed by W. A straight line through these pairs,

    Δθ = a W + b

has the slope 1 and the offset 0. The codes of a speed that are twice too coarse halve the slope. An encoder whose
magnet or belt slips leaves the slope as it is and adds the offset, at any motion. The sums of the line leak.

An offset comes from rounding as well: one step of a 12-bit code of ±65 rad/s is 0.032 rad/s, and half of it, over the
time constant of the leak, 0.08 rad. A slip of 0.05 rad/s gathers up to 0.25 rad, and passes half of that after 3.5 s.

Two speeds ω determine the path between their messages within |Δω| Δt / 2 only: the speed may change anywhere between
them. Where a recovery throws a rotor through the play of its belt, torques turn at the same place in each interval and
the rotor hits its belt in one direction, so these errors add up, to 0.3 rad in 5 s. What hits may hide is therefore no
slip: their sum is 0 in a walk, and while a joint is rocked up to 0.5 rad without play and 0.9 rad with it. Leaving such
messages out instead would bias the line, as their errors cancel those of the messages near them in every other motion.
"""

from control.faults import Fault, FaultKind

INTERVAL_S = 0.1
SURE_ERRORS = 3.0  # standard errors of the slope: messages that repeat old values scatter it
LEAK_S = 5.0
SLIPPED_RAD = 0.125
LEAST_RAD2 = 0.05  # variance of W that determines the slope: three intervals at 1 rad/s in each direction
WRONG_INTERVALS = 5  # in a row: one interval of a slip bends the line as well, until it is found
WRONG_FRACTION = 0.035  # of the slope: below the 5 % that must be found, and above what late messages cause


class SpeedMonitor:
    """Owns the sums over the intervals."""

    def __init__(self, joint: str) -> None:
        self._joint = joint
        self.reset()

    def reset(self) -> None:
        self._wrong_intervals = 0
        self._count = self._path_rad = self._turned_rad = self._path_rad2 = self._product_rad2 = 0.0
        self._turned_rad2 = self._jumps_rad = 0.0

    def update(self, interval_s: float, path_rad: float, turned_rad: float, jumps_rad: float = 0.0) -> Fault | None:
        """Add an interval of INTERVAL_S: the integral of the speed, the change of the angle, and what hits may hide."""
        kept = 1.0 - interval_s / LEAK_S
        self._count = kept * self._count + 1.0
        self._path_rad = kept * self._path_rad + path_rad
        self._turned_rad = kept * self._turned_rad + turned_rad
        self._path_rad2 = kept * self._path_rad2 + path_rad * path_rad
        self._product_rad2 = kept * self._product_rad2 + path_rad * turned_rad
        self._turned_rad2 = kept * self._turned_rad2 + turned_rad * turned_rad
        self._jumps_rad = kept * self._jumps_rad + jumps_rad
        fault = self._judge()
        if fault:  # the next one needs new evidence: an operator may clear this one
            self.reset()
        return fault

    def _judge(self) -> Fault | None:
        variance_rad2 = self._path_rad2 - self._path_rad * self._path_rad / self._count
        slope, error = 1.0, 0.0
        if variance_rad2 > LEAST_RAD2:
            product_rad2 = self._product_rad2 - self._path_rad * self._turned_rad / self._count
            slope = product_rad2 / variance_rad2
            scatter_rad2 = self._turned_rad2 - self._turned_rad * self._turned_rad / self._count - slope * product_rad2
            error = (max(scatter_rad2, 0.0) / variance_rad2 / max(self._count - 2.0, 1.0)) ** 0.5
        slipped_rad = self._turned_rad - slope * self._path_rad
        if abs(slipped_rad) > SLIPPED_RAD + self._jumps_rad:
            return FaultKind.ENCODER_SLIPS.fault(self._joint, slipped_rad=slipped_rad)
        is_wrong = abs(slope - 1.0) > WRONG_FRACTION + SURE_ERRORS * error
        self._wrong_intervals = self._wrong_intervals + 1 if is_wrong else 0
        if self._wrong_intervals >= WRONG_INTERVALS:
            return FaultKind.SPEED_WRONG.fault(self._joint, factor=1.0 / slope if slope else 0.0)
        return None
