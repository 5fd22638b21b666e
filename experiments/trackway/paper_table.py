"""Table I of the paper: the robot's average speed in each mud of the trackway, at two fixed depths and adaptive."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Speed:
    """The mean and the standard deviation of a speed over trials, in cm/s."""

    mean: float
    sd: float


FIXED_DEPTHS_M = {"3 cm": 0.03, "5 cm": 0.05}
ADAPTIVE = "adaptive"
PAPER_TABLE: dict[str, dict[str, Speed]] = {
    "3 cm": {"48.5": Speed(7.6, 0.5), "53.1": Speed(2.1, 0.8), "45.3": Speed(7.2, 0.5)},
    "5 cm": {"48.5": Speed(6.6, 0.3), "53.1": Speed(5.5, 0.7), "45.3": Speed(3.0, 1.0)},
    ADAPTIVE: {"48.5": Speed(6.4, 0.4), "53.1": Speed(5.1, 0.3), "45.3": Speed(7.2, 0.1)},
}
