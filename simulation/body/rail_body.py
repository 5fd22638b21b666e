"""The body on its rail: one degree of freedom, held elastically by dry friction until that yields.

The drags of the rail and of the pad in the mud add up to one yield force. Below it a spring carries the load, with a
damping of half of critical for the paper's body, so that nothing rings. While the body slides, drag grows with speed.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from control.limits import clip
from control.records import TWO_FLIPPERS, Rig
from simulation.mud.carriage import Carriage
from simulation.mud.flipper_contact import ContactForce
from simulation.mud.ground_contact import Ground
from simulation.mud.track import Track
from simulation.mud.vectors import Vector

DRAG_STIFFNESS_N_M = 5000.0
DRAG_DAMPING_N_S_M = 71.0


class BodyMotion(NamedTuple):
    """Motion of the centre of mass in the world, and of the body about it.

    Axes are x forward, y to the left, z up; turning follows the right hand, so a positive roll raises the left side
    and a positive pitch lowers the nose.
    """

    velocity_m_s: Vector
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad_s: float = 0.0
    pitch_rad_s: float = 0.0


class Pusher(Protocol):
    """A flipper's load on the body."""

    force: ContactForce
    sweep_rad: float
    adduction_rad: float


class Body(Protocol):
    """A body that carries the flippers."""

    forward_m: float
    forward_m_s: float

    def reset(self) -> None: ...

    def put_down(self) -> None: ...

    @property
    def carriages(self) -> Sequence[Carriage | None]:
        """How it carries each flipper; None for a body that only moves forward."""

    @property
    def motion(self) -> BodyMotion: ...

    def step(self, dt_s: float, *flippers: Pusher) -> None: ...


class DryDrag:
    """Owns the elastic stretch of a dry contact."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._stretch_m = 0.0

    def step(self, dt_s: float, speed_m_s: float, largest_n: float) -> float:
        """Return the force on a body that moves at `speed_m_s`."""
        self._stretch_m += dt_s * speed_m_s
        elastic_n = clip(-DRAG_STIFFNESS_N_M * self._stretch_m, -largest_n, largest_n)
        self._stretch_m = -elastic_n / DRAG_STIFFNESS_N_M
        return clip(elastic_n - DRAG_DAMPING_N_S_M * speed_m_s, -largest_n, largest_n)


class DragPad(NamedTuple):
    """An upright plate under the body, in the mud."""

    width_m: float
    depth_m: float

    def yield_n(self, ground: Ground, deeper_m: float = 0.0) -> float:
        """Return the yield force at the reference speed, with the body `deeper_m` below the mud's surface."""
        depth_m = self.depth_m + deeper_m
        return ground.lateral_n(depth_m, self.width_m) if self.width_m and depth_m > 0.0 else 0.0


class RailBody:
    """Owns the body's position on the rail."""

    def __init__(
        self,
        mass_kg: float,
        rail_drag_n: float,
        rail_damping_n_s_m: float,
        pad: DragPad,
        track: Track,
        rig: Rig = TWO_FLIPPERS,
    ) -> None:
        self.carriages = (None,) * len(rig.flippers)
        self.mass_kg = mass_kg
        self.rail_drag_n = rail_drag_n
        self.rail_damping_n_s_m = rail_damping_n_s_m
        self.pad = pad
        self.track = track
        self._drag = DryDrag()
        self._pad_ground: Ground | None = None  # for which `_pad_n` was computed
        self._pad_n = 0.0
        self.reset()

    def reset(self) -> None:
        self.forward_m = self.forward_m_s = 0.0
        self._drag.reset()

    def put_down(self) -> None:
        """Do nothing: on its rail the body can neither overturn nor sink."""

    @property
    def motion(self) -> BodyMotion:
        return BodyMotion((self.forward_m_s, 0.0, 0.0))

    def step(self, dt_s: float, *flippers: Pusher) -> None:
        thrust_n = 0.0
        for flipper in flippers:
            thrust_n += flipper.force.thrust_n
        ground = self.track.ground_at(self.forward_m)
        if ground is not self._pad_ground:
            self._pad_ground, self._pad_n = ground, self.pad.yield_n(ground)
        largest_n = self.rail_drag_n + ground.rate_factor(abs(self.forward_m_s)) * self._pad_n
        drag_n = self._drag.step(dt_s, self.forward_m_s, largest_n) - self.rail_damping_n_s_m * self.forward_m_s
        self.forward_m_s += dt_s * (thrust_n + drag_n) / self.mass_kg
        self.forward_m += dt_s * self.forward_m_s
