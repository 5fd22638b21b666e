"""The body's pose from motion capture: extrapolates the positions that a stream of them brings to the present tick.

The stream is the bridge's process (natnet_bridge.py); tests pass a client in this process. After a long gap or a jump
the first position is accepted only when a second one follows, because lost capture shows old positions. A read with a
position that is not accepted has no pose, so that no stroke counts a jump as motion.
"""

from collections.abc import Iterable
from typing import Protocol

from control.records import NEVER_S, BodyPose
from drivers.pose.pose_port import STALE_S, PoseReport
from drivers.pose.pose_timing import PoseForecast

LONGEST_GAP_S = 0.5  # after a longer one a position is accepted when a second one follows


class PositionStream(Protocol):
    """Brings positions along the track with their stamps, both as of this computer's monotonic clock."""

    def receive(self, now_s: float) -> Iterable[tuple[float, float]]: ...

    def report(self) -> PoseReport: ...

    def close(self) -> None: ...


class NatNetPort:
    """Implements PoseSource. Owns the recent positions."""

    def __init__(self, stream: PositionStream, origin_m: float = 0.0) -> None:
        """`origin_m` is the position where x is zero."""
        self._stream, self._origin_m = stream, origin_m
        self.poses = self._refused = 0
        self._forecast = PoseForecast()
        self._now_s = self._stamp_s = self._seen_s = self._accepted_s = NEVER_S

    def read(self, now_s: float) -> BodyPose:
        self._now_s, refused = now_s, self._refused
        for stamp_s, position_m in self._stream.receive(now_s):
            follows = self._forecast.add(stamp_s, position_m) and now_s - self._seen_s <= LONGEST_GAP_S
            self._stamp_s, self._seen_s = stamp_s, now_s
            self._accepted_s = now_s if follows else NEVER_S
            self.poses += follows
            self._refused += not follows
        if self._refused > refused or now_s - self._accepted_s > STALE_S:
            return BodyPose()
        return BodyPose(self._stamp_s, self._forecast.at(now_s) - self._origin_m)

    def report(self) -> PoseReport:
        report = self._stream.report()
        report = report._replace(poses=self.poses, lost=report.lost + self._refused)
        if self._now_s - self._accepted_s <= STALE_S:
            return report._replace(trouble="", what_to_do="")
        if self._now_s - self._seen_s <= STALE_S:
            return report._replace(
                trouble="motion capture's poses jump, or arrive seconds apart.",
                what_to_do="check its markers, the cameras' view, and pose.natnet.body or body_id",
            )
        return report

    def reopen(self, now_s: float) -> bool:
        return False  # the bridge's sockets stay open without their network

    def close(self) -> None:
        self._stream.close()
