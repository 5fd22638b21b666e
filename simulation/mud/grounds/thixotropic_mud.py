"""A mud that softens while it is worked and recovers at rest: MIKH, in the form that rheojax documents.

MIKH is visco-elastic and thixotropic, with isotropic and kinematic hardening. With the structure λ, 1 in rested mud,

    λ' = (1 - λ)/τ - Γ λ |γ'|        s(λ) = s_u (1 + λ)/2        γ' = |v| / width of the plate
    σ' = G γ' - σ/T below the yield stress, whose middle is the backstress; above it the stress grows by η γ'

Its stresses act on a plate as those of clay with the strength s(λ) do; suction remains 9 s. Two sets of the clay's
springs side by side make the backstress (Iwan's model): HARDENING of the strength yields REACH times later than the
rest, and what it carries then is the middle about which the rest yields. Both are passive.
A plate that comes back within SAME_POSITION_M of an earlier stroke finds what that stroke left, and what recovered.
"""

from __future__ import annotations

from collections import deque
from math import exp
from typing import NamedTuple

from simulation.mud.clay import Clay
from simulation.mud.disturbances import SAME_POSITION_M
from simulation.mud.ground_contact import GroundContact
from simulation.mud.grounds.thixotropy import Thixotropy
from simulation.mud.mud_springs import PlateStep
from simulation.mud.plate_contact import PlateContact
from simulation.mud.rigid_plate import Attitude, PlateSize, Twist, Wrench, speed_of_edge_m_s

HARDENING, REACH = 0.3, 2.0  # all has yielded after 3 cm, as in the authors' logs
REMEMBERED = 100  # strokes


class ThixotropicMud(NamedTuple):
    clay: Clay
    thixotropy: Thixotropy = Thixotropy()
    structure: float = 1.0  # λ where no stroke was

    @property
    def name(self) -> str:
        return self.clay.name

    def scaled(self, factor: float) -> ThixotropicMud:
        return self._replace(clay=self.clay.scaled(factor))

    def lateral_n(self, depth_m: float, width_m: float) -> float:
        return self.clay.lateral_n(depth_m, width_m)

    def bearing_pa(self, depth_m: float) -> float:
        return self.clay.bearing_pa(depth_m)

    def sticking_pa(self, depth_m: float) -> float:
        return self.clay.sticking_pa(depth_m)

    @staticmethod
    def rate_factor(speed_m_s: float) -> float:
        return 1.0


class Worked(NamedTuple):
    """What a stroke left."""

    edge_m: float
    structure: float
    left_s: float


class ThixotropicContact(GroundContact):
    """Owns the mud around one plate, and the structure that its strokes left along the track."""

    def __init__(self, size: PlateSize) -> None:
        super().__init__(size)
        self._parts = (1.0 - HARDENING, PlateContact(size)), (HARDENING, PlateContact(size, reach=REACH))
        self._worked: deque[Worked] = deque(maxlen=REMEMBERED)
        self._now_s = self._entered_m = 0.0
        self._structure = 1.0

    def reset(self) -> None:
        if self._touched:
            self._worked.append(Worked(self._entered_m, self._structure, self._now_s))
        for _, part in self._parts:
            part.reset()
        super().reset()

    def leaves(self, dt_s: float, attitude: Attitude) -> bool:
        self._now_s += dt_s
        return super().leaves(dt_s, attitude)

    def press(
        self, dt_s: float, ground: ThixotropicMud, attitude: Attitude, twist: Twist, edge_m: float = 0.0
    ) -> Wrench:
        if not self._touched:
            self._touched, self._entered_m, self._structure = True, edge_m, self._found(ground, edge_m)
        known, strain_rate = ground.thixotropy, speed_of_edge_m_s(twist) / self.size.width_m
        recovery = dt_s * (1.0 - self._structure) / known.recovery_s
        self._structure = (self._structure + recovery) / (1.0 + dt_s * known.loss_per_strain * strain_rate)
        clay = ground.clay.scaled((1.0 + self._structure) / 2.0)
        rate = 1.0 + known.viscosity_pa_s * strain_rate / clay.strength_pa
        wrench = [0.0] * len(Wrench._fields)
        for weight, part in self._parts:
            part.fade(exp(-dt_s / known.relaxation_s))
            forces = part.wrench(PlateStep(dt_s, clay, rate, attitude, twist))
            wrench = [total + weight * force for total, force in zip(wrench, forces, strict=True)]
        return Wrench(*wrench)

    def as_met(self, ground: ThixotropicMud) -> ThixotropicMud:
        return ground._replace(structure=self._structure)

    def _found(self, ground: ThixotropicMud, edge_m: float) -> float:
        for earlier in reversed(self._worked):
            if abs(edge_m - earlier.edge_m) <= SAME_POSITION_M:
                rested = exp((earlier.left_s - self._now_s) / ground.thixotropy.recovery_s)
                return 1.0 - (1.0 - earlier.structure) * rested
        return ground.structure
