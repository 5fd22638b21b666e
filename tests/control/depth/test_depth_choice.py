"""The choice of the next depth, against a search of every depth."""

from dataclasses import replace
from itertools import pairwise
from math import log, nan, radians

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from control.computing.bounded_work import finish
from control.depth.depth_choice import DepthAdaptation, DepthChoice, depth_grid, path_depths, rising_deg
from control.depth.forecast import GRID_M, DepthForecast
from control.depth.step_model import BodyDrag, Traction, carried_m, motion_of
from control.gait.stride_table import crutching, stride_duration_s
from control.mud_estimate import NOTHING_KNOWN, Coefficient, FlipperEstimate, MudEstimate
from control.parameters.adaptation_parameters import AdaptationParameters
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import GaitPath, GaitPhase, WayPoint
from control.records import StrideEstimate
from firmware_host.configuration.gait_file import gait_document, read_gait
from tests.control.synthetic_muds import (
    GAIT,
    GEOMETRY,
    LIFTING_NM,
    MOTOR_FORCE_N,
    PARAMETERS,
    both,
    choose_now,
    estimated,
    lift_m4,
    reported,
    stride,
)

DEPTHS_M = [0.015 + 0.0025 * i for i in range(15)]
ALLOWED_NM = 0.95 * LIFTING_NM
FIRM, SOFT, BOTTOMLESS = reported(1.2e6), reported(0.3e6), reported(0.01e6)
LOOSE, STICKY = reported(0.3e6), reported(1.5e6)


def adapted(parameters: AdaptationParameters = PARAMETERS) -> DepthAdaptation:
    return DepthAdaptation(parameters, GEOMETRY, GAIT)


def chosen(
    mud_estimate: MudEstimate, strides: list[StrideEstimate] | None = None, commanded_m: float = 0.03
) -> DepthChoice:
    adaptation = adapted()
    adaptation.reset(commanded_m)
    return choose_now(adaptation, mud_estimate, both() if strides is None else strides)


def predicted_m(thrust_n: float, k_s: float, depth_m: float) -> float:
    """Return the predicted step of a body whose pad of 1.5 cm drags 2 cm deep through the same mud."""
    drag = BodyDrag(2.5 + k_s * 0.015 * 0.02**2 / 2.0, 6.0, 1.0)
    return carried_m(motion_of(GAIT, GEOMETRY, depth_m), drag, Traction(thrust_n, 2.0 * MOTOR_FORCE_N, 2.0 * 250.0))


def forecast(mud_estimate: MudEstimate, strides: list[StrideEstimate]) -> DepthForecast:
    forecast = DepthForecast(GEOMETRY, GAIT, MOTOR_FORCE_N)
    forecast.update(mud_estimate, strides, 0.03)
    return forecast


def steps_m(reported: DepthForecast) -> dict[float, float]:
    return {z: predicted_m(reported.yield_n(z) or 0.0, reported.drag_shear(0.02), z) for z in DEPTHS_M}


def same_depth(depth_m: float) -> object:
    """Match a depth of the grid up to the rounding of its sum."""
    return pytest.approx(depth_m, abs=1e-9)


synthetic_strides = st.builds(
    lambda *each: [stride("left", *each[:3]), stride("right", *each[3:])],
    *[st.floats(0.01, 0.05), st.booleans(), st.floats(-0.005, 0.005)] * 2,
)
shears = st.floats(log(0.02e6), log(1.5e6)).map(np.exp)
suctions = st.floats(log(0.1e6), log(3e6)).map(np.exp)
exponents = st.floats(-1.0, 0.2)


class TestTheFastestDepth:
    @given(shears, suctions, exponents, exponents, synthetic_strides)
    def test_it_predicts_the_highest_speed_of_all_that_come_out_and_whether_that_one_slips(
        self, k_s: float, k_e: float, m_s: float, m_e: float, strides: list[StrideEstimate]
    ) -> None:
        mud_estimate = estimated(reported(k_s, exponent=m_s), reported(k_e, exponent=m_e))
        known, choice = forecast(mud_estimate, strides), chosen(mud_estimate, strides)
        steps = {round(z, 6): step for z, step in steps_m(known).items()}
        out = {z: steps[z] / stride_duration_s(GAIT, GEOMETRY, z) for z in steps if known.extraction_nm(z) < ALLOWED_NM}
        taken_m = round(choice.depth_m, 6)
        assert choice.slips == (steps[taken_m] < 0.06) or abs(steps[taken_m] - 0.06) < 1e-9
        assume(out and max(out.values()) > 0.0)
        assert out[taken_m] == pytest.approx(max(out.values()))

    def test_firm_mud_is_walked_shallow_and_soft_mud_deep(self) -> None:
        firm, soft = chosen(estimated(FIRM, LOOSE)), chosen(estimated(SOFT, LOOSE))
        assert firm.depth_m < PARAMETERS.initial_depth_m < soft.depth_m
        assert not firm.slips and not soft.slips
        assert firm.reason == soft.reason == "fastest"

    @pytest.mark.parametrize(
        ("k_s", "k_e", "reached_m", "expected_m", "reason"),
        [
            (SOFT, reported(20e6), 0.03, 0.015, "extraction"),  # nothing comes out: the shallowest
            (reported(1.5e6), reported(20e6), 0.03, 0.015, "extraction"),
            (BOTTOMLESS, LOOSE, nan, 0.05, "thrust"),  # no depth predicts a step: the deepest that comes out
            (BOTTOMLESS, reported(1.5e6), nan, 0.035, "thrust"),
        ],
    )
    def test_where_no_depth_is_walked_it_slips_at_the_shallowest_or_at_the_deepest_that_comes_out(
        self, k_s: Coefficient, k_e: Coefficient, reached_m: float, expected_m: float, reason: str
    ) -> None:
        choice = chosen(estimated(k_s, k_e), both(reached_m))
        assert (choice.depth_m, choice.reason) == (same_depth(expected_m), reason)
        assert choice.slips or k_s.value > SOFT.value
        if reason == "thrust":
            assert k_e.value * lift_m4(expected_m) < ALLOWED_NM
            assert expected_m == 0.05 or k_e.value * lift_m4(expected_m + GRID_M) >= ALLOWED_NM

    @pytest.mark.parametrize(
        "burden",
        [
            AdaptationParameters(body_drag_n=6.0),
            AdaptationParameters(body_mass_kg=2.5),
            AdaptationParameters(body_damping_n_s_m=20.0),
            AdaptationParameters(pad_width_m=0.1),
        ],
    )
    def test_a_heavier_body_or_more_drag_is_carried_deeper(self, burden: AdaptationParameters) -> None:
        """The mud is soft enough that its yield, not the motors, limits the thrust of the plain robot."""
        mud = estimated(SOFT, LOOSE)
        assert choose_now(adapted(burden), mud, both()).depth_m > chosen(mud).depth_m


class TestUnknownMud:
    @pytest.mark.parametrize(
        ("mud_estimate", "strides"),
        [
            (estimated(None, STICKY), [replace(each, step_m=0.07) for each in both()]),
            (NOTHING_KNOWN, both(depth_m=nan)),
            (estimated(FIRM, LOOSE), []),
        ],
        ids=["the body advances", "nothing was measured", "no stride"],
    )
    def test_without_an_estimate_of_the_thrust_the_depth_stays(
        self, mud_estimate: MudEstimate, strides: list[StrideEstimate]
    ) -> None:
        kept = DepthChoice(0.0375, False, "nothing known of the thrust, depth kept")
        assert chosen(mud_estimate, strides, 0.0375) == kept

    @pytest.mark.parametrize("step_m", [0.0, nan])
    def test_mud_that_is_too_soft_to_be_felt_is_tried_deeper_until_the_deepest(self, step_m: float) -> None:
        adaptation, walked_m = adapted(PARAMETERS), [0.02]
        adaptation.reset(0.02)
        for _ in range(6):
            choose_now(adaptation, NOTHING_KNOWN, [replace(each, step_m=step_m) for each in both()])
            walked_m.append(adaptation.choice.depth_m)
        assert all(deeper <= 1.4 * depth for depth, deeper in pairwise(walked_m))
        assert walked_m[1:3] == sorted(set(walked_m[1:3])) and walked_m[-1] == PARAMETERS.max_depth_m

    def test_a_walk_starts_at_the_configured_depth_and_a_reset_at_its_own(self) -> None:
        adaptation = adapted(AdaptationParameters(initial_depth_m=0.04))
        assert adaptation.choice.depth_m == 0.04
        choose_now(adaptation, estimated(BOTTOMLESS, LOOSE), both())
        adaptation.reset(0.02)
        assert adaptation.choice == DepthChoice(0.02, False, "start")


class TestUncertainty:
    """The muds are those through which the motors can pull the pad: beyond 1.5 N/cm³ its own drag exceeds their
    force.
    """

    fractions = st.tuples(*[st.floats(0.0, 1.0)] * 2)

    @given(shears, suctions, exponents, fractions)
    def test_uncertainty_about_thrust_never_chooses_a_depth_with_less_thrust(
        self, k_s: float, k_e: float, exponent: float, pair: tuple[float, float]
    ) -> None:
        sure, uncertain = (
            chosen(estimated(reported(k_s, fraction * k_s, exponent=exponent), reported(k_e)))
            for fraction in sorted(pair)
        )
        assert uncertain.depth_m >= sure.depth_m
        assert uncertain.slips >= sure.slips

    @given(shears, suctions, exponents, fractions)
    def test_uncertainty_about_suction_never_chooses_a_deeper_one(
        self, k_s: float, k_e: float, exponent: float, pair: tuple[float, float]
    ) -> None:
        sure, uncertain = (
            chosen(estimated(reported(k_s), reported(k_e, fraction * k_e, exponent=exponent)))
            for fraction in sorted(pair)
        )
        assert uncertain.depth_m <= sure.depth_m


SINKING = estimated(reported(0.08e6), LOOSE)  # the deeper, the faster


class TestStuck:
    @pytest.mark.parametrize("depth_m", [0.015, 0.0225, 0.0325, 0.04, 0.05])
    @pytest.mark.parametrize("k_s", [FIRM, SOFT, BOTTOMLESS, None])
    def test_a_stuck_flipper_goes_shallower_than_where_it_stuck_down_to_the_shallowest(
        self, depth_m: float, k_s: Coefficient | None
    ) -> None:
        choice = chosen(estimated(k_s, reported(1.0)), both(depth_m, released=False), depth_m)
        assert choice.depth_m < 0.95 * depth_m or choice.depth_m == depth_m == 0.015
        assert choice.reason == "a flipper was stuck"

    @pytest.mark.parametrize("stuck", ["left", "right"])
    @pytest.mark.parametrize("mud_estimate", [SINKING, estimated(None, LOOSE)])
    def test_one_stuck_flipper_is_enough_and_the_deepest_that_comes_out_is_taken(
        self, mud_estimate: MudEstimate, stuck: str
    ) -> None:
        strides = [stride(flipper, 0.04, released=flipper != stuck) for flipper in ("left", "right")]
        assert chosen(mud_estimate, strides, 0.04).depth_m == same_depth(0.0375)


numbers = st.floats() | st.floats(-0.1, 0.1) | st.sampled_from([0.0, 0.03, 1e6])
anything = st.builds(Coefficient, *[numbers] * 5, st.just(3), st.booleans())
plausible = st.builds(
    reported,
    st.floats(0.0, 1e8),
    st.floats(0.0, 1e7),
    st.floats(0.005, 0.06),
    st.floats(-1.5, 0.5),
    st.floats(0.0, 0.5),
)
coefficients = plausible | anything | st.none()
mud_estimates = st.builds(MudEstimate, *[coefficients] * 3, *[st.builds(FlipperEstimate, *[coefficients] * 3)] * 2)
strides = st.builds(
    stride,
    st.sampled_from(["left", "right"]),
    st.floats() | st.floats(0.0, 0.06),
    st.booleans(),
    st.floats() | st.floats(-0.02, 0.04),
)
pairs = st.lists(strides, min_size=1, max_size=2)


class TestRange:
    @given(
        st.floats(5.0, 45.0), st.floats(0.02, 0.2), st.lists(st.tuples(mud_estimates, pairs), min_size=1, max_size=4)
    )
    def test_the_depth_stays_within_its_bounds_and_within_reach(
        self, sweep_deg: float, max_depth_m: float, walk: list[tuple[MudEstimate, list[StrideEstimate]]]
    ) -> None:
        parameters = AdaptationParameters(max_depth_m=max_depth_m)
        adaptation = DepthAdaptation(parameters, GEOMETRY, GaitParameters(sweep_angle_deg=sweep_deg))
        grid_m = depth_grid(parameters, GEOMETRY, GaitParameters(sweep_angle_deg=sweep_deg))
        assert all(GEOMETRY.is_reachable(radians(sweep_deg), depth_m) for depth_m in grid_m)
        adaptation.reset(parameters.min_depth_m)
        for mud_estimate, pair in walk:
            depth_m = choose_now(adaptation, mud_estimate, pair).depth_m
            assert parameters.min_depth_m <= depth_m <= max_depth_m + 1e-9

    def test_a_least_depth_out_of_reach_raises_nothing(self) -> None:
        parameters = AdaptationParameters(min_depth_m=0.15, max_depth_m=0.2)
        assert choose_now(adapted(parameters), estimated(FIRM, LOOSE), both()).depth_m == 0.15

    @given(st.floats(0.01, 0.05), st.integers(0, 12), st.floats(0.01, 0.99))
    def test_the_grid_never_passes_its_greatest_depth(self, low_m: float, steps: int, fraction: float) -> None:
        high_m = low_m + (steps + fraction) * GRID_M
        assume(high_m < GEOMETRY.deepest_m(30.0))
        grid_m = depth_grid(AdaptationParameters(min_depth_m=low_m, max_depth_m=high_m), GEOMETRY, GAIT)
        assert len(grid_m) == steps + 1
        assert grid_m[-1] <= high_m


def test_candidates_are_computed_once_where_two_preparations_run_in_turn() -> None:
    whole, adaptation = adapted(), adapted()
    finish(whole.prepare())
    first, second = adaptation.prepare(), adaptation.prepare()
    next(first)
    next(second)
    finish(first)
    finish(second)
    assert adaptation.candidates == whole.candidates


class TestPaths:
    """Of gait files: the same choice, by what each path does in the mud."""

    ELLIPSE, ALTERNATING = (read_gait(gait_document(name)) for name in ("ellipse", "alternating"))

    def test_the_crutching_gait_as_a_path_chooses_the_depth_of_the_gait(self) -> None:
        for k_s in (FIRM, SOFT, reported(0.6e6)):
            mud_estimate = estimated(k_s, LOOSE)
            adaptation = DepthAdaptation(PARAMETERS, GEOMETRY, GAIT, path=crutching(GAIT))
            adaptation.reset(0.03)
            along_m = choose_now(adaptation, mud_estimate, both()).depth_m
            assert along_m == pytest.approx(chosen(mud_estimate).depth_m, abs=GRID_M + 1e-9)

    def test_flippers_that_push_in_turn_go_deeper_than_both_together(self) -> None:
        """Each must move the body alone."""
        together = replace(self.ALTERNATING, right_offset_fraction=0.0)
        adaptations = [DepthAdaptation(PARAMETERS, GEOMETRY, GAIT, path=path) for path in (self.ALTERNATING, together)]
        in_turn, both_push = (choose_now(each, estimated(reported(0.6e6), LOOSE), both()) for each in adaptations)
        assert in_turn.depth_m > both_push.depth_m

    def test_a_path_has_the_depths_that_all_of_it_reaches(self) -> None:
        wide = WayPoint(60.0, depth_fraction=1.0), WayPoint(-60.0, depth_fraction=1.0)
        path = GaitPath((GaitPhase("stance", wide, speed_m_s=0.3), *self.ELLIPSE.phase[-1:]))
        depths_m = path_depths(PARAMETERS, GEOMETRY, path)
        reach_m = GEOMETRY.deepest_m(60.0)
        assert depths_m == tuple(depth_m for depth_m in DEPTHS_M if depth_m <= reach_m) != tuple(DEPTHS_M)

    def test_plates_rise_from_where_they_are_deepest(self) -> None:
        assert rising_deg(self.ELLIPSE, GEOMETRY, 0.03) == pytest.approx(0.0, abs=1e-9)
        assert rising_deg(crutching(GAIT), GEOMETRY, 0.03) == pytest.approx(GAIT.sweep_angle_deg)
