"""Schedules that broke a promise once, shrunk to what mattered, each with a sentence about what was wrong.

They are kept as they were printed and not as seeds alone, because a seed draws another schedule when drawing changes.
"""

from __future__ import annotations

from typing import NamedTuple

from tests.dst.scenario import Call, Harm, Scenario, Surroundings


class Regression(NamedTuple):
    sentence: str
    scenario: Scenario


QUICK = Surroundings(configuration=(("motion.path_speed_rad_s", 3.0), ("motion.fade_in_s", 0.1)))

REGRESSIONS = (
    Regression(
        "a motor with inverted torque presses its joint against the stop while the flippers are raised",
        Scenario(
            seed=115,
            surroundings=Surroundings(strength_pa=1963, depth_m=0.03),
            start="stance",
            events=(
                Harm(at_s=0.188, name="inverted motor", joint="right_adduction", for_s=0.826),
                Call(at_s=0.189, client="pilot", method="stop"),
            ),
            for_s=1.064,
        ),
    ),
    Regression(
        "a motor with inverted torque is accelerated by its own damping",
        Scenario(
            seed=14,
            surroundings=Surroundings(strength_pa=3760, depth_m=0.026),
            start="idle",
            events=(
                Call(at_s=0.0, client="pilot", method="arm", params={"force": True}),
                Harm(at_s=0.241, name="inverted motor", joint="right_sweep", for_s=0.876),
                Call(at_s=0.378, client="pilot", method="walk"),
            ),
            for_s=1.367,
        ),
    ),
    Regression(
        "an encoder that freezes at zero speed lets its joint press against the stop",
        Scenario(
            seed=0,
            surroundings=QUICK,
            start="stance",
            events=(Harm(at_s=0.0, name="frozen encoder", joint="left_sweep", for_s=1.5),),
            for_s=1.5,
        ),
    ),
)
