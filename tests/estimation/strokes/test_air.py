"""The friction of the sweep joint from swings in air, and the evidence of mud."""

from math import cos, pi

import numpy as np
import pytest

from estimation.strokes.air import AIR_NM, MEASURED_NM, SHORTEST_RAD, UNKNOWN_FRICTION_NM, AirSwing

COUNT = 200


def swung(friction_nm: float, inertia_nm: float = 0.0, air: AirSwing | None = None) -> AirSwing:
    """Feed a swing from -35 to +35 degrees, from rest to rest, with dry friction and inertia."""
    air = air or AirSwing()
    for i in range(COUNT + 1):
        time = i / COUNT
        resisting_nm = -friction_nm if 0 < i < COUNT else 0.0
        air.update(-0.6 * cos(pi * time), resisting_nm + inertia_nm * cos(pi * time))
    air.close()
    return air


@pytest.mark.parametrize("friction_nm", [0.0, 0.02, 0.06, 0.12])
@pytest.mark.parametrize("inertia_nm", [0.0, 0.3])
def test_dry_friction_is_found_under_any_inertia(friction_nm: float, inertia_nm: float) -> None:
    air = swung(friction_nm, inertia_nm)
    assert air.friction_nm == pytest.approx(friction_nm, abs=1e-3)
    assert (air.std_error_nm, air.unknown_nm, AirSwing().unknown_nm) == (MEASURED_NM, 0.0, UNKNOWN_FRICTION_NM)


def test_dragged_mud_only_adds_so_the_least_swing_counts() -> None:
    air = AirSwing()
    for dragged_nm in (0.0, 0.05, 0.08, 0.03):
        swung(0.05 + dragged_nm, air=air)
    assert air.friction_nm == pytest.approx(0.05, abs=1e-3)


def test_a_swing_through_mud_does_not_count_as_air_and_changes_nothing() -> None:
    air = swung(0.04)
    before_nm = air.friction_nm
    swung(AIR_NM + 0.1, air=air)
    assert (air.is_air, air.friction_nm) == (False, before_nm)
    assert swung(0.05, air=air).is_air


def test_a_short_movement_is_no_swing() -> None:
    air = AirSwing()
    for sweep_rad in np.linspace(0.0, 0.9 * SHORTEST_RAD, 20):
        air.update(float(sweep_rad), -0.1)
    air.close()
    assert air.std_error_nm == UNKNOWN_FRICTION_NM


@pytest.mark.parametrize(
    ("friction_nm", "stance_nm", "is_mud"),
    [(0.05, 0.07, False), (0.09, 0.12, False), (0.0, 0.03, False), (0.05, 0.44, True), (0.0, 0.12, True)],
)
def test_mud_needs_much_more_torque_than_friction(friction_nm: float, stance_nm: float, is_mud: bool) -> None:
    """In the authors' logs a stance in mud begins at 0.44 N·m, and in air it has 0.05 to 0.07 N·m."""
    assert swung(friction_nm).is_push(stance_nm) is is_mud


@pytest.mark.parametrize(("extraction_nm", "is_pull"), [(0.07, False), (0.14, False), (0.25, True)])
def test_only_mud_pulls_harder_than_any_friction(extraction_nm: float, is_pull: bool) -> None:
    assert swung(0.05).is_pull(extraction_nm) is is_pull


def test_before_any_swing_and_after_a_reset_the_friction_is_unknown() -> None:
    reset = swung(0.05)
    reset.reset()
    for air in (AirSwing(), reset):
        assert (air.friction_nm, air.std_error_nm, air.is_air) == (0.0, UNKNOWN_FRICTION_NM, True)
