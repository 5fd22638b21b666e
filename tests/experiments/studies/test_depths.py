"""Walks at depths in turn measure how a mud changes with depth, and count what was not the mud's."""

from typing import get_type_hints

import pytest
from pandas import DataFrame

from control.controller import WalkOrder
from control.modes import Mode
from experiments.reports.depth_law import CONSTANT_FORCE, fit_depth_law
from experiments.robot.lockstep_robot import simulated_configuration
from experiments.studies.depths import study, walk
from firmware_host.mud_learning import STORED_STRIDES
from simulation.harness.lockstep import Lockstep
from simulation.harness.world import parse_world

DEPTHS_M = [0.02, 0.03, 0.04]
STALLED = """
[[segment]]
start_m = 0.0
end_m = 10.0
strength_pa = 2800.0

[robot]
free_body = true
"""


def test_the_exponent_of_the_simulated_clay_is_found_in_six_strides() -> None:
    """A plate in uniform clay meets 0.47, 0.34 and 0.25 N/cm³ of shear at 20, 30 and 40 mm: exponents -0.8 to -1.1."""
    found = walk(800.0, 1, DEPTHS_M, 6)
    assert found["k_s"]["exponent"] == pytest.approx(-0.95, abs=0.15 + 2.0 * found["k_s"]["std_error"])
    assert all(found[name]["values"] == 12 and found[name]["std_error"] < 0.3 for name in ("k_p", "k_s", "k_e"))


def test_the_loop_stores_every_stride_of_the_longest_walk() -> None:
    (option,) = get_type_hints(study, include_extras=True)["strides"].__metadata__
    assert 2 * option.high <= STORED_STRIDES


def test_firm_mud_in_which_the_motors_give_way_has_bounds_and_no_law() -> None:
    found = walk(3600.0, 1, DEPTHS_M, 3)["k_s"]
    assert (found["values"], found["bounds"]) == (0, 6) and found["exponent"] != found["exponent"]


def test_stalled_motors_would_be_a_constant_force_if_their_stances_counted_as_yield() -> None:
    """Taken as values, k_s of the walks of January falls with depth to the power -2.3; as bounds they have no law."""
    configuration, world = simulated_configuration(), parse_world(STALLED)
    robot = Lockstep(configuration, world.track, plant=world.plant(configuration))
    robot.arm()
    robot.walk(WalkOrder(DEPTHS_M[0], adaptive=False, strides=6, depths_m=tuple(DEPTHS_M)))
    robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 18.0)
    found = [closed.estimate.k_s for closed in robot.loop.learning.strides]
    assert len(found) == 12 and not any(each.valid and not each.at_least for each in found)
    columns = ["value", "repeatability", "depth_m"]
    law = fit_depth_law(DataFrame([[getattr(each, key) for key in columns] for each in found], columns=columns))
    assert law is not None and abs(law.exponent - CONSTANT_FORCE) < 2.0 * law.std_error < 0.5
