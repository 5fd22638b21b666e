"""A mud that follows the laws of the coefficients exactly, and the force that a load cell on a stage measures in it."""

from random import Random

import numpy as np

from experiments.loadcell.curve_fit import Array
from experiments.loadcell.strokes import SHEAR, Recorded, StagePositions, StageSettings
from simulation.test_rig.plate_stage import CarriedPlate, PlateStage, StageParameters
from simulation.test_rig.stage_motion import ManualMotionParameters

WIDTH_M, THICKNESS_M = 0.03, 0.004
RATE_HZ, NOISE_N = 80.0, 0.008  # of the cell
COUNT_M = 1e-5  # of the encoder
LAG_S = 0.012  # of forces after positions, of a stage that is pushed by hand
KNOWN = {"k_p": 1.0e6, "k_s": 0.6e6, "k_e": 1.3e6}


class LawfulMud:
    """An upright CarriedPlate: while it moves, F = k_p V downward, k_e V upward, and k_s b z²/2 along its path.

    At rest it keeps its load except for the fraction `relaxation`, which fades.
    """

    relaxation = 0.13

    def __init__(self, k_p: float = KNOWN["k_p"], k_s: float = KNOWN["k_s"], k_e: float = KNOWN["k_e"]) -> None:
        self.k_p, self.k_s, self.k_e = k_p, k_s, k_e
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


def feel(plate: CarriedPlate, kind: str, seed: int, speed_m_s: float = 0.1, acceleration_m_s2: float = 2.0) -> Recorded:
    """Return one trial of a motorised stage that starts at a random time."""
    felt, _, _ = _feel(plate, kind, seed, StageParameters(acceleration_m_s2), speed_m_s)
    return felt


def feel_by_hand(plate: CarriedPlate, kind: str, seed: int, jitter_s: float = 0.0015) -> Recorded:
    """Return one trial of a manual stage with an encoder."""
    felt, stage, random = _feel(plate, kind, seed, StageParameters(manual=ManualMotionParameters(), seed=seed))
    times_s = np.arange(0.003, stage.ends_s + 1.05, 0.01)
    positions_m = COUNT_M * np.round([stage.travelled_m(float(t)) / COUNT_M for t in times_s])
    reported = StagePositions(_jittered(times_s, jitter_s, random), positions_m)
    return felt._replace(times_s=_jittered(felt.times_s, jitter_s, random) + LAG_S, positions=reported)


def _jittered(times_s: Array, jitter_s: float, random: Random) -> Array:
    reported = [t + random.gauss(0.0, jitter_s) for t in times_s]
    return np.asarray(np.maximum.accumulate(reported) + 1e-9 * np.arange(len(reported)))


def _feel(
    plate: CarriedPlate, kind: str, seed: int, parameters: StageParameters, speed_m_s: float = 0.1
) -> tuple[Recorded, PlateStage, Random]:
    random, stage = Random(seed), PlateStage(plate, parameters)
    stage.mean_force_n(0.0)
    stage.move_over(plate, kind == SHEAR)
    start_s = random.uniform(1.0, 1.3)
    if kind == SHEAR:
        plate.depth_m = 0.03
        stage.drag(start_s, 0.2, speed_m_s)
    else:
        stage.insert(start_s, 0.03, speed_m_s, 3.0)
    times_s: Array = np.arange(1.0 / RATE_HZ, stage.ends_s + 1.0, 1.0 / RATE_HZ)
    forces_n = np.array([stage.mean_force_n(float(t)) + random.gauss(0.0, NOISE_N) for t in times_s])
    key = f"lawful/{kind}/{seed}"
    return Recorded(key, "lawful", kind, StageSettings(), times_s, forces_n, 0.0), stage, random
