"""The choice of depth and sweep together in synthetic muds, against a search of every pair."""

from dataclasses import replace
from math import nan, radians

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from control.computing.bounded_work import finish
from control.depth.depth_choice import DepthChoice, body_drag
from control.depth.forecast import DepthForecast
from control.depth.gait_choice import SWEEP_STEP_DEG, WIDENING_DEG, GaitAdaptation, quickest
from control.depth.step_model import Traction, carried_m, motion_of
from control.gait.gait import Gait
from control.gait.stride_table import stride_duration_s
from control.mud_estimate import NOTHING_KNOWN, Coefficient, MudEstimate
from control.parameters.adaptation_parameters import AdaptationParameters, GaitAdaptationParameters
from control.parameters.gait_parameters import GaitParameters
from control.parameters.joint_limits import JointLimits
from control.plate_integrals import stroke_moment_m4, submerged_plate
from control.records import Estimate, StrideEstimate
from tests.control import synthetic_muds
from tests.control.synthetic_muds import GAIT, GEOMETRY, LIFTING_NM, both, choose_now

PARAMETERS = AdaptationParameters(method="gait")


def reported(value: float) -> Coefficient:
    return synthetic_muds.reported(value, 0.05 * value, exponent_uncertainty=0.1)


def estimated(k_s: float, k_e: float) -> MudEstimate:
    return synthetic_muds.estimated(reported(k_s), reported(k_e))


FIRM, SOFT = estimated(2.0e6, 0.5e6), estimated(0.2e6, 0.1e6)


def strides(
    released: bool = True, torque_nm: float = 0.2, depth_m: float = 0.03, surface_m: float = 0.0
) -> list[StrideEstimate]:
    return both(depth_m, released, surface_m, torque_nm)


def adapted() -> GaitAdaptation:
    return GaitAdaptation(PARAMETERS, GEOMETRY, GAIT)


def sweep_deg(choice: DepthChoice) -> float:
    assert choice.gait is not None
    return choice.gait.sweep_angle_deg


def settled(mud_estimate: MudEstimate) -> DepthChoice:
    adaptation = adapted()
    for _ in range(5):
        choice = choose_now(adaptation, mud_estimate, strides())
    return choice


def brute_force(
    mud_estimate: MudEstimate, closed: list[StrideEstimate], walked: GaitParameters, widest_deg: float
) -> list[tuple[float, float, float]]:
    """Return (speed, depth, sweep) of every pair that comes out, the fastest first."""
    found = []
    for i in range(round((PARAMETERS.gait.max_sweep_deg - PARAMETERS.gait.min_sweep_deg) / SWEEP_STEP_DEG) + 1):
        deg = PARAMETERS.gait.min_sweep_deg + i * SWEEP_STEP_DEG
        gait = replace(GAIT, sweep_angle_deg=deg, swing_duration_s=PARAMETERS.gait.swing_duration_s)
        forecast = DepthForecast(GEOMETRY, walked, PARAMETERS.motor_force_n)
        forecast.update(mud_estimate, closed, PARAMETERS.initial_depth_m)
        forecast.gait = gait
        drag = body_drag(PARAMETERS, forecast)
        for j in range(15):
            depth_m = 0.015 + 0.0025 * j
            if depth_m > GEOMETRY.deepest_m(deg) or deg > widest_deg:
                continue
            if forecast.extraction_nm(depth_m) >= PARAMETERS.lifting_fraction * LIFTING_NM:
                continue
            yield_n, motor_n = forecast.yield_n(depth_m) or 0.0, 2.0 * PARAMETERS.motor_force_n
            traction = Traction(yield_n, motor_n, 2.0 * PARAMETERS.mobilisation_n_m)
            moved_m = carried_m(motion_of(gait, GEOMETRY, depth_m), drag, traction)
            found.append((moved_m / stride_duration_s(gait, GEOMETRY, depth_m), depth_m, deg))
    return sorted(found, reverse=True)


@settings(max_examples=25)
@given(
    walked_deg=st.sampled_from([30.0, 40.0, 50.0]),
    k_s=st.floats(0.15e6, 3e6) | st.just(1e4),  # in which no step advances
    k_e=st.floats(0.2e6, 5e6) | st.just(1e8),
    torque_nm=st.floats(0.0, 0.7) | st.just(2.0),  # at which nothing comes out
    surface_m=st.floats(-0.002, 0.002),
)
def test_it_takes_the_fastest_of_all_pairs_that_come_out(
    walked_deg: float, k_s: float, k_e: float, torque_nm: float, surface_m: float
) -> None:
    """A stride of 1.5 cm came out and gave its k_e, with any torque of its extraction."""
    felt = Estimate(k_e, 0.05 * k_e, 50, True)
    closed = [replace(each, k_e=felt) for each in strides(torque_nm=torque_nm, depth_m=0.015, surface_m=surface_m)]
    walked, mud_estimate = replace(GAIT, sweep_angle_deg=walked_deg), estimated(k_s, k_e)
    choice = choose_now(GaitAdaptation(PARAMETERS, GEOMETRY, walked), mud_estimate, closed, 0.03)
    easily = torque_nm < 0.7 * LIFTING_NM
    pairs = brute_force(mud_estimate, closed, walked, walked_deg + (WIDENING_DEG if easily else 0.0))
    if not pairs or pairs[0][0] == 0.0:
        assert choice.reason == ("thrust" if pairs else "extraction")
        assert choice.depth_m == pytest.approx(max((depth_m for _, depth_m, _ in pairs), default=0.015))
        return
    speeds = {(round(depth_m, 6), deg): speed for speed, depth_m, deg in pairs}
    assert speeds[round(choice.depth_m, 6), sweep_deg(choice)] == pytest.approx(pairs[0][0], rel=1e-9)


@pytest.mark.parametrize("deg", [30.0, 40.0, 50.0])
def test_the_torque_of_an_extraction_is_that_of_the_pose_at_its_own_rear(deg: float) -> None:
    """Over a wider sweep Φ at 2 cm is smaller: a flipper that just sticks at ±30° comes out at ±50°."""
    parameters = replace(PARAMETERS, min_depth_m=0.02, max_depth_m=0.02, initial_depth_m=0.02)
    rear_rad = -radians(deg)
    plate = submerged_plate(GEOMETRY, rear_rad, GEOMETRY.adduction_rad(rear_rad, 0.02))
    limit_nm = parameters.lifting_fraction * LIFTING_NM
    just = limit_nm / stroke_moment_m4(GEOMETRY, plate, rear_rad) / 1.1  # two standard errors of 5 %
    for fraction, comes_out in ((0.999, True), (1.001, False)):
        narrowed = replace(parameters, gait=GaitAdaptationParameters(deg, deg))
        adaptation = GaitAdaptation(narrowed, GEOMETRY, replace(GAIT, sweep_angle_deg=40.0))
        k_e = synthetic_muds.reported(fraction * just, 0.05 * fraction * just, depth_m=0.02)
        choice = choose_now(adaptation, synthetic_muds.estimated(reported(2e6), k_e), strides(depth_m=nan))
        assert (choice.reason == "fastest") is comes_out


def test_firm_mud_is_walked_wide_and_shallow_and_soft_mud_narrow_and_deep_both_with_a_short_swing() -> None:
    firm, soft = settled(FIRM), settled(SOFT)
    assert sweep_deg(firm) > sweep_deg(soft)
    assert firm.depth_m < soft.depth_m
    for choice in (firm, soft):
        assert choice.gait == replace(GAIT, sweep_angle_deg=sweep_deg(choice), swing_duration_s=0.3)


def test_the_first_stride_is_walked_as_configured() -> None:
    adaptation = adapted()
    adaptation.reset(0.02)
    assert adaptation.choice[:2] == (0.02, False)
    assert adaptation.choice.gait == GAIT


@pytest.mark.parametrize("walked_deg", [20.0, 30.0, 50.0])
def test_mud_too_soft_to_be_felt_in_the_first_stride_is_tried_deeper_with_the_narrowest_sweep(
    walked_deg: float,
) -> None:
    """The first stride's gait is the configured one, which is no candidate: its swing is slower."""
    adaptation = GaitAdaptation(PARAMETERS, GEOMETRY, replace(GAIT, sweep_angle_deg=walked_deg))
    adaptation.reset(0.02)
    choice = choose_now(adaptation, NOTHING_KNOWN, strides())
    assert choice.depth_m == pytest.approx(0.025)
    assert sweep_deg(choice) == PARAMETERS.gait.min_sweep_deg


def test_the_sweep_grows_by_no_more_than_one_widening_from_stride_to_stride() -> None:
    adaptation, before_deg, widest_deg = adapted(), 30.0, 0.0
    for _ in range(6):
        now_deg = sweep_deg(choose_now(adaptation, FIRM, strides(), 0.03))
        assert now_deg <= before_deg + WIDENING_DEG
        before_deg, widest_deg = now_deg, max(widest_deg, now_deg)
    assert widest_deg == 50.0


@pytest.mark.parametrize(
    ("left_nm", "right_nm", "wider"),
    [
        (0.69 * LIFTING_NM, 0.69 * LIFTING_NM, True),
        (0.7 * LIFTING_NM, 0.7 * LIFTING_NM, False),
        (nan, nan, False),  # not seen
        (0.2, 0.8 * LIFTING_NM, False),  # one is enough
    ],
)
def test_no_stride_is_wider_after_an_extraction_that_was_hard_or_was_not_seen(
    left_nm: float, right_nm: float, wider: bool
) -> None:
    closed = [strides(torque_nm=left_nm)[0], strides(torque_nm=right_nm)[1]]
    assert (sweep_deg(choose_now(adapted(), FIRM, closed)) > 30.0) is wider


def test_a_sweep_narrower_than_the_methods_becomes_its_narrowest_at_once() -> None:
    adaptation = GaitAdaptation(PARAMETERS, GEOMETRY, replace(GAIT, sweep_angle_deg=15.0))
    choice = choose_now(adaptation, FIRM, strides(torque_nm=0.7))
    assert (sweep_deg(choice), choice.reason) == (30.0, "fastest")


class TestStuck:
    def walked(self) -> tuple[GaitAdaptation, DepthChoice]:
        adaptation = adapted()
        for _ in range(4):
            choice = choose_now(adaptation, FIRM, strides())
        return adaptation, choice

    def test_nothing_as_deep_and_as_wide_is_tried_again_in_the_same_mud(self) -> None:
        adaptation, stuck = self.walked()
        for torque_nm in (0.2, 0.3, 0.2, 0.2):
            choice = choose_now(adaptation, FIRM, strides(torque_nm == 0.3, torque_nm, stuck.depth_m))
            assert choice.depth_m < stuck.depth_m or sweep_deg(choice) < sweep_deg(stuck)

    @pytest.mark.parametrize(("mud_estimate", "deeper_m"), [(FIRM, 0.0), (FIRM, 0.02), (NOTHING_KNOWN, 0.0)])
    def test_the_commanded_depth_is_excluded_also_where_the_flipper_was_pressed_deeper(
        self, mud_estimate: MudEstimate, deeper_m: float
    ) -> None:
        """By the depth that the flipper reached, the commanded depth would be safe."""
        adaptation, stuck = self.walked()
        assert sweep_deg(stuck) == 50.0
        choice = choose_now(adaptation, mud_estimate, strides(released=False, depth_m=stuck.depth_m + deeper_m))
        assert choice.depth_m < stuck.depth_m or sweep_deg(choice) < sweep_deg(stuck)
        assert sweep_deg(choice) == 30.0

    def test_at_the_shallowest_and_narrowest_it_stays_until_it_comes_out_of_there(self) -> None:
        parameters = replace(PARAMETERS, initial_depth_m=0.015)
        adaptation = GaitAdaptation(parameters, GEOMETRY, GAIT)
        for _ in range(2):
            choice = choose_now(adaptation, FIRM, strides(released=False, depth_m=0.03))
            assert (choice.depth_m, sweep_deg(choice), choice.reason) == (0.015, 30.0, "a flipper was stuck")
        choice = choose_now(adaptation, FIRM, strides(depth_m=0.03))
        assert (choice.depth_m, sweep_deg(choice)) > (0.015, 30.0)

    @pytest.mark.parametrize("forgotten", ["another mud", "another walk"])
    def test_it_is_forgotten_in_another_mud_and_in_another_walk(self, forgotten: str) -> None:
        adaptation, stuck = self.walked()
        choose_now(adaptation, FIRM, strides(released=False, depth_m=stuck.depth_m))
        if forgotten == "another walk":
            adaptation.reset(0.03)
        choose_now(adaptation, FIRM._replace(boundary=True), strides())
        for _ in range(4):
            choice = choose_now(adaptation, FIRM, strides())
        assert (choice.depth_m, choice.gait) == (stuck.depth_m, stuck.gait)


def test_where_no_pair_comes_out_the_shallowest_and_narrowest_is_taken_and_without_a_step_the_deepest() -> None:
    choice = choose_now(adapted(), estimated(2.0e6, 50e6), strides(torque_nm=0.75, depth_m=0.01))
    assert (choice.depth_m, sweep_deg(choice), choice.reason) == (0.015, 30.0, "extraction")
    choice = choose_now(adapted(), estimated(0.005e6, 0.001e6), strides())
    assert (choice.reason, choice.slips) == ("thrust", True)
    assert choice.depth_m == pytest.approx(0.05)


def test_no_stride_that_may_be_chosen_asks_a_joint_for_more_than_its_velocity_limit() -> None:
    limit_rad_s = JointLimits().velocity_rad_s
    adaptation = adapted()
    finish(adaptation.prepare())
    assert len(adaptation.candidates) > 40
    for stride in adaptation.candidates:
        assert 0.015 <= stride.depth_m <= min(0.05, GEOMETRY.deepest_m(stride.gait.sweep_angle_deg))
        gait = Gait(stride.gait, GEOMETRY)
        gait.reset(stride.depth_m)
        while (target := gait.step(0.002)).stride == 0:
            adduction_rad = GEOMETRY.adduction_rad(target.sweep_rad, target.depth_m)
            adduction_rad_s = GEOMETRY.adduction_velocity_rad_s(
                target.sweep_rad, adduction_rad, target.sweep_velocity_rad_s, target.depth_velocity_m_s
            )
            assert max(abs(adduction_rad_s), abs(target.sweep_velocity_rad_s)) < limit_rad_s


def test_only_this_method_has_a_shorter_swing() -> None:
    assert quickest(PARAMETERS, GEOMETRY, GAIT).swing_duration_s == 0.3
    for method in ("default", "paper"):
        assert quickest(replace(PARAMETERS, method=method), GEOMETRY, GAIT) is GAIT
