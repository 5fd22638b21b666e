"""Mud that obeys the laws of the coefficients exactly, on a stage, and the force that a load cell would feel."""

from __future__ import annotations

from random import Random

import numpy as np

from experiments.curve_fit import Array
from experiments.loadcell_fits import SHEAR, Recorded
from simulation.plate_stage import CarriedPlate, PlateStage, StageParameters

WIDTH_M, THICKNESS_M = 0.03, 0.004


class LawfulMud:
    """A CarriedPlate, upright: F = k_p V on the way down, k_e V on the way up, k_s b z²/2 along, each while it moves.

    At rest it keeps its load but for a share that fades.
    """

    def __init__(self, k_p: float, k_s: float, k_e: float, relaxation: float = 0.13) -> None:
        self.k_p, self.k_s, self.k_e, self.relaxation = k_p, k_s, k_e, relaxation
        self.reset()

    def reset(self) -> None:
        self.depth_m = -0.02
        self._forward_n = self._upward_n = self._rested = 0.0

    def step(self, dt_s: float, forward_m_s: float, upward_m_s: float) -> tuple[float, float]:
        self.depth_m -= dt_s * upward_m_s
        wet_m = max(0.0, self.depth_m)
        volume_m3 = WIDTH_M * THICKNESS_M * wet_m
        moving = abs(forward_m_s) + abs(upward_m_s) > 1e-9
        self._rested = 0.0 if moving else self._rested + (self.relaxation - self._rested) * min(1.0, dt_s / 0.2)
        if upward_m_s:
            self._upward_n = (self.k_p if upward_m_s < 0.0 else -self.k_e) * volume_m3
            self._forward_n = 0.0
        if forward_m_s:
            self._forward_n = -np.sign(forward_m_s) * self.k_s * WIDTH_M * wet_m * wet_m / 2.0
        left = 1.0 - self._rested
        return (self._forward_n * left, self._upward_n * left) if wet_m else (0.0, 0.0)


def feel(
    plate: CarriedPlate,
    kind: str,
    seed: int,
    speed_m_s: float = 0.1,
    acceleration_m_s2: float = 2.0,
    rate_hz: float = 80.0,
    noise_n: float = 0.008,
    cell_sign: float = 1.0,
    drift_n_s: float = 0.0,
) -> Recorded:
    """One trial, started at any moment."""
    random = Random(seed)
    stage = PlateStage(plate, StageParameters(acceleration_m_s2, cell_sign))
    stage.mean_force_n(0.0)
    stage.place_over(plate, kind == SHEAR)
    start_s = random.uniform(1.0, 1.3)
    if kind == SHEAR:
        plate.depth_m = 0.03
        stage.drag(start_s, 0.2, speed_m_s)
    else:
        stage.insert(start_s, 0.03, speed_m_s, 3.0)
    times_s: Array = np.arange(1.0 / rate_hz, stage.ends_s + 1.0, 1.0 / rate_hz)
    forces_n = [stage.mean_force_n(float(t)) + random.gauss(0.0, noise_n) + drift_n_s * t for t in times_s]
    return Recorded(f"made up/{kind}/{seed}", "made up", kind, times_s, np.array(forces_n), 0.0)
