"""Which law a ground follows, from how its three coefficients compare."""

from math import exp
from random import Random
from typing import Any

import pytest

from control.geometry import FlipperGeometry
from control.records import UNKNOWN, Estimate
from estimation.ground_law import (
    ACROSS,
    DOWN,
    EDGE_DOWN,
    FACE_ACROSS,
    LAWS,
    UNDECIDED,
    UP,
    law_evidence,
    readings_of,
)
from simulation.mud.grounds.sand import Sand

GEOMETRY = FlipperGeometry()
STRENGTHS = {"mud": 2000.0, "sand": 1.8e6}  # Pa; N/m³
DEPTHS_M = {"k_p": 0.029, "k_s": 0.030, "k_e": 0.022}


FORMS = [(law, form) for law, forms in LAWS.items() for form in range(len(forms))]


def readings(law: str, depth: float = 1.0, form: int = 0) -> dict[str, tuple[float, float]]:
    """Return the coefficients of a ground by its law."""
    found = {}
    for name, depth_m in DEPTHS_M.items():
        unit = LAWS[law][form](name, GEOMETRY.plate_width_m, GEOMETRY.plate_thickness_m, depth * depth_m)
        found[name] = (STRENGTHS[law] * unit, depth * depth_m)
    return found


@pytest.mark.parametrize("depth", [0.5, 1.0, 1.6])
@pytest.mark.parametrize(("law", "form"), FORMS)
def test_a_ground_that_keeps_a_law_is_named_at_any_depth(law: str, form: int, depth: float) -> None:
    evidence = law_evidence(GEOMETRY, readings(law, depth, form))
    assert evidence is not None
    assert evidence.name == law
    assert evidence.errors[law] == pytest.approx(0.0, abs=1e-9)


def test_grounds_that_differ_from_their_law_are_seldom_named_wrong() -> None:
    random, named = Random(1), dict.fromkeys((*LAWS, UNDECIDED, "wrong"), 0)
    for number in range(400):
        law, form = FORMS[number % len(FORMS)]
        scattered = {name: (k * exp(random.gauss(0.0, 0.3)), z) for name, (k, z) in readings(law, form=form).items()}
        evidence = law_evidence(GEOMETRY, scattered)
        assert evidence is not None
        named[evidence.name if evidence.name in (law, UNDECIDED) else "wrong"] += 1
    assert named["wrong"] <= 8
    assert named["mud"] + named["sand"] >= 280


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("missing", ["k_p", "k_s"])
def test_the_extraction_and_one_other_coefficient_suffice(missing: str, law: str) -> None:
    known = {name: each for name, each in readings(law).items() if name != missing}
    evidence = law_evidence(GEOMETRY, known)
    assert evidence is not None and evidence.name == law


@pytest.mark.parametrize("known", [["k_p", "k_s"], ["k_e"], []])
def test_nothing_is_said_without_the_extraction_and_another_coefficient(known: list[str]) -> None:
    found = readings("mud")
    assert law_evidence(GEOMETRY, {name: found[name] for name in known}) is None
    assert law_evidence(GEOMETRY, {name: found[name] for name in known} | {"k_e": (0.0, 0.02)}) is None


def estimates(law: str, **changes: dict[str, Any]) -> list[tuple[str, Estimate]]:
    found = []
    for name, (k, depth_m) in readings(law).items():
        plain = Estimate(k, 0.1 * k, 9, True, repeatability=0.1 * k, depth_m=depth_m)
        found.append((name, plain._replace(**changes.get(name, {}))))
    return found


def test_lower_bounds_are_left_out() -> None:
    bound = {"at_least": True}
    assert set(readings_of(estimates("mud", k_s=bound))) == {"k_p", "k_e"}
    assert law_evidence(GEOMETRY, readings_of(estimates("mud", k_s=bound, k_p=bound))) is None


def test_the_one_value_of_a_stride_that_swept_into_another_mud_is_left_out() -> None:
    bounded = estimates("mud", k_s={"at_least": True})
    swept = estimates("mud", k_s={"value": 0.2 * dict(estimates("mud"))["k_s"].value})
    assert set(readings_of([*bounded, *bounded, *swept])) == {"k_p", "k_e"}
    assert set(readings_of([*bounded, *swept])) == {"k_p", "k_s", "k_e"}


def test_an_extraction_that_is_too_faint_to_be_told_from_nothing_is_that_of_sand() -> None:
    faint = {"value": 1e4, "std_error": 2e4, "valid": False}
    evidence = law_evidence(GEOMETRY, readings_of(estimates("sand", k_e=faint)))
    assert evidence is not None and evidence.name != "mud"
    unknown = {"value": UNKNOWN, "std_error": UNKNOWN, "valid": False}
    assert "k_e" not in readings_of(estimates("sand", k_e=unknown))


def test_the_constants_of_sand_are_those_of_the_published_map() -> None:
    a00, a10, b11, b01, b_11 = 0.206, 0.169, 0.212, 0.358, 0.055  # of Li's generic coefficients, in N/cm³
    c11, c01, c_11 = -0.124, 0.253, 0.007
    assert pytest.approx(a00 - a10 + b01 - b11 - b_11, abs=1e-9) == DOWN  # tilt and direction of π/2
    assert pytest.approx(-(a00 - a10 - b01 + b11 + b_11), abs=1e-9) == UP
    assert pytest.approx(c01 - c11 - c_11, abs=1e-9) == ACROSS


def test_the_constants_of_sands_surfaces_are_those_of_the_published_map() -> None:
    sand, up = Sand("sand", 1.0, spatial=True), (0.0, 0.0, 1.0)
    assert sand.resistance((0.0, 0.0, -1.0), up, (0.0, 0.0, -1.0))[2] == pytest.approx(-EDGE_DOWN, abs=1e-9)
    assert sand.resistance((1.0, 0.0, 0.0), up, (1.0, 0.0, 0.0))[0] == pytest.approx(FACE_ACROSS, abs=5e-4)
