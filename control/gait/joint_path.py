"""A slow, smooth path in joint space from the measured pose through way-points.

The controller uses it to reach the start of a stride and to raise the flippers when a walk ends. It needs no geometry,
so it works from any pose that the joints can have. Its speed is a mean: with its ramps a joint is faster for a moment,
by 1.05 times in a path of a second, by 2 times in one of a tenth, and by up to 2.8 times where short paths that begin
with the velocity of the one before turn back and forth.
"""

from collections.abc import Sequence
from typing import NamedTuple

from control.gait.gait import smooth_progress
from control.records import JointAngles, Joints, JointTarget, JointTargets

SHORTEST_LEG_S = 0.1


class Gap(NamedTuple):
    """The difference of two targets, and the time over which it fades."""

    angle_rad: float
    velocity_rad_s: float
    duration_s: float

    def after(self, time_s: float) -> JointTarget:
        """Evaluate e(s) = (1 - s)² (e₀ (1 + 2s) + T e₀' s), s = t/T, which ends at zero with zero velocity."""
        if time_s >= self.duration_s:
            return JointTarget(0.0, 0.0)
        s, run_rad = time_s / self.duration_s, self.velocity_rad_s * self.duration_s
        angle_rad = (1.0 - s) ** 2 * (self.angle_rad * (1.0 + 2.0 * s) + run_rad * s)
        rate_rad = (1.0 - s) * (run_rad * (1.0 - 3.0 * s) - 6.0 * self.angle_rad * s)
        return JointTarget(angle_rad, rate_rad / self.duration_s)


def with_gaps(targets: JointTargets, gaps: Sequence[Gap], time_s: float) -> JointTargets:
    """Return the targets plus what is left of their gaps."""
    rests = [gap.after(time_s) for gap in gaps]
    return Joints(
        *(
            JointTarget(target.angle_rad + rest.angle_rad, target.velocity_rad_s + rest.velocity_rad_s)
            for target, rest in zip(targets, rests, strict=True)
        )
    )


class JointPath:
    """All joints of a leg start and arrive together; the joint with the longest path sets the duration."""

    def __init__(
        self,
        start: JointAngles,
        way_points: Sequence[JointAngles],
        speed_rad_s: float,
        start_rad_s: Sequence[float] = (),
    ) -> None:
        """`start_rad_s`: velocities with which the joints begin, where they do not rest."""
        self._points = [start, *way_points]
        self._durations_s = [
            max(SHORTEST_LEG_S, max(abs(b - a) for a, b in zip(start, end, strict=True)) / speed_rad_s)
            for start, end in zip(self._points, self._points[1:], strict=False)
        ]
        self._gaps = [Gap(0.0, each, duration_s) for duration_s in self._durations_s[:1] for each in start_rad_s]
        self._leg = 0
        self._time_s = 0.0

    @property
    def finished(self) -> bool:
        return self._leg == len(self._durations_s)

    def step(self, dt_s: float) -> JointTargets:
        self._time_s += dt_s
        while not self.finished and self._time_s >= self._durations_s[self._leg]:
            self._time_s -= self._durations_s[self._leg]
            self._leg += 1
        if self.finished:
            return still(self._points[-1])
        fraction, rate = smooth_progress(self._time_s, self._durations_s[self._leg])
        start, end = self._points[self._leg], self._points[self._leg + 1]
        targets: JointTargets = Joints(
            *(
                JointTarget(from_rad + (to_rad - from_rad) * fraction, (to_rad - from_rad) * rate)
                for from_rad, to_rad in zip(start, end, strict=True)
            )
        )
        return with_gaps(targets, self._gaps, self._time_s) if self._gaps and not self._leg else targets


def still(angles: JointAngles) -> JointTargets:
    """Return targets that hold a pose."""
    return angles.map(lambda angle_rad: JointTarget(angle_rad, 0.0))
