"""Coefficients from paths that are no crutching gait, through mud that keeps the laws, so that the truth is known."""

from collections.abc import Iterable, Iterator, Sequence
from math import cos, pi, radians, sin

import pytest

from control.parameters.gait_parameters import GaitParameters
from control.plate_integrals import cross_coupling, stance_moment_m4, stroke_moment_m4, submerged_plate
from control.records import Phase, StrideEstimate
from estimation.flipper import FlipperEstimator
from estimation.joint_load import FlipperDrive
from estimation.path_motion import TURNED_M, PathMotion
from estimation.strokes.shear import Base
from tests.estimation.synthetic_strides import GEOMETRY, RATE_HZ, WEIGHTLESS, Moment, Row, loaded, noisy, update, walked

K_P, K_S, K_E = 1.0e6, 0.6e6, 0.7e6
DRIVE = FlipperDrive(WEIGHTLESS, 0.083, 0.083)
KNOWN_M = 1e-6  # uncertainty of the surface: a law that bends would shift it (test_flipper.py)
DEPTH_M, HALF_S, STRIDES, MOMENT_S = 0.03, 1.0, 3, 1e-4
HIGH_M = GEOMETRY.clearance_m


def ellipse(direction: float, names_swing: bool = True) -> list[Moment]:
    """Return strides whose tip goes round an ellipse: through the mud in the lower half, above it in the upper one."""

    def pose(now_s: float) -> tuple[float, float]:
        angle = pi * now_s / HALF_S
        height_m = DEPTH_M if sin(angle) > 0.0 else HIGH_M
        sweep_rad = direction * radians(25.0) * cos(angle)
        return sweep_rad, GEOMETRY.adduction_rad(sweep_rad, height_m * sin(angle))

    moments = []
    for tick in range(1, int((2 * STRIDES + 0.5) * HALF_S * RATE_HZ)):
        now_s = tick / RATE_HZ - HALF_S  # the first half-turn is in the air
        before, here, after = (pose(now_s + shift_s) for shift_s in (-MOMENT_S, 0.0, MOMENT_S))
        speeds = [(b - a) / (2.0 * MOMENT_S) for a, b in zip(before, after, strict=True)]
        swings = names_swing and sin(pi * now_s / HALF_S) <= 0.0
        phase = Phase.SWING if swings else Phase.STROKE
        moments.append(Moment(tick / RATE_HZ, phase, *here, *speeds))
    return moments


def torques_nm(moment: Moment) -> tuple[float, float]:
    """Return the torques of the mud on (sweep, adduction) by the laws: each resists the motion that it belongs to."""
    plate = submerged_plate(GEOMETRY, moment.sweep_rad, moment.adduction_rad)
    sweep_nm = -K_S * stance_moment_m4(GEOMETRY, plate) * (1.0 if moment.sweep_rad_s > 0.0 else -1.0)
    depth_m_s = -moment.adduction_rad_s  # its sign is enough
    k = K_P if depth_m_s > 0.0 else -K_E
    across_nm = cross_coupling(GEOMETRY, plate, moment.sweep_rad) * sweep_nm
    return sweep_nm, k * stroke_moment_m4(GEOMETRY, plate, moment.sweep_rad) + across_nm


def strides_of(moments: Sequence[Moment]) -> Iterator[StrideEstimate]:
    return estimated(noisy(loaded(moments, torques_nm, DRIVE), 1, 0.05), Base.FIXED)


def estimated(rows: Iterable[Row], base: Base) -> Iterator[StrideEstimate]:
    flipper = FlipperEstimator("left", GEOMETRY, DRIVE, base, surface_error_m=KNOWN_M)
    for row in rows:
        closed = update(flipper, *row)[1]
        if closed is not None:
            yield closed


@pytest.mark.parametrize("names_swing", [True, False])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_an_ellipse_forward_or_backward_gives_the_coefficients_of_the_mud(direction: float, names_swing: bool) -> None:
    strides = list(strides_of(ellipse(direction, names_swing)))
    assert len(strides) == STRIDES
    for stride in strides[1:]:
        assert stride.stance == "yield"
        assert stride.depth_m == pytest.approx(DEPTH_M, abs=0.001)
        for estimate, truth in ((stride.k_p, K_P), (stride.k_s, K_S), (stride.k_e, K_E)):
            assert estimate.valid
            assert estimate.value == pytest.approx(truth, rel=0.02)
            assert abs(estimate.value - truth) < 2.0 * estimate.std_error


@pytest.mark.parametrize("pause_s", [0.0, 0.3])
def test_the_parts_of_a_crutching_stride_are_found_without_their_names_and_a_pause_ends_none(pause_s: float) -> None:
    moments = walked(gait=GaitParameters(pause_s=pause_s), strides=3)
    named = list(strides_of(moments))
    found = list(strides_of([m if m.phase is Phase.PAUSE else m._replace(phase=Phase.STROKE) for m in moments]))
    assert len(found) >= len(named) - 1
    for by_name, by_motion in zip(named[1:], found[1:], strict=False):
        for k in ("k_p", "k_s", "k_e"):
            one, other = getattr(by_name, k), getattr(by_motion, k)
            assert abs(one.value - other.value) < one.std_error, k


def test_a_path_goes_down_up_and_on_in_the_air() -> None:
    motion = PathMotion()
    depths_m = [-0.01, -0.012, -0.011, 0.0, 0.02, 0.0199, 0.019, 0.005, -0.001, -0.002, 0.0]
    parts = [motion.update(depth_m, depth_m > 0.0).name for depth_m in depths_m]
    down, up, swing = "INSERTION", "EXTRACTION", "SWING"
    assert parts == [swing, swing, down, down, down, down, up, up, swing, swing, down]


def test_an_edge_that_swings_on_after_it_came_out_begins_no_insertion() -> None:
    motion = PathMotion()
    for depth_m in (-0.01, 0.03, 0.02, -0.014, -0.016):
        motion.update(depth_m, depth_m > 0.0)
    parts = [motion.update(depth_m, False).name for depth_m in (-0.014, -0.0135, -0.014, -0.0118)]
    assert parts == ["SWING", "SWING", "SWING", "INSERTION"]


def test_noise_turns_no_path() -> None:
    motion = PathMotion()
    falling_m = [-0.01 + 1e-4 * i + (0.4 * TURNED_M if i % 2 else -0.4 * TURNED_M) for i in range(300)]
    parts = [motion.update(depth_m, depth_m > 0.0) for depth_m in falling_m]
    assert parts[-1] is Phase.INSERTION
    assert Phase.EXTRACTION not in parts


def test_a_bound_of_a_path_is_that_of_its_deep_part() -> None:
    """Mud of one pressure everywhere holds the plate while the body moves: a shallow plate seems to meet firmer mud.

    The flipper goes down and up slowly, as in an alternating gait, so the shallow part is long.
    """
    pressure_pa = 2000.0

    def even_nm(moment: Moment) -> tuple[float, float]:
        plate = submerged_plate(GEOMETRY, moment.sweep_rad, moment.adduction_rad)
        sweep_nm = pressure_pa * (GEOMETRY.flipper_length_m * plate.area_m2 + plate.area_outward_m3)
        return sweep_nm, cross_coupling(GEOMETRY, plate, moment.sweep_rad) * sweep_nm

    slow = GaitParameters(insertion_speed_m_s=0.02, extraction_speed_m_s=0.02)
    moments = [moment._replace(phase=Phase.STROKE) for moment in walked(gait=slow, strides=3)]
    tilted = [m._replace(sweep_rad=m.sweep_rad - 10.0 * m.depth_m) for m in moments]  # sweeps on its way down
    rows = loaded(tilted, even_nm, DRIVE)
    held = [row._replace(body_m=-GEOMETRY.flipper_length_m * sin(row.sweep.angle_rad)) for row in rows]
    strides = list(estimated(held, Base.FREE))
    assert len(strides) == 3
    for stride in strides:
        assert (stride.stance, stride.k_s.at_least) == ("limited_by_body", True)
        assert stride.k_s.value <= 2.0 * pressure_pa / (0.7 * DEPTH_M)  # of a plate that reaches 0.7 of the depth
