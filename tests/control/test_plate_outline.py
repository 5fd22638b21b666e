"""The outline of a plate: which corners are refused, how a plate is turned when mounted, and its deepest corner."""

from math import cos, hypot, radians, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from control.plate_outline import Corner, mounted_outline, outline_problems, rectangle, signed_area_m2

SQUARE = ((-0.01, 0.0), (0.01, 0.0), (0.01, 0.02), (-0.01, 0.02))
PLUS = ((0.0, 0.0), (0.01, 0.02), (0.02, 0.0), (0.02, 0.05), (0.0, 0.05))  # a notch is no fault


@pytest.mark.parametrize("corners", [SQUARE, SQUARE[::-1], PLUS, rectangle(0.025, 0.07), SQUARE[1:]])
def test_a_plate_of_three_or_more_corners_around_it_is_accepted(corners: tuple[Corner, ...]) -> None:
    assert list(outline_problems(corners)) == []


@pytest.mark.parametrize(
    ("corners", "named"),
    [
        (SQUARE[:2], "2 corners"),
        (tuple((0.001 * n, 0.0) for n in range(65)), "65 corners"),
        ((SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]), "corner 1 to 2 crosses"),
        ((SQUARE[0], SQUARE[1], SQUARE[1], SQUARE[2]), "crosses or touches"),  # one corner twice
        ((*SQUARE[:3], (0.01, 0.01)), "crosses or touches"),  # folds back on its side
        ((*SQUARE[:3], (0.01, 0.005), (-0.01, 0.02)), "crosses or touches"),
        (((0.0, 0.0), (0.02, 0.02), (0.01, 0.01)), "crosses or touches"),  # without width
        (tuple((0.01, s) for _, s in SQUARE), "0 m wide"),
        (tuple((u, 0.0) for u, _ in SQUARE), "0 m high"),
        (tuple((1000.0 * u, 1000.0 * s) for u, s in SQUARE), "in m"),  # in mm
        (tuple((u, -s) for u, s in SQUARE), "corner 3: -0.02 m upward"),
        (tuple((u, s + 0.01) for u, s in SQUARE), "the lowest corner is 0.01 m up"),
    ],
)
def test_other_corners_are_refused(corners: tuple[Corner, ...], named: str) -> None:
    assert named in " ".join(outline_problems(corners))


@given(st.floats(-45.0, 45.0), st.permutations(range(2)))
def test_mounting_turns_the_plate_and_keeps_its_lowest_corner_at_the_drop(angle_deg: float, order: list[int]) -> None:
    corners = (SQUARE, SQUARE[::-1])[order[0]]
    mounted = mounted_outline(corners, angle_deg).corners
    assert min(upward_m for _, upward_m in mounted) == 0.0
    assert signed_area_m2(mounted) == pytest.approx(0.0004)
    sides_m = [hypot(b[0] - a[0], b[1] - a[1]) for a, b in zip(mounted, [*mounted[1:], mounted[0]], strict=True)]
    assert sides_m == pytest.approx([0.02] * 4)


def test_a_positive_angle_moves_the_lower_end_outward() -> None:
    plate = FlipperGeometry(plate_angle_deg=30.0).plate
    top = max(plate.corners, key=lambda corner: corner[1])
    bottom = min(plate.corners, key=lambda corner: corner[1])
    assert top[0] < bottom[0]
    assert plate.height_m == pytest.approx(0.07 * cos(radians(30.0)) + 0.025 * sin(radians(30.0)))
    assert plate.width_m == pytest.approx(0.07 * sin(radians(30.0)) + 0.025 * cos(radians(30.0)))


@given(st.floats(-0.9, 0.9), st.floats(0.05, 1.0), st.sampled_from([SQUARE, PLUS]), st.floats(-45.0, 45.0))
def test_the_deepest_corner_is_the_deepest_of_all(
    per_outward: float, per_upward: float, corners: tuple[Corner, ...], angle_deg: float
) -> None:
    plate = mounted_outline(corners, angle_deg)
    deepest_m = max(per_outward * u - per_upward * s for u, s in plate.corners)
    assert plate.below_origin_m(per_outward, per_upward) == pytest.approx(deepest_m, abs=1e-15)


@given(st.floats(-1.0, 1.0), st.floats(0.0, 1.0), st.floats(0.002, 0.5))
def test_a_rectangles_deepest_corner_is_to_the_last_digit_half_its_width_off(
    per_outward: float, per_upward: float, width_m: float
) -> None:
    plate = FlipperGeometry(plate_width_m=width_m).plate
    if abs(per_outward) > 1e-300 or not per_outward:
        assert plate.below_origin_m(per_outward, per_upward) == abs(per_outward) * width_m / 2.0
