"""A rigid plate in clay, integrated over its surface in three dimensions.

The plate is cut into panels across its width (plate_panels.py; the paper's rectangle is one), each panel into two
columns at the Gauss points of the wet part of its lower edge, and each column into strips along its height. A spring
that slides at its yield force holds every piece below the mud's surface (mud_springs.py):

    faces         across: N_p(ζ) s_u, both faces together      along: a s_u on each face and narrow side, as a vector
    narrow sides  N_p(ζ) s_u for a body as wide as the plate is thick, half of it on each
    lower edge    down N_c s_u, up 9 s_u with suction fading near the surface

with the strength s_u at the depth of the piece (for a strip, the mean over its height), times the rate factor of the
plate's speed. The laws and their constants are those of the clay. A slanted edge that looks down presses with its
extent across, one that looks up (as the top) does not. The narrow sides press, and those of a plate that is no
rectangle stick, at the middle of each one's range outward. Adhesion does not depend on pressure (undrained), so across
and along are independent. Lean, cross-coupling and lateral pull follow from the sum.

At rest loads relax: they fade by up to `relaxation` within half a second, and motion loads the springs again.
"""

from math import exp
from operator import add

from simulation.mud.clay import Clay, rate_factor
from simulation.mud.ground_contact import GroundContact
from simulation.mud.mud_springs import (
    LENGTHWAYS_YIELD_M,
    NOT_RUBBED,
    SIDEWAYS_YIELD_M,
    STRIPS,
    Column,
    LowerEdge,
    PlateStep,
    Springs,
    surface_above_edge_m,
)
from simulation.mud.plate_panels import GAUSS, Panel, panels_of, sides_m
from simulation.mud.rigid_plate import Attitude, PlateSize, Twist, Wrench, speed_of_edge_m_s

RELAXATION_S = 0.2
RESTING_M_S = 0.002
WAKING_M = 0.001


class PanelContact:
    """Owns the mud on one panel: two columns of both faces, and the lower edge."""

    def __init__(self, size: PlateSize, panel: Panel, side_m: float, reach: float) -> None:
        """`side_m`: thickness of the narrow side that a column counts."""
        self.panel = panel
        self._side_m = side_m
        across_m, along_m = reach * SIDEWAYS_YIELD_M, reach * LENGTHWAYS_YIELD_M
        self._columns = [Column(size.width_m, across_m, along_m) for _ in range(2)]
        self._edge = LowerEdge(size.thickness_m, along_m)
        self.parts: tuple[Springs, ...] = (*self._columns, self._edge)

    def step(self, step: PlateStep) -> tuple[float, ...]:
        """Return the panel's part of the wrench."""
        attitude, panel = step.attitude, self.panel
        wet_m, middle_m = panel.wet_part_m(attitude)
        positions_m = (middle_m - GAUSS * wet_m, middle_m + GAUSS * wet_m)
        inner = self._step_column(step, 0, positions_m[0], wet_m / 2.0)
        outer = self._step_column(step, 1, positions_m[1], wet_m / 2.0)
        depths_m = (panel.foot_depth_m(attitude, positions_m[0]), panel.foot_depth_m(attitude, positions_m[1]))
        edge_n, edge_nm = self._edge.step(step, positions_m, depths_m, wet_m)
        n, r, s, n_u, n_s, r_s, s_u = map(add, inner, outer)
        return n, r, s + edge_n, n_u, n_s, r_s, s_u + edge_nm

    def _step_column(self, step: PlateStep, half: int, outward_m: float, breadth_m: float) -> tuple[float, ...]:
        v_n, v_r, v_s, n_u, n_s, r_s, s_u = step.twist
        foot_m, strip_m = self.panel.foot_at_m(outward_m), self.panel.length_at_m(outward_m) / STRIPS
        heights = surface_above_edge_m(step.attitude, outward_m) - foot_m, foot_m, strip_m
        pressing = breadth_m, v_n + n_u * outward_m, n_s
        rubbing = 2.0 * breadth_m + self._side_m, complex(v_r, v_s + s_u * outward_m), r_s
        normal_n, normal_nm, along_n, outward_nm = self._columns[half].step(step, heights, pressing, rubbing)
        up_n = along_n.imag
        return normal_n, along_n.real, up_n, normal_n * outward_m, normal_nm, outward_nm, up_n * outward_m


class PlateContact(GroundContact):
    """Owns the contact of one plate with clay, and how far the clay around it has come to rest."""

    def __init__(self, size: PlateSize, relaxation: float = 0.0, reach: float = 1.0) -> None:
        """`reach`: factor of the distances over which the clay yields."""
        super().__init__(size)
        yield_m = reach * LENGTHWAYS_YIELD_M
        self.relaxation = relaxation
        self._strip_m = size.height_m / STRIPS
        side_m = 0.0 if size.corners_m else size.thickness_m  # a rectangle's columns count its narrow sides
        self._panels = [PanelContact(size, panel, side_m, reach) for panel in panels_of(size)]
        self._sides_m = sides_m(size, STRIPS)
        self._half_side_m = size.thickness_m / 2.0
        self._inner_side, self._outer_side = (Column(size.thickness_m, yield_m, yield_m) for _ in range(2))
        self._parts: tuple[Springs, ...] = (
            *(part for panel in self._panels for part in panel.parts),
            self._inner_side,
            self._outer_side,
        )
        self.reset()

    def reset(self) -> None:
        super().reset()
        for part in self._parts:
            part.reset()
        self._rested = 0.0

    def press(self, dt_s: float, ground: Clay, attitude: Attitude, twist: Twist, edge_m: float = 0.0) -> Wrench:
        self._touched = True
        speed_m_s = speed_of_edge_m_s(twist)
        if self.relaxation:
            self._relax(dt_s, speed_m_s)
        return self.wrench(PlateStep(dt_s, ground, rate_factor(speed_m_s), attitude, twist))

    def wrench(self, step: PlateStep) -> Wrench:
        """Return the sum over all pieces."""
        parts = [panel.step(step) for panel in self._panels]
        inner_n, inner_nm = self._step_side(parts, step, self._inner_side, self._sides_m[0])
        outer_n, outer_nm = self._step_side(parts, step, self._outer_side, self._sides_m[1])
        n, r, s, n_u, n_s, r_s, s_u = parts[0] if len(parts) == 1 else map(sum, zip(*parts, strict=True))
        return Wrench(n, r + inner_n + outer_n, s, n_u, n_s, r_s + inner_nm + outer_nm, s_u)

    def _relax(self, dt_s: float, speed_m_s: float) -> None:
        """Fade the load at rest. Motion forgets the rest, and the distance it covers loads the springs again."""
        before = self._rested
        if speed_m_s >= RESTING_M_S:
            self._rested *= exp(-speed_m_s * dt_s / WAKING_M)
            return
        self._rested += (1.0 - before) * (1.0 - exp(-dt_s / RELAXATION_S))
        remaining = (1.0 - self.relaxation * self._rested) / (1.0 - self.relaxation * before)
        self.fade(remaining)

    def fade(self, remaining: float) -> None:
        for part in self._parts:
            part.fade(remaining)

    def _step_side(
        self, parts: list[tuple[float, ...]], step: PlateStep, side: Column, outward_m: float
    ) -> tuple[float, float]:
        """Return the force outward, and its moment upward; add that of the mud that sticks to the side to the parts."""
        _, v_r, v_s, _, _, r_s, s_u = step.twist
        heights, pressing = (
            (surface_above_edge_m(step.attitude, outward_m), 0.0, self._strip_m),
            (self._half_side_m, v_r, r_s),
        )
        if not self.size.corners_m:
            force_n, moment_nm, _, _ = side.step(step, heights, pressing, NOT_RUBBED)
            return force_n, moment_nm
        rubbing = self.size.thickness_m, complex(v_r, v_s + s_u * outward_m), r_s
        force_n, moment_nm, along_n, outward_nm = side.step(step, heights, pressing, rubbing)
        parts.append((0.0, along_n.real, along_n.imag, 0.0, 0.0, outward_nm, along_n.imag * outward_m))
        return force_n, moment_nm
