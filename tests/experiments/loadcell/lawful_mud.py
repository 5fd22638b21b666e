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


class LawfulMud:
    """An upright CarriedPlate: while it moves, F = k_p V downward, k_e V upward, and k_s b z²/2 along its path.

    At rest it keeps its load except for the fraction `relaxation`, which fades.
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
) -> Recorded:
    """Return one trial of a motorised stage that starts at a random time."""
    random = Random(seed)
    stage = PlateStage(plate, StageParameters(acceleration_m_s2))
    stage.mean_force_n(0.0)
    stage.move_over(plate, kind == SHEAR)
    _start(stage, plate, kind, random.uniform(1.0, 1.3), speed_m_s)
    return _heard(stage, kind, seed, random)


def feel_by_hand(
    plate: CarriedPlate,
    kind: str,
    seed: int,
    lag_s: float = 0.012,
    jitter_s: float = 0.0015,
) -> Recorded:
    """Return one trial of a manual stage with an encoder; forces are stamped later by `lag_s`."""
    random = Random(seed)
    stage = PlateStage(plate, StageParameters(manual=ManualMotionParameters(), seed=seed))
    stage.mean_force_n(0.0)
    stage.move_over(plate, kind == SHEAR)
    _start(stage, plate, kind, random.uniform(1.0, 1.3), 0.1)
    felt = _heard(stage, kind, seed, random)
    times_s = np.arange(0.003, stage.ends_s + 1.05, 0.01)
    positions_m = COUNT_M * np.round([stage.travelled_m(float(t)) / COUNT_M for t in times_s])
    reported = StagePositions(_jittered(times_s, jitter_s, random), positions_m)
    return felt._replace(times_s=_jittered(felt.times_s, jitter_s, random) + lag_s, positions=reported)


def _jittered(times_s: Array, jitter_s: float, random: Random) -> Array:
    reported = [t + random.gauss(0.0, jitter_s) for t in times_s]
    return np.asarray(np.maximum.accumulate(reported) + 1e-9 * np.arange(len(reported)))


def _start(stage: PlateStage, plate: CarriedPlate, kind: str, start_s: float, speed_m_s: float) -> None:
    if kind == SHEAR:
        plate.depth_m = 0.03
        stage.drag(start_s, 0.2, speed_m_s)
    else:
        stage.insert(start_s, 0.03, speed_m_s, 3.0)


def _heard(stage: PlateStage, kind: str, seed: int, random: Random) -> Recorded:
    times_s: Array = np.arange(1.0 / RATE_HZ, stage.ends_s + 1.0, 1.0 / RATE_HZ)
    forces_n = [stage.mean_force_n(float(t)) + random.gauss(0.0, NOISE_N) for t in times_s]
    return Recorded(f"lawful/{kind}/{seed}", "lawful", kind, StageSettings(), times_s, np.array(forces_n), 0.0)
