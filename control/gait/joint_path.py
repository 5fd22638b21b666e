"""A slow, smooth path in joint space from the measured pose through way-points.

The controller uses it to reach the start of a stride and to raise the flippers when a walk ends. It needs no geometry,
so it works from any pose that the joints can have.
"""

from collections.abc import Sequence

from control.gait.gait import smooth_progress
from control.records import JointAngles, Joints, JointTarget, JointTargets

SHORTEST_LEG_S = 0.1


class JointPath:
    """All joints of a leg start and arrive together; the joint with the longest path sets the duration."""

    def __init__(self, start: JointAngles, way_points: Sequence[JointAngles], speed_rad_s: float) -> None:
        self._points = [start, *way_points]
        self._durations_s = [
            max(SHORTEST_LEG_S, max(abs(b - a) for a, b in zip(start, end, strict=True)) / speed_rad_s)
            for start, end in zip(self._points, self._points[1:], strict=False)
        ]
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
        return Joints(
            *(
                JointTarget(from_rad + (to_rad - from_rad) * fraction, (to_rad - from_rad) * rate)
                for from_rad, to_rad in zip(start, end, strict=True)
            )
        )


def still(angles: JointAngles) -> JointTargets:
    """Return targets that hold a pose."""
    return angles.map(lambda angle_rad: JointTarget(angle_rad, 0.0))
