"""A rigid rectangular plate in clay, integrated over its surface in three dimensions.

The plate is cut into strips along its height and two columns across the wet part of its lower edge, at its Gauss
points. A spring that slides at its yield force holds every piece below the mud's surface (mud_springs.py):

    faces         across: N_p(ζ) s_u, both faces together      along: a s_u on each face and narrow side, as a vector
    narrow sides  N_p(ζ) s_u for a body as wide as the plate is thick, half of it on each
    lower edge    down N_c s_u, up 9 s_u with suction fading near the surface

with the strength s_u at the depth of the piece (for a strip, the mean over its height), times the rate factor of the
plate's speed. The laws and their constants are those of the clay. Adhesion does not depend on pressure (undrained), so
across and along are independent. Lean, cross-coupling and lateral pull follow from the sum.

At rest loads relax: they fade by up to `relaxation` within half a second, and motion loads the springs again.
"""

from math import exp, sqrt
from typing import NamedTuple

from simulation.mud.clay import Clay, rate_factor
from simulation.mud.mud_springs import (
    LENGTHWAYS_YIELD_M,
    SIDEWAYS_YIELD_M,
    STRIPS,
    LowerEdge,
    PlateStep,
    PressedColumn,
    RubbedColumn,
    Strip,
    submerged_strips,
)
from simulation.mud.rigid_plate import NO_WRENCH, Attitude, PlateSize, Twist, Wrench, lowest_point_m, wet_edge_m

GAUSS = 0.5 / sqrt(3.0)  # of a width, each side of its middle
RELAXATION_S = 0.2
RESTING_M_S = 0.002
WAKING_M = 0.001


class Column(NamedTuple):
    """Half of the plate: both faces, and a narrow side."""

    pressed: PressedColumn
    rubbed: RubbedColumn


class PlateContact:
    """Owns the contact of one plate, and how far the mud around it has come to rest."""

    def __init__(self, size: PlateSize, relaxation: float = 0.0) -> None:
        self.size = size
        self.relaxation = relaxation
        self._strip_m = size.height_m / STRIPS
        self._inner, self._outer = (
            Column(PressedColumn(size.width_m, SIDEWAYS_YIELD_M), RubbedColumn()) for _ in range(2)
        )
        self._inner_side, self._outer_side = (PressedColumn(size.thickness_m, LENGTHWAYS_YIELD_M) for _ in range(2))
        self._edge = LowerEdge(size.thickness_m)
        self._parts = (*self._inner, *self._outer, self._inner_side, self._outer_side, self._edge)
        self.reset()

    def reset(self) -> None:
        for part in self._parts:
            part.reset()
        self._rested = 0.0
        self._touched = False

    def leaves(self, attitude: Attitude) -> bool:
        """Returns whether the plate is clear of the mud; the mud then forgets it."""
        if lowest_point_m(attitude, self.size.width_m) > 0.0:
            return False
        if self._touched:
            self.reset()
        return True

    def step(self, dt_s: float, clay: Clay, attitude: Attitude, twist: Twist) -> Wrench:
        return NO_WRENCH if self.leaves(attitude) else self.press(dt_s, clay, attitude, twist)

    def press(self, dt_s: float, clay: Clay, attitude: Attitude, twist: Twist) -> Wrench:
        """Steps a plate that does not leave the mud."""
        self._touched = True
        speed_m_s = sqrt(twist.normal_m_s**2 + twist.outward_m_s**2 + twist.upward_m_s**2)
        if self.relaxation:
            self._relax(dt_s, speed_m_s)
        return self._wrench(PlateStep(dt_s, clay, rate_factor(speed_m_s), attitude, twist))

    def _wrench(self, step: PlateStep) -> Wrench:
        """Returns the sum over all pieces."""
        half_m = self.size.width_m / 2.0
        wet_m, middle_m = wet_edge_m(step.attitude, self.size.width_m)
        positions_m = (middle_m - GAUSS * wet_m, middle_m + GAUSS * wet_m)
        inner = self._step_column(step, self._inner, positions_m[0], wet_m / 2.0)
        outer = self._step_column(step, self._outer, positions_m[1], wet_m / 2.0)
        inner_n, inner_nm = self._step_side(step, self._inner_side, -half_m)
        outer_n, outer_nm = self._step_side(step, self._outer_side, half_m)
        edge_n, edge_nm = self._edge.step(step, positions_m, wet_m)
        n, r, s, n_u, n_s, r_s, s_u = [a + b for a, b in zip(inner, outer, strict=True)]
        return Wrench(n, r + inner_n + outer_n, s + edge_n, n_u, n_s, r_s + inner_nm + outer_nm, s_u + edge_nm)

    def _relax(self, dt_s: float, speed_m_s: float) -> None:
        """Fades the load at rest. Motion forgets the rest, and the distance it covers loads the springs again."""
        before = self._rested
        if speed_m_s >= RESTING_M_S:
            self._rested *= exp(-speed_m_s * dt_s / WAKING_M)
            return
        self._rested += (1.0 - before) * (1.0 - exp(-dt_s / RELAXATION_S))
        remaining = (1.0 - self.relaxation * self._rested) / (1.0 - self.relaxation * before)
        for part in self._parts:
            part.fade(remaining)

    def _strips(self, step: PlateStep, outward_m: float) -> list[Strip]:
        depth_m, per_outward, per_upward = step.attitude
        submerged_m = (depth_m + per_outward * outward_m) / per_upward
        return submerged_strips(submerged_m, self._strip_m, per_upward, step.clay)

    def _step_column(self, step: PlateStep, column: Column, outward_m: float, breadth_m: float) -> tuple[float, ...]:
        """Returns the column's part of the wrench."""
        v_n, v_r, v_s, n_u, n_s, r_s, s_u = step.twist
        strips = self._strips(step, outward_m)
        normal_n, normal_nm = column.pressed.step(step, strips, breadth_m, v_n + n_u * outward_m, n_s)
        sticky_m = 2.0 * breadth_m + self.size.thickness_m
        along_n, outward_nm = column.rubbed.step(step, strips, sticky_m, complex(v_r, v_s + s_u * outward_m), r_s)
        up_n = along_n.imag
        return normal_n, along_n.real, up_n, normal_n * outward_m, normal_nm, outward_nm, up_n * outward_m

    def _step_side(self, step: PlateStep, side: PressedColumn, outward_m: float) -> tuple[float, float]:
        """Returns the force outward, and its moment upward."""
        strips, twist = self._strips(step, outward_m), step.twist
        breadth_m = self.size.thickness_m / 2.0
        return side.step(step, strips, breadth_m, twist.outward_m_s, twist.outward_per_upward_s)
