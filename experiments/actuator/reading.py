"""One reading of a joint that holds a weight level: its current, approached from below and from above.

The motor holds by a spring without an integral, so a weight lets the arm sag: 800 g by 6 degrees, which is half a per
cent of the lever and three periods of the magnets' cogging. The held angle is raised until the arm itself is level, and
all weights are read at that angle, where cogging is one constant that the tare removes. The remaining angle is
measured.

Dry friction carries part of the load, at rest anything from minus to plus its maximum. So the level is approached in
small steps of one direction only, from below and then from above: the first current holds the load and nearly all of
the friction, the second the load without it. Their mean is the load. Half their difference is the friction at rest,
which is less than its maximum: friction.py measures it in motion.

A reading is settled when over its whole time the angle stands still and the current does not drift. The samples are
those of the daemon's status, asked a hundred times a second: 100 of them leave 0.01 A of a noise of 0.1 A, a twentieth
of the best weight's accuracy. The log keeps every row.
"""

from collections.abc import Iterator
from math import ceil, degrees, radians, sqrt
from statistics import fmean, pstdev
from typing import Any, NamedTuple

from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import BenchRobot, move, require_hold
from experiments.study.notebook import Entry

OFF_RAD = radians(1.0)  # to the side, before an approach
STEP_RAD = radians(0.6)  # at most at once: a hanging weight must not swing
NEAR_RAD = radians(0.04)  # to level: two counts of the encoder
PART = 0.35  # of the remaining angle, per step: a heavy arm overshoots twofold before friction stops it
SMALLEST_RAD = radians(0.03)
MOST_STEPS, MOST_TRIES = 30, 3
QUIET_S = 0.2  # after the last step
REST_S, REST_RAD, MOST_RESTS = 0.04, radians(0.03), 15  # between two samples of a joint that comes to rest
WINDOW_S, SAMPLE_S = 1.0, 0.01
MOST_WINDOWS = 8
STILL_RAD = radians(0.08)
DRIFT_A = 0.05  # between the halves of a window, beyond what noise explains
SIGMAS = 4.0
CHANGED_A = 1.5  # between the approaches: eight times the friction of a motor of this size
HIGHEST_RAD = radians(25.0)  # that the held angle may be away from level: four times the sag of 800 g


class MovedError(Exception):
    """The joint or its load did not come to rest; the text says what moved."""


class WarmError(Exception):
    """The winding came near the temperature above which torque fades, and the weight would fall."""


class HeldSample(NamedTuple):
    now_s: float
    angle_rad: float
    current_a: float
    winding_c: float


class HeldJoint:
    """Moves the held angle of one joint."""

    def __init__(self, robot: BenchRobot, joint: str) -> None:
        self._robot = robot
        self._joint = joint
        self._index = robot.configuration.rig.joints.index(joint)
        self._warm_c = robot.configuration.limits.temperature_warm_c
        self.held_rad = self.sample().angle_rad  # arming holds the pose that it finds

    def read(self) -> Entry:
        """Return the entry of the notebook. Raises MovedError, WarmError, and BenchError where the robot lets go.

        `current_a` holds the load without friction, and `rest_friction_a` is half of what the approaches differ by.
        """
        below = self._from(1.0)
        above = self._from(-1.0)
        last, change_a = self.sample(), below["current_a"] - above["current_a"]
        if abs(change_a) > CHANGED_A:
            raise MovedError(f"the two approaches differ by {change_a:+.1f} A, as if the load had changed between them")
        return {
            "current_a": (below["current_a"] + above["current_a"]) / 2.0,
            "rest_friction_a": change_a / 2.0,
            "angle_rad": (below["angle_rad"] + above["angle_rad"]) / 2.0,
            "winding_c": last.winding_c,
            "at_s": last.now_s,  # by the robot's clock
            "below": below,
            "above": above,
        }

    def sample(self) -> HeldSample:
        return self._sample_of(self._robot.call("status"))

    def _sample_of(self, status: dict[str, Any]) -> HeldSample:
        require_hold(status)
        drive = status["drives"][self._index]
        if drive["winding_c"] >= self._warm_c:
            raise WarmError(f"the {self._joint} winding has {drive['winding_c']:.0f} °C")
        return HeldSample(status["now_s"], drive["angle_rad"], drive["current_a"], drive["winding_c"])

    def stroke(self, angle_rad: float, step_rad: float) -> list[HeldSample]:
        """Return the samples on the way to an angle, in moves of at most this size, until it rests."""
        samples = []
        for next_rad in _path_rad(self.held_rad, angle_rad, step_rad):
            self._robot.call("move", **{f"{self._joint}_rad": next_rad})
            self.held_rad = next_rad
            while (status := self._robot.call("status"))["moving"]:
                samples.append(self._sample_of(status))
                self._robot.wait(SAMPLE_S)
            if status["notice"]:
                raise BenchError(status["notice"])
        return samples + self._window(QUIET_S)

    def _from(self, direction: float) -> Entry:
        self._go_off(direction)
        for _ in range(MOST_STEPS):
            left_rad = -direction * self._resting_rad()
            if left_rad <= NEAR_RAD:
                break
            self._hold(self.held_rad + direction * min(max(PART * left_rad, SMALLEST_RAD), STEP_RAD))
        self._robot.wait(QUIET_S)
        return self._settled()

    def _go_off(self, direction: float) -> None:
        """Move to the side from which the approach comes, again where the arm still swung."""
        for _ in range(MOST_TRIES):
            self._hold(self.held_rad - self._resting_rad() - direction * OFF_RAD)
            self._robot.wait(QUIET_S)
            if -direction * self._resting_rad() > OFF_RAD / 2.0:
                return

    def _resting_rad(self) -> float:
        """Return the angle once it hardly changes, or after a time limit."""
        before_rad = self.sample().angle_rad
        for _ in range(MOST_RESTS):
            self._robot.wait(REST_S)
            angle_rad = self.sample().angle_rad
            if abs(angle_rad - before_rad) <= REST_RAD:
                break
            before_rad = angle_rad
        return angle_rad

    def _hold(self, angle_rad: float) -> None:
        """Move in steps that do not swing the weight."""
        if abs(angle_rad) > HIGHEST_RAD:
            raise MovedError("the motor cannot bring the arm level: is the weight too heavy, or the arm blocked")
        for next_rad in _path_rad(self.held_rad, angle_rad, STEP_RAD):
            self.held_rad = next_rad
            move(self._robot, {self._joint: next_rad})

    def _settled(self) -> Entry:
        """Return the means over a window at rest, the noise of one sample, and the commanded angle."""
        problem = ""
        for _ in range(MOST_WINDOWS):
            samples = self._window(WINDOW_S)
            problem = find_motion(samples)
            if not problem:
                currents_a = [sample.current_a for sample in samples]
                return {
                    "angle_rad": fmean(sample.angle_rad for sample in samples),
                    "current_a": fmean(currents_a),
                    "noise_a": pstdev(currents_a),
                    "held_rad": self.held_rad,
                }
        raise MovedError(problem)

    def _window(self, duration_s: float) -> list[HeldSample]:
        samples = [self.sample()]
        while samples[-1].now_s < samples[0].now_s + duration_s:
            self._robot.wait(SAMPLE_S)
            samples.append(self.sample())
        return samples


def _path_rad(start_rad: float, end_rad: float, step_rad: float) -> Iterator[float]:
    """Yield equal steps of at most this size, at least one."""
    steps = max(1, ceil(abs(end_rad - start_rad) / step_rad))
    for step in range(1, steps + 1):
        yield start_rad + (end_rad - start_rad) * step / steps


def find_motion(samples: list[HeldSample]) -> str:
    """Return a message on what moved in a window; empty where nothing did."""
    angles_rad = [sample.angle_rad for sample in samples]
    swing_rad = max(angles_rad) - min(angles_rad)
    if swing_rad > STILL_RAD:
        return f"the joint swings by {degrees(swing_rad):.2f} degrees"
    half = len(samples) // 2
    early_a, late_a = ([sample.current_a for sample in part] for part in (samples[:half], samples[half:]))
    drift_a = abs(fmean(late_a) - fmean(early_a))
    noise_a = SIGMAS * sqrt((pstdev(early_a) ** 2 + pstdev(late_a) ** 2) / max(half, 1))
    if drift_a > noise_a + DRIFT_A:
        return f"the current drifts by {drift_a:.2f} A"
    return ""
