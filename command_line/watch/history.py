"""What the screen knows of the robot: the newest status, and what it remembers of earlier ones.

The daemon may restart: its strides are then counted from zero again, and so are those here. Times are those of this
computer's monotonic clock, which the daemon shares.
"""

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice, takewhile
from typing import NamedTuple

from command_line.robot_text import Report
from command_line.screen import clock_text

MOST_STRIDES = 400  # of single flippers
MOST_SAMPLES = 18000  # half an hour at ten a second, 3 MB a joint
SPEED_S = 4.0  # over which the speed is averaged: one to two strides
SILENT_S = 1.0  # without an answer until the screen says so
Values = tuple[float | None, ...]  # of the joints or the flippers; None is unknown


class Sample(NamedTuple):
    """What one status or row says of all joints and flippers."""

    time_s: float  # of the loop's clock
    body_x_m: float | None
    angle_rad: Values
    current_a: Values
    torque_command_nm: Values
    force_x_n: Values
    force_z_n: Values


@dataclass
class History:
    """Owns what was heard; `problem` says why nothing is heard now."""

    status: Report = field(default_factory=dict)
    heard_s: float = float("-inf")
    asked_s: float = float("-inf")  # the time of the newest status from which rows followed
    problem: str = ""
    strides: deque[Report] = field(default_factory=lambda: deque(maxlen=MOST_STRIDES))
    next_stride: int = 0  # the number of the first stride not heard of
    samples: deque[Sample] = field(default_factory=lambda: deque(maxlen=MOST_SAMPLES))

    def add_status(self, report: Report, now_s: float, from_row: bool = False) -> None:
        """Take in a status; `from_row`: only the values of a newer row are newer than the last one."""
        if report["strides_closed"] < self.next_stride:
            self.forget()
        if not from_row:
            self.asked_s = now_s
        self.status, self.heard_s, self.problem = report, now_s, ""
        joints, flippers = report["drives"], report["loads"].values()
        signals = (tuple(joint[name] for joint in joints) for name in Sample._fields[2:5])
        forces = (tuple(flipper[name] for flipper in flippers) for name in Sample._fields[5:])
        if self.samples and len(self.samples[-1].angle_rad) != len(joints):
            self.samples.clear()  # of a daemon before, whose robot had another number of flippers
        self.samples.append(Sample(report["now_s"], report["body_x_m"], *signals, *forces))

    def add_strides(self, strides: list[Report]) -> None:
        for stride in strides:
            self.strides.append(stride)
            self.next_stride = stride["number"] + 1

    def forget(self) -> None:
        """Forget the strides: another daemon counts its own."""
        self.strides.clear()
        self.next_stride = 0

    def clock_text(self, age_s: float) -> str:
        """Return the time of day of an event that the newest status says to be `age_s` old."""
        return clock_text(time.monotonic() - self.asked_s + age_s)

    def silence_s(self, now_s: float) -> float:
        """How long nothing was heard; zero as long as answers come."""
        age_s = now_s - self.heard_s
        return age_s if self.problem or age_s > SILENT_S else 0.0

    def of(self, flipper: str) -> list[Report]:
        return [stride for stride in self.strides if stride["flipper"] == flipper]

    def forces_n(self, flipper: int, name: str, count: int) -> list[float | None]:
        """Return the last forces on a flipper, the newest last."""
        return [getattr(sample, name)[flipper] for sample in islice(reversed(self.samples), count)][::-1]

    def _recent(self) -> Iterator[tuple[float, float]]:
        """Yield time and position of the last seconds, the newest first."""
        since_s = self.status["now_s"] - SPEED_S
        for sample in takewhile(lambda sample: sample.time_s >= since_s, reversed(self.samples)):
            if sample.body_x_m is not None:
                yield sample.time_s, sample.body_x_m

    @property
    def speed_m_s(self) -> float | None:
        positions = list(self._recent())
        if len(positions) < 2:
            return None
        (last_s, last_m), (first_s, first_m) = positions[0], positions[-1]
        return (last_m - first_m) / (last_s - first_s) if last_s > first_s else None

    @property
    def step_m(self) -> float | None:
        """The last step that was measured."""
        return next((stride["step_m"] for stride in reversed(self.strides) if stride["step_m"] is not None), None)
