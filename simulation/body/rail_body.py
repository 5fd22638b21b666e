"""The body on its rail: one way to go, held elastically by dry friction until that yields.

The rail's drag and that of the pad in the mud add up to one force, which a spring carries as long as it is less. That
spring's damping lets nothing ring: it is half of critical with the paper's body. Sliding, the drag grows with speed.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from simulation.body.carriage import Carriage, Vector
from simulation.mud.clay import Clay, rate_factor
from simulation.mud.flipper_contact import ContactForce
from simulation.mud.track import Track

DRAG_STIFFNESS_N_M = 5000.0
DRAG_DAMPING_N_S_M = 71.0


class BodyMotion(NamedTuple):
    """Of the centre of mass in the world, and of the body about it.

    Axes are x forward, y to the left, z up; turning follows the right hand, so a positive roll raises the left side
    and a positive pitch lowers the nose.
    """

    velocity_m_s: Vector
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad_s: float = 0.0
    pitch_rad_s: float = 0.0


class Pusher(Protocol):
    """A flipper as the body feels it."""

    force: ContactForce
    sweep_rad: float
    adduction_rad: float


class Body(Protocol):
    """What carries the flippers."""

    forward_m: float
    forward_m_s: float

    def reset(self) -> None: ...

    @property
    def carriages(self) -> tuple[Carriage | None, Carriage | None]:
        """How it carries the (left, right) flipper beyond going forward; None where that is all."""

    @property
    def motion(self) -> BodyMotion: ...

    def step(self, dt_s: float, left: Pusher, right: Pusher) -> None: ...


class DryDrag:
    """Owns how far a dry contact is stretched."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._stretch_m = 0.0

    def step(self, dt_s: float, speed_m_s: float, largest_n: float) -> float:
        """Force on what moves at `speed_m_s`."""
        self._stretch_m += dt_s * speed_m_s
        elastic_n = min(max(-DRAG_STIFFNESS_N_M * self._stretch_m, -largest_n), largest_n)
        self._stretch_m = -elastic_n / DRAG_STIFFNESS_N_M
        return min(max(elastic_n - DRAG_DAMPING_N_S_M * speed_m_s, -largest_n), largest_n)


class DragPad(NamedTuple):
    """An upright plate under the body, in the mud."""

    width_m: float
    depth_m: float

    def yield_n(self, clay: Clay, deeper_m: float = 0.0) -> float:
        """At the reference speed, with the body this much deeper than on the mud's surface."""
        depth_m = self.depth_m + deeper_m
        return clay.lateral_n(depth_m, self.width_m) if self.width_m and depth_m > 0.0 else 0.0


class RailBody:
    """Owns the body's place on the rail."""

    carriages = (None, None)

    def __init__(
        self, mass_kg: float, rail_drag_n: float, rail_damping_n_s_m: float, pad: DragPad, track: Track
    ) -> None:
        self.mass_kg = mass_kg
        self.rail_drag_n = rail_drag_n
        self.rail_damping_n_s_m = rail_damping_n_s_m
        self.pad = pad
        self.track = track
        self._drag = DryDrag()
        self.reset()

    def reset(self) -> None:
        self.forward_m = self.forward_m_s = 0.0
        self._drag.reset()

    @property
    def motion(self) -> BodyMotion:
        return BodyMotion((self.forward_m_s, 0.0, 0.0))

    def step(self, dt_s: float, left: Pusher, right: Pusher) -> None:
        thrust_n = left.force.thrust_n + right.force.thrust_n
        pad_n = self.pad.yield_n(self.track.clay_at(self.forward_m))
        largest_n = self.rail_drag_n + rate_factor(abs(self.forward_m_s)) * pad_n
        drag_n = self._drag.step(dt_s, self.forward_m_s, largest_n) - self.rail_damping_n_s_m * self.forward_m_s
        self.forward_m_s += dt_s * (thrust_n + drag_n) / self.mass_kg
        self.forward_m += dt_s * self.forward_m_s
