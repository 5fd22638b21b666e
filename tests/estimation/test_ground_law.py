"""Which law a ground follows, from how its three coefficients compare."""

from collections.abc import Mapping
from math import exp
from random import Random

import pytest

from control.geometry import FlipperGeometry
from control.mud_estimate import Coefficient, FlipperEstimate, MudEstimate
from estimation.ground_law import ACROSS, COEFFICIENTS, DOWN, LAWS, UNDECIDED, UP, law_evidence, law_of_estimate

GEOMETRY = FlipperGeometry()
STRENGTHS = {"mud": 2000.0, "sand": 1.8e6}  # Pa; N/m³
DEPTHS_M = {"k_p": 0.029, "k_s": 0.030, "k_e": 0.022}


def readings(law: str, depth: float = 1.0) -> dict[str, tuple[float, float]]:
    """Return the coefficients of a ground by its law."""
    found = {}
    for name, depth_m in DEPTHS_M.items():
        unit = LAWS[law](name, GEOMETRY.plate_width_m, GEOMETRY.plate_thickness_m, depth * depth_m)
        found[name] = (STRENGTHS[law] * unit, depth * depth_m)
    return found


@pytest.mark.parametrize("depth", [0.5, 1.0, 1.6])
@pytest.mark.parametrize("law", LAWS)
def test_a_ground_that_keeps_a_law_is_named_at_any_depth(law: str, depth: float) -> None:
    evidence = law_evidence(GEOMETRY, readings(law, depth))
    assert evidence is not None
    assert evidence.name == law
    assert evidence.errors[law] == pytest.approx(0.0, abs=1e-9)


def test_grounds_that_differ_from_their_law_are_seldom_named_wrong() -> None:
    random, named = Random(1), dict.fromkeys((*LAWS, UNDECIDED, "wrong"), 0)
    for number in range(400):
        law = "mud" if number % 2 else "sand"
        scattered = {name: (k * exp(random.gauss(0.0, 0.3)), z) for name, (k, z) in readings(law).items()}
        evidence = law_evidence(GEOMETRY, scattered)
        assert evidence is not None
        named[evidence.name if evidence.name in (law, UNDECIDED) else "wrong"] += 1
    assert named["wrong"] <= 8
    assert named["mud"] + named["sand"] >= 280


@pytest.mark.parametrize("missing", COEFFICIENTS)
def test_two_coefficients_show_no_law(missing: str) -> None:
    known = readings("mud")
    assert law_evidence(GEOMETRY, {name: each for name, each in known.items() if name != missing}) is None
    assert law_evidence(GEOMETRY, known | {missing: (0.0, 0.03)}) is None


def test_a_lower_bound_shows_no_law() -> None:
    def estimate(bounds: Mapping[str, bool]) -> MudEstimate:
        own = FlipperEstimate(
            **{
                name: Coefficient(k, 0.1 * k, 0.1 * k, depth_m, -0.5, 0.3, 3, bounds.get(name, False))
                for name, (k, depth_m) in readings("mud").items()
            }
        )
        return MudEstimate(k_p=own.k_p, k_s=own.k_s, k_e=own.k_e)

    evidence = law_of_estimate(GEOMETRY, estimate({}))
    assert evidence is not None and evidence.name == "mud"
    assert law_of_estimate(GEOMETRY, estimate({"k_s": True})) is None


def test_the_constants_of_sand_are_those_of_the_published_map() -> None:
    a00, a10, b11, b01, b_11 = 0.206, 0.169, 0.212, 0.358, 0.055  # of Li's generic coefficients, in N/cm³
    c11, c01, c_11 = -0.124, 0.253, 0.007
    assert pytest.approx(a00 - a10 + b01 - b11 - b_11, abs=1e-9) == DOWN  # tilt and direction of π/2
    assert pytest.approx(-(a00 - a10 - b01 + b11 + b_11), abs=1e-9) == UP
    assert pytest.approx(c01 - c11 - c_11, abs=1e-9) == ACROSS
