"""The crutching gait (paper, section II-A): insertion, stance, extraction, swing, as a table of phases.

Both flippers follow the same target. The edge goes down at the front of the sweep, holds its depth through the
stance while the flipper sweeps back, comes up at the back and swings forward above the mud. A phase's duration is
its path length over its speed, as in the authors' controller, so stride times equal theirs; within a phase the
speed rises and falls as half a cosine, so joint velocities are continuous and zero where phases meet (except for an
insertion that ends early, which stops within a tick).
"""

from math import cos, fsum, pi, radians, sin
from typing import NamedTuple

from control.geometry import FlipperGeometry
from control.parameters.gait_parameters import GaitParameters
from control.records import GaitTarget, Phase

RAMP_S = 0.05  # to reach full speed: half the authors' 0.1 s acceleration time, for each end of a phase

# Section II-B of the paper's experiments with a fixed base: slow everywhere, the mud relaxes between phases.
SINGLE_FLIPPER = GaitParameters(
    stance_speed_m_s=0.1, extraction_speed_m_s=0.1, swing_speed_m_s=0.1, swing_duration_s=0.0, pause_s=3.0
)
# A walk that measures k_e. The quick extraction of `walking` (89 ms at 3 cm) spends more torque on accelerating the arm
# than on the mud. Right after a stance the sweep lags and catches up in the extraction, which takes less torque at
# first (docs/explanation/accuracy.md).
MEASURING = GaitParameters(extraction_speed_m_s=0.2, pause_s=0.5)
PROTOCOLS = {"walking": GaitParameters(), "measuring": MEASURING, "single_flipper": SINGLE_FLIPPER}


class PhaseRow(NamedTuple):
    phase: Phase
    duration_s: float
    sweep_start_rad: float
    sweep_end_rad: float
    depth_start_m: float
    depth_end_m: float


class Turn(NamedTuple):
    """A change of the angle at which a swing ends: an additional path over the rest of the swing."""

    start_s: float
    span_rad: float

    def after(self, time_s: float, duration_s: float) -> tuple[float, float]:
        """Return the angle and velocity that it adds to a swing of `duration_s`."""
        fraction, rate = smooth_progress(time_s - self.start_s, duration_s - self.start_s)
        return self.span_rad * fraction, self.span_rad * rate


def stride_table(gait: GaitParameters, geometry: FlipperGeometry, depth_m: float) -> tuple[PhaseRow, ...]:
    """Return the phases of one stride at `depth_m` below the nominal surface, in time order."""
    front = radians(gait.sweep_angle_deg)
    raised_m = -geometry.clearance_m
    travel_m = depth_m - raised_m
    stance_s = _arc_m(gait, geometry) / gait.stance_speed_m_s
    rows = (
        PhaseRow(Phase.INSERTION, travel_m / gait.insertion_speed_m_s, front, front, raised_m, depth_m),
        PhaseRow(Phase.PAUSE, gait.pause_s, front, front, depth_m, depth_m),
        PhaseRow(Phase.STANCE, stance_s, front, -front, depth_m, depth_m),
        PhaseRow(Phase.PAUSE, gait.pause_s, -front, -front, depth_m, depth_m),
        PhaseRow(Phase.EXTRACTION, travel_m / gait.extraction_speed_m_s, -front, -front, depth_m, raised_m),
        PhaseRow(Phase.PAUSE, gait.pause_s, -front, -front, raised_m, raised_m),
        PhaseRow(Phase.SWING, swing_duration_s(gait, geometry), -front, front, raised_m, raised_m),
    )
    return tuple(row for row in rows if row.duration_s > 0.0)


def swing_duration_s(gait: GaitParameters, geometry: FlipperGeometry) -> float:
    return gait.swing_duration_s or _arc_m(gait, geometry) / gait.swing_speed_m_s


def _arc_m(gait: GaitParameters, geometry: FlipperGeometry) -> float:
    return 2.0 * radians(gait.sweep_angle_deg) * geometry.flipper_length_m


def full_step_m(gait: GaitParameters, geometry: FlipperGeometry) -> float:
    """Return the body's step in one stride if the plates stand still in the mud."""
    return 2.0 * geometry.flipper_length_m * sin(radians(gait.sweep_angle_deg))


def stride_duration_s(gait: GaitParameters, geometry: FlipperGeometry, depth_m: float) -> float:
    return fsum(row.duration_s for row in stride_table(gait, geometry, depth_m))


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

    The depth of the next stride may be set until its insertion begins. Its gait may be set until half of the preceding
    swing is over, because that swing ends at the angle where the next stride's sweep begins; after that it applies to
    the stride after the next one.
    """

    def __init__(self, parameters: GaitParameters, geometry: FlipperGeometry) -> None:
        self.parameters = parameters
        self.geometry = geometry
        self.reset(0.0)

    def reset(self, depth_m: float) -> None:
        """Return to the start of stride 0, at `depth_m` and with the gait's own parameters."""
        self.next_depth_m = depth_m
        self.next_parameters = self._aim = self.parameters
        self.stride = 0
        self._begin_stride()

    def _begin_stride(self) -> None:
        """Begin a stride no deeper than its sweep allows: the depth may have been chosen for another sweep."""
        depth_m = min(self.next_depth_m, self.geometry.deepest_m(self._aim.sweep_angle_deg))
        self._rows = stride_table(self._aim, self.geometry, depth_m)
        self._row = 0
        self._time_s = 0.0
        self._turns: tuple[Turn, ...] = ()

    @property
    def commanded_depth_m(self) -> float:
        """The insertion depth of the stride under way."""
        return self._rows[0].depth_end_m

    @property
    def swing_is_next(self) -> bool:
        """The swing follows the phase under way, in which the flippers come out of the mud."""
        return self._row == len(self._rows) - 2

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

    def end_insertion(self) -> bool:
        """End the insertion at the depth commanded now, if that is in the mud; return whether it ended."""
        depth_m = self._target().depth_m
        if self._rows[self._row].phase is not Phase.INSERTION or depth_m <= 0.0:
            return False
        self._rows = stride_table(self._aim, self.geometry, depth_m)
        self._row, self._time_s = 1, 0.0
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
        phase, duration_s, sweep_start, sweep_end, depth_start, depth_end = self._rows[self._row]
        fraction, rate = smooth_progress(self._time_s, duration_s)
        sweep_span, depth_span = sweep_end - sweep_start, depth_end - depth_start
        sweep_rad, sweep_rad_s = sweep_start + sweep_span * fraction, sweep_span * rate
        if self._turns:
            added = [turn.after(self._time_s, duration_s) for turn in self._turns]
            sweep_rad += fsum(angle_rad for angle_rad, _ in added)
            sweep_rad_s += fsum(velocity_rad_s for _, velocity_rad_s in added)
        return GaitTarget(
            phase,
            self.stride,
            sweep_rad,
            sweep_rad_s,
            depth_start + depth_span * fraction,
            depth_span * rate,
        )
