"""A plate on a linear stage, with a load cell between them: what a laboratory's reference measurement feels.

The stage runs strokes at one speed with ramps of constant acceleration, or is pushed by a hand (stage_motion.py),
started whenever its operator pleases. It carries a plate down into the mud and up again, or through it at a depth; the
cell feels the mud's force along the stroke. Any plate will do that says what acts on it after a step of motion, such as
simulation/test_rig/load_cell.py in clay.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import NamedTuple, Protocol

from control.records import NEVER_S
from simulation.test_rig.stage_motion import HandMotion, HandParameters, Motion, RampedMotion

MOVING_STEP_S = 0.0005
RESTING_STEP_S = 0.01  # mud that relaxes takes a fifth of a second
LIFTED_M = 0.02  # of the lower edge above the mud, before and after a trial
GUIDE_SPEED_M_S = 0.1  # of lowering before a shear and lifting after it, which nobody measures


class CarriedPlate(Protocol):
    depth_m: float  # of the lower edge

    def reset(self) -> None:
        """Fresh mud."""

    def step(self, dt_s: float, forward_m_s: float, upward_m_s: float) -> tuple[float, float]:
        """Force (forward, upward) of the mud on the plate."""


class Drive(NamedTuple):
    """One straight motion of the stage; `way_m` forward or upward, `pause_s` after it."""

    path_m: float
    speed_m_s: float
    pause_s: float = 0.0
    sideways: bool = False


class StageParameters(NamedTuple):
    acceleration_m_s2: float = 2.0
    cell_sign: float = 1.0  # -1: a cell that is mounted the other way round
    hand: HandParameters | None = None  # that pushes it, in place of the controller; but for lowering and lifting
    seed: int = 1  # of the hand


class PlateStage:
    """Owns where the plate is, what the stage still has to do, and the force that the cell feels."""

    def __init__(self, plate: CarriedPlate, parameters: StageParameters | None = None) -> None:
        self.plate = plate
        self.parameters = parameters or StageParameters()
        self.hung_n = 0.0  # a calibration weight on the cell
        self._random = Random(self.parameters.seed)
        self._travelled_m = 0.0  # by strokes that are over
        self._drives: list[tuple[float, Drive, Motion]] = []
        self.reset()

    def reset(self) -> None:
        """Above fresh mud."""
        self.plate.reset()
        self.plate.depth_m = -LIFTED_M
        self.force_n = 0.0
        self.along_sideways = False  # what the cell is mounted for
        self._time_s = NEVER_S
        self._forget_drives()
        self._ends_s = NEVER_S

    def place_over(self, plate: CarriedPlate, sideways: bool) -> None:
        """Another mud, or the same one re-mixed; the cell measures along the coming stroke."""
        now_s, self.plate = self._time_s, plate
        self.reset()
        self._time_s, self.along_sideways = now_s, sideways

    def insert(self, start_s: float, depth_m: float, speed_m_s: float, hold_s: float) -> None:
        """Down from above the mud, hold, and up again."""
        path_m = LIFTED_M + depth_m
        self._drive(start_s, [Drive(-path_m, speed_m_s, hold_s), Drive(path_m, speed_m_s)], self.parameters.hand)

    def lower(self, start_s: float, depth_m: float) -> None:
        self._drive(start_s, [Drive(self.plate.depth_m - depth_m, GUIDE_SPEED_M_S)])

    def lift(self, start_s: float) -> None:
        self._drive(start_s, [Drive(LIFTED_M + self.plate.depth_m, GUIDE_SPEED_M_S)])

    def drag(self, start_s: float, path_m: float, speed_m_s: float) -> None:
        self._drive(start_s, [Drive(-path_m, speed_m_s, sideways=True)], self.parameters.hand)

    def _drive(self, start_s: float, drives: Sequence[Drive], hand: HandParameters | None = None) -> None:
        self._forget_drives()
        for drive in drives:
            motion = self._motion_of(drive, hand)
            self._drives.append((start_s, drive, motion))
            start_s += motion.duration_s + drive.pause_s
        self._ends_s = start_s

    def _motion_of(self, drive: Drive, hand: HandParameters | None) -> Motion:
        if hand is not None:
            return HandMotion(abs(drive.path_m), hand, self._random)
        return RampedMotion(abs(drive.path_m), drive.speed_m_s, self.parameters.acceleration_m_s2)

    def _forget_drives(self) -> None:
        self._travelled_m += sum(drive.path_m for _, drive, _ in self._drives)
        self._drives = []

    def travelled_m(self, at_s: float) -> float:
        """Of the stage along its rail, forward and upward: what an encoder on it counts. `at_s` may lie behind."""
        return self._travelled_m + sum(
            _position_m(start_s, drive, motion, at_s) for start_s, drive, motion in self._drives
        )

    @property
    def ends_s(self) -> float:
        """When the last stroke that was asked for is over."""
        return self._ends_s

    def mean_force_n(self, until_s: float) -> float:
        """Over the time since the last call, as a converter that integrates."""
        if self._time_s == NEVER_S:
            self._time_s = until_s
        begin_s, sum_ns = self._time_s, 0.0
        while self._time_s < until_s - 1e-9:
            sum_ns += self._step(until_s) * self.parameters.cell_sign
        return sum_ns / (until_s - begin_s) if until_s > begin_s else self.force_n * self.parameters.cell_sign

    def _step(self, until_s: float) -> float:
        """To the next moment that matters; force times time."""
        before_s = self._time_s
        drive = self._drive_at(before_s)
        step_s = RESTING_STEP_S if drive is None else MOVING_STEP_S
        self._time_s = min(before_s + step_s, until_s, self._next_start_s(before_s))
        dt_s = self._time_s - before_s
        forward_m = upward_m = 0.0
        if drive is not None:
            wanted = drive[1]
            moved_m = _position_m(*drive, self._time_s) - _position_m(*drive, before_s)
            forward_m, upward_m = (moved_m, 0.0) if wanted.sideways else (0.0, moved_m)
        forward_n, upward_n = self.plate.step(dt_s, forward_m / dt_s, upward_m / dt_s)
        self.force_n = self.hung_n + (forward_n if self.along_sideways else upward_n)
        return self.force_n * dt_s

    def _drive_at(self, now_s: float) -> tuple[float, Drive, Motion] | None:
        for start_s, drive, motion in self._drives:
            if start_s <= now_s < start_s + motion.duration_s:
                return start_s, drive, motion
        return None

    def _next_start_s(self, now_s: float) -> float:
        return min((start_s for start_s, _, _ in self._drives if start_s > now_s), default=float("inf"))


def _position_m(start_s: float, drive: Drive, motion: Motion, now_s: float) -> float:
    path_m = motion.path_m(now_s - start_s)
    return path_m if drive.path_m > 0.0 else -path_m
