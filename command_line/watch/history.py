"""What the screen knows of the robot: the newest status, and what it remembers of earlier ones.

The daemon may restart: its strides are then counted from zero again, and so are those here. Times are those of this
computer's monotonic clock, which the daemon shares.
"""

import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from command_line.screen import clock_text

FORCES = ("force_x_n", "force_z_n")
MOST_SAMPLES = 400  # of a force: as many as the widest terminal shows
MOST_STRIDES = 400  # of single flippers
MOST_JOINT_SAMPLES = 18000  # half an hour at ten a second, 3 MB a joint
SPEED_S = 4.0  # over which the speed is averaged: one to two strides
SILENT_S = 1.0  # without an answer until the screen says so

Report = dict[str, Any]


class JointSample(NamedTuple):
    """What one status or row says of all joints; None is unknown."""

    time_s: float  # of the loop's clock
    angle_rad: tuple[float | None, ...]
    current_a: tuple[float | None, ...]
    torque_command_nm: tuple[float | None, ...]


class Position(NamedTuple):
    time_s: float
    x_m: float


@dataclass
class History:
    """Owns what was heard; `problem` says why nothing is heard now."""

    status: Report = field(default_factory=dict)
    heard_s: float = float("-inf")
    asked_s: float = float("-inf")  # the time of the newest status from which rows followed
    problem: str = ""
    strides: deque[Report] = field(default_factory=lambda: deque(maxlen=MOST_STRIDES))
    next_stride: int = 0  # the number of the first stride not heard of
    forces: dict[str, deque[float | None]] = field(default_factory=dict)  # by flipper and FORCES
    positions: deque[Position] = field(default_factory=deque)
    joints: deque[JointSample] = field(default_factory=lambda: deque(maxlen=MOST_JOINT_SAMPLES))

    def add_status(self, report: Report, now_s: float, from_row: bool = False) -> None:
        """Take in a status; `from_row`: only the values of a newer row are newer than the last one."""
        if report["strides_closed"] < self.next_stride:
            self.forget()
        if not from_row:
            self.asked_s = now_s
        self.status, self.heard_s, self.problem = report, now_s, ""
        for flipper in self.flippers:
            for force in FORCES:
                samples = self.forces.setdefault(f"{flipper} {force}", deque(maxlen=MOST_SAMPLES))
                samples.append(report["loads"][flipper][force])
        signals = (tuple(drive[name] for drive in report["drives"]) for name in JointSample._fields[1:])
        self.joints.append(JointSample(report["now_s"], *signals))
        if report["body_x_m"] is not None:
            self.positions.append(Position(report["now_s"], report["body_x_m"]))
        while self.positions and self.positions[0].time_s < report["now_s"] - SPEED_S:
            self.positions.popleft()

    @property
    def flippers(self) -> list[str]:
        """The names of the robot's flippers."""
        return list(self.status["loads"])

    def add_strides(self, strides: list[Report]) -> None:
        for stride in strides:
            self.strides.append(stride)
            self.next_stride = stride["number"] + 1

    def forget(self) -> None:
        """Forget the strides: another daemon counts its own."""
        self.strides.clear()
        self.positions.clear()
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

    @property
    def speed_m_s(self) -> float | None:
        if len(self.positions) < 2:
            return None
        first, last = self.positions[0], self.positions[-1]
        elapsed_s = last.time_s - first.time_s
        return (last.x_m - first.x_m) / elapsed_s if elapsed_s > 0.0 else None

    @property
    def step_m(self) -> float | None:
        """The last step that was measured."""
        return next((stride["step_m"] for stride in reversed(self.strides) if stride["step_m"] is not None), None)
