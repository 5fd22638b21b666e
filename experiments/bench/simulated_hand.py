"""The hands of an operator at a simulated robot: they hold all joints and turn one at a steady speed."""

from collections import deque
from dataclasses import replace
from math import ceil

from control.rate import PERIOD_S
from experiments.bench.operator import BenchOperator, Hand
from experiments.bench.rig import SimulatedRig
from experiments.study.prompt import AutomaticOperator
from simulation.body.plant import END_STOPS_RAD

SPEED_RAD_S = 7.0
HELD_KG_M2 = 1e6  # inertia of a held joint: its own weight and its motor do not move it


class SimulatedHand(Hand):
    """Owns where the joints are held."""

    def __init__(self, rig: SimulatedRig) -> None:
        self._arms, self._joints = rig.robot.plant.arms, rig.configuration.rig.joints
        self._free = [arm.parameters for arm in self._arms]
        self._held_rad: list[float] = []  # empty: not held
        self._index = 0  # of the joint that is turned
        self._path_rad: deque[float] = deque()
        rig.others.append(lambda _: self._hold())

    @property
    def is_turning(self) -> bool:
        return bool(self._path_rad)

    def hold(self) -> None:
        self._held_rad = [0.0] * 2 * len(self._arms)
        for arm in self._arms:
            heavy = replace(arm.parameters.arm_mass, sweep_inertia_kg_m2=HELD_KG_M2, adduction_inertia_kg_m2=HELD_KG_M2)
            arm.parameters = replace(arm.parameters, arm_mass=heavy)

    def turn(self, joint: str, end: float) -> None:
        """Turn in the ticks that follow."""
        self._index = index = self._joints.index(joint)
        angle_rad = end * END_STOPS_RAD[index % 2]
        from_rad = self._path_rad[-1] if self._path_rad else self._held_rad[index]
        steps = max(1, ceil(abs(angle_rad - from_rad) / (SPEED_RAD_S * PERIOD_S)))
        self._path_rad.extend(from_rad + (angle_rad - from_rad) * step / steps for step in range(1, steps + 1))

    def release(self) -> None:
        self._held_rad = []
        for arm, free in zip(self._arms, self._free, strict=True):
            arm.parameters = free
            arm.put_back()

    def _hold(self) -> None:
        if not self._held_rad:
            return
        velocities_rad_s = [0.0] * len(self._held_rad)
        if self._path_rad:
            next_rad = self._path_rad.popleft()
            velocities_rad_s[self._index] = (next_rad - self._held_rad[self._index]) / PERIOD_S
            self._held_rad[self._index] = next_rad
        for number, arm in enumerate(self._arms):
            own = slice(2 * number, 2 * number + 2)
            arm.sweep_rad, arm.adduction_rad = self._held_rad[own]
            arm.sweep_velocity_rad_s, arm.adduction_velocity_rad_s = velocities_rad_s[own]


def simulated_operator(rig: SimulatedRig) -> BenchOperator:
    """Return an operator who allows everything, and whose hands are simulated."""
    return BenchOperator(AutomaticOperator(lambda message: None), SimulatedHand(rig), sure=True)
