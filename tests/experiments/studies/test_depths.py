"""Walks at depths in turn measure how a mud changes with depth, and count what was not the mud's."""

from typing import get_type_hints

import pytest

from experiments.studies.depths import study, walk
from firmware_host.mud_learning import STORED_STRIDES

DEPTHS_M = [0.02, 0.03, 0.04]


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
