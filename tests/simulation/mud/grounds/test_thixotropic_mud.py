"""Thixotropic mud softens by stroke and recovers by its own laws, and gives back no energy."""

from math import exp

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simulation.mud.clay import Clay
from simulation.mud.grounds.thixotropic_mud import ThixotropicContact, ThixotropicMud
from simulation.mud.grounds.thixotropy import Thixotropy
from simulation.mud.rigid_plate import Attitude, Twist
from tests.simulation.mud.plate_paths import SIZE, assert_no_work_is_gained, twists
from tests.simulation.mud.test_plate_contact import attitudes

DEEP, OUT = Attitude(0.03, 0.0, 1.0), Attitude(-0.01, 0.0, 1.0)
MUD = ThixotropicMud(Clay("1400 Pa", 1400.0), Thixotropy(recovery_s=50.0))
FAST = Twist(0.4)
STROKE_M = 4.8 * SIZE.width_m  # the strain of a stroke in the authors' logs


def stroke(plate: ThixotropicContact, edge_m: float = 0.0) -> float:
    """Return the structure after a stroke."""
    for _ in range(round(STROKE_M / 0.4 / 0.001)):
        plate.step(0.001, MUD, DEEP, FAST, edge_m)
    left = plate.as_met(MUD).structure
    plate.step(0.001, MUD, OUT, FAST, edge_m)
    return float(left)


def test_a_stroke_loses_17_percent_of_the_strength_and_five_lose_44() -> None:
    plate = ThixotropicContact(SIZE)
    strengths = [(1.0 + stroke(plate)) / 2.0 for _ in range(5)]
    assert 1.0 - strengths[0] == pytest.approx(0.17, abs=0.01)
    assert 1.0 - strengths[4] == pytest.approx(0.44, abs=0.02)


def test_mud_recovers_with_its_time_and_only_where_it_was_worked() -> None:
    plate = ThixotropicContact(SIZE)
    left = stroke(plate)
    for _ in range(50):
        plate.step(1.0, MUD, OUT, FAST)
    plate.step(1e-6, MUD, DEEP, FAST)
    assert 1.0 - plate.as_met(MUD).structure == pytest.approx((1.0 - left) * exp(-1.0), rel=1e-3)
    plate.step(1e-6, MUD, OUT, FAST)
    plate.step(1e-6, MUD, DEEP, FAST, 0.1)
    assert plate.as_met(MUD).structure == pytest.approx(1.0, abs=1e-5)


def test_a_load_relaxes_and_reversing_yields_earlier_than_loading() -> None:
    plate = ThixotropicContact(SIZE)
    loads = [plate.step(0.001, MUD, DEEP, Twist(0.1)).normal_n for _ in range(800)]
    back = [plate.step(0.001, MUD, DEEP, Twist(-0.1)).normal_n for _ in range(800)]
    half = next(i for i, each in enumerate(loads) if each < 0.9 * loads[-1])
    assert next(i for i, each in enumerate(back) if each > 0.9 * back[-1]) > half
    before = plate.step(0.001, MUD, DEEP, Twist()).normal_n
    after = [plate.step(0.01, MUD, DEEP, Twist()).normal_n for _ in range(300)][-1]
    assert after / before == pytest.approx(exp(-3.0 / 20.0), rel=0.01)


@settings(max_examples=15)
@given(st.lists(st.tuples(st.just(MUD), attitudes, twists, st.integers(1, 30)), max_size=8))
def test_no_path_returns_more_work_than_the_mud_received(
    path: list[tuple[ThixotropicMud, Attitude, Twist, int]],
) -> None:
    assert_no_work_is_gained(ThixotropicContact(SIZE), path)
