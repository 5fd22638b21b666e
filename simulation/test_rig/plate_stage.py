"""A plate on a linear stage, with a load cell between them: a laboratory's reference measurement.

The stage runs moves at one speed with ramps of constant acceleration, or is pushed by hand (stage_motion.py). It
carries a plate down into the mud and up again, or through it at a depth; the cell measures the mud's force along the
move. The plate is any object that returns the force on it after a step of motion, such as the one of load_cell.py.
"""

from collections.abc import Sequence
from math import fsum, inf
from random import Random
from typing import NamedTuple, Protocol

from control.records import NEVER_S
from simulation.test_rig.stage_motion import ManualMotion, ManualMotionParameters, Motion, RampedMotion

MOVING_STEP_S = 0.0005
RESTING_STEP_S = 0.01  # mud that relaxes takes a fifth of a second
LIFTED_M = 0.02  # of the lower edge above the mud, before and after a trial
GUIDE_SPEED_M_S = 0.1  # of lowering before a shear and lifting after it, which are not measured


class CarriedPlate(Protocol):
    depth_m: float  # of the lower edge

    def reset(self) -> None:
        """Put the plate over fresh mud."""

    def step(self, dt_s: float, forward_m_s: float, upward_m_s: float) -> tuple[float, float]:
        """Return the force (forward, upward) of the mud on the plate."""


class Move(NamedTuple):
    """One straight motion of the stage, `path_m` forward or upward."""

    start_s: float
    path_m: float
    motion: Motion
    sideways: bool

    def position_m(self, at_s: float) -> float:
        path_m = self.motion.path_m(at_s - self.start_s)
        return path_m if self.path_m > 0.0 else -path_m


class StageParameters(NamedTuple):
    acceleration_m_s2: float = 2.0
    manual: ManualMotionParameters | None = None  # pushed by hand, except to lower and lift
    seed: int = 1  # of the manual motion


class PlateStage:
    """Owns the plate's position, the moves that the stage still has to make, and the force on the cell."""

    def __init__(self, plate: CarriedPlate, parameters: StageParameters | None = None) -> None:
        self.plate = plate
        self.parameters = parameters or StageParameters()
        self.hung_weight_n = 0.0  # a calibration weight on the cell
        self._random = Random(self.parameters.seed)
        self._travelled_m = 0.0  # by moves that have ended
        self._moves: list[Move] = []
        self.reset()

    def reset(self) -> None:
        """Put the plate above fresh mud."""
        self.plate.reset()
        self.plate.depth_m = -LIFTED_M
        self.force_n = 0.0
        self.measures_sideways = False  # the direction in which the cell is mounted
        self._time_s = NEVER_S
        self._clear_moves()
        self.ends_s = NEVER_S  # the end of the last requested move

    def move_over(self, plate: CarriedPlate, sideways: bool) -> None:
        """Move over another mud, or the same one re-mixed, and turn the cell along the coming move."""
        now_s, self.plate = self._time_s, plate
        self.reset()
        self._time_s, self.measures_sideways = now_s, sideways

    def insert(self, start_s: float, depth_m: float, speed_m_s: float, hold_s: float) -> None:
        """Insert the plate from above the mud, hold it, and lift it again."""
        path_m = LIFTED_M + depth_m
        self._start(start_s, (-path_m, path_m), speed_m_s, hold_s, manual=self.parameters.manual)

    def lower(self, start_s: float, depth_m: float) -> None:
        self._start(start_s, (self.plate.depth_m - depth_m,), GUIDE_SPEED_M_S)

    def lift(self, start_s: float) -> None:
        self._start(start_s, (LIFTED_M + self.plate.depth_m,), GUIDE_SPEED_M_S)

    def drag(self, start_s: float, path_m: float, speed_m_s: float) -> None:
        self._start(start_s, (-path_m,), speed_m_s, sideways=True, manual=self.parameters.manual)

    def _start(
        self,
        start_s: float,
        paths_m: Sequence[float],
        speed_m_s: float,
        hold_s: float = 0.0,
        sideways: bool = False,
        manual: ManualMotionParameters | None = None,
    ) -> None:
        """Plan moves with a hold between them."""
        self._clear_moves()
        for path_m in paths_m:
            motion: Motion = RampedMotion(abs(path_m), speed_m_s, self.parameters.acceleration_m_s2)
            if manual is not None:
                motion = ManualMotion(abs(path_m), manual, self._random)
            self._moves.append(Move(start_s, path_m, motion, sideways))
            self.ends_s = start_s + motion.duration_s
            start_s += motion.duration_s + hold_s

    def _clear_moves(self) -> None:
        self._travelled_m += fsum(move.path_m for move in self._moves)
        self._moves = []

    def travelled_m(self, at_s: float) -> float:
        """Return the stage's travel, forward and upward, that an encoder on it counts. `at_s` may lie in the past."""
        return self._travelled_m + fsum(move.position_m(at_s) for move in self._moves)

    def mean_force_n(self, until_s: float) -> float:
        """Return the mean force since the last call, as an integrating converter measures it."""
        if self._time_s == NEVER_S:
            self._time_s = until_s
        start_s, sum_ns = self._time_s, 0.0
        while self._time_s < until_s - 1e-9:
            sum_ns += self._step(until_s)
        return sum_ns / (until_s - start_s) if until_s > start_s else self.force_n

    def _step(self, until_s: float) -> float:
        """Advance to the next change of motion and return force times time."""
        before_s = self._time_s
        under_way = (move for move in self._moves if move.start_s <= before_s < move.start_s + move.motion.duration_s)
        move = next(under_way, None)
        next_start_s = min((move.start_s for move in self._moves if move.start_s > before_s), default=inf)
        step_s = RESTING_STEP_S if move is None else MOVING_STEP_S
        self._time_s = min(before_s + step_s, until_s, next_start_s)
        dt_s, forward_m, upward_m = self._time_s - before_s, 0.0, 0.0
        if move is not None:
            moved_m = move.position_m(self._time_s) - move.position_m(before_s)
            forward_m, upward_m = (moved_m, 0.0) if move.sideways else (0.0, moved_m)
        forward_n, upward_n = self.plate.step(dt_s, forward_m / dt_s, upward_m / dt_s)
        self.force_n = self.hung_weight_n + (forward_n if self.measures_sideways else upward_n)
        return self.force_n * dt_s
