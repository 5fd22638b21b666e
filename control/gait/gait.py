"""The engine that runs a stride's table (stride_table.py): it owns the phase and the time in the stride.

Within a row the speed rises and falls as half a cosine, so joint velocities are continuous and zero where rows meet
(except for a phase that ends early, which stops within a tick).
"""

from math import cos, degrees, fsum, pi, radians, sin
from typing import NamedTuple

from control.gait.stride_table import Begun, stride_table
from control.geometry import FlipperGeometry
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import GaitPath, GaitPhase
from control.records import GaitTarget, Phase

BRIEF_S = 0.01  # of a row that a step may begin and end: longer than any step
RAMP_S = 0.05  # to reach full speed: half the authors' 0.1 s acceleration time, for each end of a phase


class Turn(NamedTuple):
    """A change of the angle at which a swing ends: an additional path over the rest of the swing."""

    start_s: float
    span_rad: float

    def after(self, time_s: float, duration_s: float) -> tuple[float, float]:
        """Return the angle and velocity that it adds to a swing of `duration_s`."""
        fraction, rate = smooth_progress(time_s - self.start_s, duration_s - self.start_s)
        return self.span_rad * fraction, self.span_rad * rate


def smooth_progress(time_s: float, duration_s: float) -> tuple[float, float]:
    """Return the fraction of a path covered after `time_s`, and its rate per second.

    The rate is u(t) = ½ (1 - cos(π t/r)) · v over the first r seconds, v between, and the mirror image at the end,
    with v = 1 / (T - r) so that the whole path takes T. r is RAMP_S, or half of a shorter path.
    """
    if time_s >= duration_s:
        return 1.0, 0.0
    if time_s <= 0.0:
        return 0.0, 0.0
    ramp_s = min(RAMP_S, duration_s / 2.0)
    rate = 1.0 / (duration_s - ramp_s)
    if time_s > duration_s / 2.0:
        fraction, speed = _first_half(duration_s - time_s, ramp_s, rate)
        return 1.0 - fraction, speed
    return _first_half(time_s, ramp_s, rate)


def _first_half(time_s: float, ramp_s: float, rate: float) -> tuple[float, float]:
    if time_s >= ramp_s:
        return rate * (time_s - ramp_s / 2.0), rate
    angle = pi * time_s / ramp_s
    return rate / 2.0 * (time_s - ramp_s / pi * sin(angle)), rate / 2.0 * (1.0 - cos(angle))


class Gait:
    """Owns the phase and the time in the stride.

    The depth of the next stride may be set until its insertion begins. Its parameters may be set until half of the
    preceding swing is over, because that swing ends at the angle where the next stride's sweep begins; after that they
    apply to the stride after the next one. A gait from a file has a path instead, which stays.
    """

    def __init__(self, parameters: GaitParameters, geometry: FlipperGeometry) -> None:
        self._configured = parameters
        self.geometry = geometry
        self.reset(0.0)

    def reset(self, depth_m: float, gait: GaitParameters | GaitPath | None = None, late_s: float = 0.0) -> None:
        """Return to the start of stride 0, at `depth_m`, with this gait or the configured one, `late_s` later."""
        self.path = gait if isinstance(gait, GaitPath) else None
        self.parameters = gait if isinstance(gait, GaitParameters) else self._configured
        self.next_depth_m = depth_m
        self.next_parameters = self._aim = self.parameters
        self.stride = 0
        self._begin_stride()
        self._time_s = -late_s

    def _begin_stride(self) -> None:
        """Begin a stride no deeper than its sweep allows: the depth may have been chosen for another sweep."""
        depth_m = self.next_depth_m
        if self.path is None:
            depth_m = min(depth_m, self.geometry.deepest_m(self._aim.sweep_angle_deg))
        self._tabulate(depth_m)
        self._row = 0
        self._time_s = 0.0
        self._turns: tuple[Turn, ...] = ()
        self._is_checked = True  # the path of the stride, which no phase has left by an early end

    def _tabulate(self, depth_m: float, begun: Begun | None = None) -> None:
        self.commanded_depth_m = depth_m  # of the stride under way
        self._rows = stride_table(self.path or self._aim, self.geometry, depth_m, begun)
        self._before_swing = near = next(i for i, row in enumerate(self._rows) if row.phase is Phase.SWING) - 1
        while near > 0 and self._rows[near].duration_s < BRIEF_S:
            near -= 1
        self._near_swing = near

    @property
    def start(self) -> tuple[float, float]:
        """Sweep and depth at which the stride begins."""
        return self._rows[0].sweep_start_rad, self._rows[0].depth_start_m

    @property
    def swing_is_next(self) -> bool:
        """The swing follows the row under way, in which the flippers come out of the mud."""
        return self._row == self._before_swing

    @property
    def swing_is_near(self) -> bool:
        """A step from the row under way may reach the swing."""
        return self._near_swing <= self._row <= self._before_swing

    def is_choice_due(self, within_s: float, may_turn: bool) -> bool:
        """Return whether the next stride's depth must be set within this time, because the swing ends then.

        If the choice `may_turn` the swing under way to another sweep angle, it is due before half of the swing is over.
        """
        phase, duration_s = self._rows[self._row][:2]
        if phase is not Phase.SWING:
            return False
        left_s = duration_s - self._time_s
        return left_s <= within_s or (may_turn and 0.0 <= left_s - duration_s / 2.0 <= within_s)

    @property
    def waits(self) -> bool:
        """The phase before swing is over, and swing may not begin yet."""
        return self.swing_is_next and self._time_s >= self._rows[self._row].duration_s

    @property
    def conditions(self) -> GaitPhase | None:
        """The phase under way, where a force or a depth may end it early."""
        if self.path is None:
            return None
        phase = self.path.phase[self._rows[self._row].number]
        return None if phase.until_force_n is None and phase.until_depth_m is None else phase

    def step(self, dt_s: float, may_swing: bool = True) -> GaitTarget:
        """Advance by `dt_s`, but not into a swing that may not begin yet.

        The time left over at the end of a phase counts for the next one, so the stride rate does not drift.
        """
        if self.next_parameters is not self._aim and self._rows[self._row].phase is Phase.SWING:
            self._turn()
        self._time_s += dt_s
        while self._time_s >= self._rows[self._row].duration_s:
            if self.swing_is_next and not may_swing:
                self._time_s = self._rows[self._row].duration_s
                break
            self._end_row()
        return self._target()

    def end_phase(self) -> bool:
        """End the phase where it is, an insertion only in the mud; return whether it ended.

        The stride continues at the depth that its insertion reached. The next phase takes its path from here.
        """
        here, row = self._target(), self._rows[self._row]
        inserts = self.path.phase[row.number].name == "insertion" if self.path else row.phase is Phase.INSERTION
        may_end = here.depth_m > 0.0 if inserts else self.path is not None
        if not may_end:
            return False
        depth_m = here.depth_m if inserts else self.commanded_depth_m
        names = {each.number: each.phase for each in self._rows}  # no phase changes its name within a stride
        self._tabulate(depth_m, Begun(row.number + 1, here.sweep_rad, here.depth_m))
        self._rows = tuple(each._replace(phase=names.get(each.number, each.phase)) for each in self._rows)
        self._row = next(i for i, each in enumerate(self._rows) if each.number > row.number)
        self._time_s = 0.0
        self._is_checked = False
        return True

    def _turn(self) -> None:
        if self._time_s > self._rows[self._row].duration_s / 2.0:
            return
        span_rad = radians(self.next_parameters.sweep_angle_deg) - radians(self._aim.sweep_angle_deg)
        self._aim = self.next_parameters
        if span_rad:
            self._turns += (Turn(self._time_s, span_rad),)

    def _end_row(self) -> None:
        left_over_s = self._time_s - self._rows[self._row].duration_s
        self._row += 1
        if self._row == len(self._rows):
            self.stride += 1
            self._begin_stride()
        self._time_s = left_over_s

    def _target(self) -> GaitTarget:
        row = self._rows[self._row]
        fraction, rate = smooth_progress(self._time_s, row.duration_s)
        sweep_rad, depth_m, sweep_rate, depth_rate = row.at(fraction)
        sweep_rad_s, depth_m_s = sweep_rate * rate, depth_rate * rate
        if self._turns:
            added = [turn.after(self._time_s, row.duration_s) for turn in self._turns]
            sweep_rad += fsum(angle_rad for angle_rad, _ in added)
            sweep_rad_s += fsum(velocity_rad_s for _, velocity_rad_s in added)
        if not self._is_checked:
            depth_m = min(depth_m, self.geometry.deepest_m(degrees(sweep_rad)))
        return GaitTarget(row.phase, self.stride, sweep_rad, sweep_rad_s, depth_m, depth_m_s)
