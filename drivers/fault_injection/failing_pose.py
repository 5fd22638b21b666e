"""A pose source that injects failures into another one."""

from collections import deque
from math import isfinite

from control.records import BodyPose
from drivers.fault_injection.failure_table import FailureKind
from drivers.fault_injection.failures import NO_NUMBERS, Failure, Failures
from drivers.pose.pose_port import PoseReport, PoseSource

LATE_S = 0.2
FAR_M = 100.0  # random positions that look plausible


class FailingPose:
    """Wraps a PoseSource. Owns the delayed poses, and the frozen one."""

    def __init__(self, pose: PoseSource, failures: Failures) -> None:
        self._pose = pose
        self._failures = failures
        self._since: Failure | None = None
        self._late: deque[tuple[float, BodyPose]] = deque()

    def read(self, now_s: float) -> BodyPose:
        body = self._pose.read(now_s)
        failure = self._failures.of("pose")
        return body if failure is None else self._faulty(body, failure, now_s)

    def report(self) -> PoseReport:
        return self._pose.report()

    def _faulty(self, body: BodyPose, failure: Failure, now_s: float) -> BodyPose:
        if self._since is not failure:
            self._since, self._first = failure, body
            self._late.clear()
        random = self._failures.random
        match failure.kind:
            case FailureKind.STUCK:
                return BodyPose(now_s, self._first.x_m)
            case FailureKind.GARBAGE:
                return BodyPose(now_s, random.choice((*NO_NUMBERS, random.uniform(-FAR_M, FAR_M))))
            case FailureKind.SLOW:
                return self._delayed(body, now_s)
            case FailureKind.INTERMITTENT if not self._failures.loses():
                return body
        return BodyPose()

    def _delayed(self, body: BodyPose, now_s: float) -> BodyPose:
        """Stamp the pose when it is read, because a late camera does not report its delay."""
        self._late.append((now_s + LATE_S, body))
        while len(self._late) > 1 and self._late[1][0] <= now_s:
            self._late.popleft()
        arrival_s, late = self._late[0]
        return late._replace(stamp_s=now_s) if arrival_s <= now_s and isfinite(late.x_m) else BodyPose()
