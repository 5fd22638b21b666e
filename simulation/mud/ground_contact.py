"""What a plate may be in: the law of a ground, and the contact of one plate with it.

A ground is a record of parameters that a segment of the track names: clay (clay.py), or one of grounds/:
thixotropic mud and dry sand. Its state around one plate, which motion and time change, is a contact's.
"""

from abc import ABC, abstractmethod
from typing import Any, Protocol, Self

from simulation.mud.rigid_plate import NO_WRENCH, Attitude, PlateSize, Twist, Wrench, lowest_point_m


class Ground(Protocol):
    @property
    def name(self) -> str: ...

    def scaled(self, factor: float) -> Self:
        """Return the same ground, stronger or weaker."""

    def lateral_n(self, depth_m: float, width_m: float) -> float:
        """Return the sideways yield force on an upright plate at the reference speed."""

    def bearing_pa(self, depth_m: float) -> float:
        """Return the pressure under a level area that is pressed down."""

    def sticking_pa(self, depth_m: float) -> float:
        """Return the shear along a level area that is dragged."""

    def rate_factor(self, speed_m_s: float) -> float:
        """Return by how much speed raises these, 1 at the reference speed."""


class GroundContact(ABC):
    """Owns the state of the ground around one plate."""

    def __init__(self, size: PlateSize) -> None:
        self.size = size
        self._touched = False

    def reset(self) -> None:
        """Take the plate out of the ground."""
        self._touched = False

    def leaves(self, dt_s: float, attitude: Attitude) -> bool:
        """Return whether the plate is clear of the ground for this step; the ground then loses its strain."""
        if lowest_point_m(attitude, self.size) > 0.0:
            return False
        if self._touched:
            self.reset()
        return True

    def step(self, dt_s: float, ground: Any, attitude: Attitude, twist: Twist, edge_m: float = 0.0) -> Wrench:
        """`ground`: of this contact's kind; `edge_m`: position of the lower edge along the track."""
        return NO_WRENCH if self.leaves(dt_s, attitude) else self.press(dt_s, ground, attitude, twist, edge_m)

    @abstractmethod
    def press(self, dt_s: float, ground: Any, attitude: Attitude, twist: Twist, edge_m: float = 0.0) -> Wrench:
        """Step a plate that does not leave the ground."""

    def as_met(self, ground: Any) -> Any:
        """Return the ground with what earlier strokes left of it here."""
        return ground
