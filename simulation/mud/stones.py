"""Buried stones: blocks with a level top and upright flanks across the track, harder than any plate can press.

A plate meets a stone with its lower edge. The nearest face at the first touch, the top or a flank, is the face that the
plate came against, and that face pushes back

    F = max(K δ + C δ', 0)        δ: how far the edge has penetrated the face

as a spring with a damper that can push and not pull, until the edge is out of the stone. Faces are smooth, so the
plate slides along them. The top touches the edge's lower corner, a flank the middle of the edge; the mud around the
stone acts on the plate as everywhere. Stones lie in the paths of the flippers only: body and drag pad pass between.

K is as stiff as the simulation's step allows with a margin: an arm of 0.03 kg at its plate swings at 800 rad/s on it,
where semi-implicit Euler ends at 2000 rad/s with a step of 1 ms. 14 N, more than both limits of the authors' drives,
press the edge 0.7 mm into it. With C an arm in air rebounds from the top at six tenths of its speed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import cos, inf, sin
from typing import Annotated, NamedTuple

from control.bounds import Bounds
from control.geometry import FlipperGeometry
from simulation.mud.rigid_plate import Attitude, Wrench
from simulation.mud.vectors import added, along, horizontal

STIFFNESS_N_M = 20e3
DAMPING_N_S_M = 15.0


class Face(Enum):
    TOP = "top"
    REAR = "rear"  # towards the start of the track
    FRONT = "front"


@dataclass(frozen=True)
class Stone:
    start_m: Annotated[float, Bounds(0.0, 1000.0)]
    end_m: Annotated[float, Bounds(0.0, 1000.0)]
    top_m: Annotated[float, Bounds(0.0, 1.0)]  # below the mud's nominal height

    def contains(self, position_m: float, depth_m: float) -> bool:
        return depth_m > self.top_m and self.start_m < position_m < self.end_m

    def penetration_m(self, face: Face, position_m: float, depth_m: float) -> float:
        """Return how far a point in the stone has penetrated one of its faces."""
        if face is Face.TOP:
            return depth_m - self.top_m
        return position_m - self.start_m if face is Face.REAR else self.end_m - position_m


class Push(NamedTuple):
    """The force of a stone on a plate's lower edge."""

    forward_n: float
    upward_n: float


NO_PUSH = Push(0.0, 0.0)


def push_wrench(geometry: FlipperGeometry, sweep_rad: float, attitude: Attitude, push: Push) -> Wrench:
    """Resolve F_x forward on the middle of the lower edge and F_z upward on its lowest corner along the plate.

    Both are directions of the world. Of a body that is upright

    F_n = F_x cos α - F_z sin α sin β    F_r = F_x sin α + F_z cos α sin β    F_s = F_z cos β
    """
    ahead = horizontal(attitude.up, (cos(sweep_rad), sin(sweep_rad), 0.0))
    corner_m, height_m = max(geometry.plate.corners, key=lambda corner: attitude.depth_at_m(*corner))
    upright_n, across_n, upward_n = lift = along(attitude.up, push.upward_n)
    return Wrench(
        *added(along(ahead, push.forward_n), lift),
        normal_outward_nm=upright_n * corner_m,
        normal_upward_nm=upright_n * height_m,
        outward_upward_nm=across_n * height_m,
        upward_outward_nm=upward_n * corner_m,
    )


class StoneContact:
    """Owns the face of the stone that one plate presses against, and how far."""

    def __init__(self, stones: Sequence[Stone]) -> None:
        self.stones = tuple(stones)
        self._highest_m = min((stone.top_m for stone in self.stones), default=inf)
        self.reset()

    def reset(self) -> None:
        self._touched: tuple[Stone, Face] | None = None
        self._penetration_m = 0.0

    def step(self, dt_s: float, position_m: float, depth_m: float) -> Push:
        """`position_m` of the edge along the track and `depth_m` below the nominal height."""
        if self._touched is None or not self._touched[0].contains(position_m, depth_m):
            self._find_stone(position_m, depth_m)
        if self._touched is None:
            return NO_PUSH
        stone, face = self._touched
        before_m, self._penetration_m = self._penetration_m, stone.penetration_m(face, position_m, depth_m)
        speed_m_s = (self._penetration_m - before_m) / dt_s
        force_n = max(STIFFNESS_N_M * self._penetration_m + DAMPING_N_S_M * speed_m_s, 0.0)
        if face is Face.TOP:
            return Push(0.0, force_n)
        return Push(-force_n if face is Face.REAR else force_n, 0.0)

    def _find_stone(self, position_m: float, depth_m: float) -> None:
        """Find the stone that contains the edge, and the face through which it came."""
        self.reset()
        if depth_m <= self._highest_m:  # above all stones, as in swing
            return
        for stone in self.stones:
            if stone.contains(position_m, depth_m):
                nearest = min(Face, key=lambda face: stone.penetration_m(face, position_m, depth_m))
                self._touched = (stone, nearest)
