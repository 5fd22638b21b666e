"""The paper's own choice, with forces computed by hand for the authors' plate of 2.5 cm by 4 mm.

Its edge has 1 cm², so f_e = k_e · 1 cm² · z and f_m = 6.25 N: the limit is 6.25 cm at 1 N/cm³ and 3.125 cm at 2 N/cm³.
"""

from math import nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.depth.depth_choice import DepthChoice, depth_grid
from control.depth.paper_choice import PaperAdaptation
from control.mud_estimate import NOTHING_KNOWN
from control.parameters.adaptation_parameters import AdaptationParameters, PaperAdaptationParameters
from control.parameters.gait_parameters import GaitParameters
from control.records import Estimate, StrideEstimate
from tests.control.synthetic_muds import (
    GAIT,
    GEOMETRY,
    NOT_REPORTED,
    PARAMETERS,
    choose_now,
    estimated,
    measured,
    reported,
    stride,
)

OUT = "deepest that comes out"
THREE_CM = DepthChoice(depth_grid(PARAMETERS, GEOMETRY, GAIT)[6], False, OUT)


HEAVY = AdaptationParameters(body_mass_kg=2.0, paper=PaperAdaptationParameters(acceleration_s=0.2))
PADDED = AdaptationParameters(pad_width_m=0.04, pad_depth_m=0.03)
SLOW = GaitParameters(stance_speed_m_s=0.2)


def adapted() -> PaperAdaptation:
    return PaperAdaptation(PARAMETERS, GEOMETRY, GAIT)


def alike(k_s: Estimate, k_e: Estimate) -> list[StrideEstimate]:
    return [stride(flipper, k_s=k_s, k_e=k_e) for flipper in ("left", "right")]


def chosen(
    k_s: Estimate, k_e: Estimate, parameters: AdaptationParameters = PARAMETERS, gait: GaitParameters = GAIT
) -> DepthChoice:
    return choose_now(PaperAdaptation(parameters, GEOMETRY, gait), NOTHING_KNOWN, alike(k_s, k_e))


class TestDepth:
    @pytest.mark.parametrize(
        ("k_e", "motor_force_n", "depth_m"),
        [
            (1.0, 6.25, 0.05),  # a weak mud is not walked deeper than allowed
            (1.0e6, 6.25, 0.05),  # 5.00 N at the deepest
            (1.26e6, 6.25, 0.0475),  # 6.30 N at 5 cm, 5.985 N here
            (2.0e6, 6.25, 0.03),  # 6.50 N at 3.25 cm, 6.00 N here
            (3.6e6, 6.25, 0.015),  # 6.30 N at 1.75 cm, 5.40 N here
            (2.0e6, 6.0 + 1e-9, 0.03),  # an equal force does not pull it out
            (2.0e6, 6.0 - 1e-9, 0.0275),
        ],
    )
    def test_it_is_the_deepest_that_the_motors_force_pulls_out(
        self, k_e: float, motor_force_n: float, depth_m: float
    ) -> None:
        choice = chosen(measured(1e6), measured(k_e), AdaptationParameters(motor_force_n=motor_force_n))
        assert choice.depth_m == pytest.approx(depth_m)
        assert choice.reason == OUT

    def test_where_nothing_comes_out_it_is_the_shallowest(self) -> None:
        """A depth of 1.5 cm holds with 7.5 N. It slips as well, since 2 · 1 N/cm³ · 2.5 cm · 1.5² cm² / 2 = 5.6 N face
        8 N.
        """
        assert chosen(measured(1e6), measured(5e6)) == DepthChoice(0.015, True, "extraction")

    @given(st.floats(1e4, 1e7), st.floats(0.0, 5e6))
    def test_uncertainty_and_the_memory_of_many_strides_are_ignored(self, k_e: float, uncertainty: float) -> None:
        uncertain = measured(k_e)._replace(std_error=uncertainty)
        choice = choose_now(adapted(), estimated(reported(3e6), reported(9e6)), alike(NOT_REPORTED, uncertain))
        assert choice == chosen(NOT_REPORTED, measured(k_e))


class TestSlip:
    """The condition is 2 f_x = k_s · 2.5 cm · z² against f_r + f_a = 2.5 N + k_s · 3 cm³ + 2.5 N (1 kg, 0.5 m/s, 0.1
    s).

    At 5 cm that is k_s · 62.5 cm³ against 5 N + k_s · 3 cm³, so it slips up to 5 N / 59.5 cm³ = 0.0840 N/cm³; at 3 cm
    up to 5 N / 19.5 cm³ = 0.2564 N/cm³.
    """

    @pytest.mark.parametrize(
        ("k_s", "k_e", "slips", "parameters", "gait"),
        [
            (0.0839e6, 1e6, True, PARAMETERS, GAIT),
            (0.0842e6, 1e6, False, PARAMETERS, GAIT),
            (0.2563e6, 2e6, True, PARAMETERS, GAIT),
            (0.2565e6, 2e6, False, PARAMETERS, GAIT),
            # 2 kg at 0.2 m/s within 0.2 s: 2 kg · α l / (0.2 s · t_s) = 1 N, so it slips up to 3.5 N / 59.5 cm³
            (0.0587e6, 1e6, True, HEAVY, SLOW),
            (0.0589e6, 1e6, False, HEAVY, SLOW),
            # a pad of 4 cm by 3 cm, 18 cm³: it slips up to 5 N / 44.5 cm³ = 0.1124 N/cm³
            (0.1122e6, 1e6, True, PADDED, GAIT),
            (0.1125e6, 1e6, False, PADDED, GAIT),
        ],
    )
    def test_it_slips_where_thrust_is_no_more_than_drag_and_inertia(
        self, k_s: float, k_e: float, slips: bool, parameters: AdaptationParameters, gait: GaitParameters
    ) -> None:
        assert chosen(measured(k_s), measured(k_e), parameters, gait).slips == slips

    def test_a_slip_does_not_change_the_depth(self) -> None:
        weak, strong = chosen(measured(1.0), measured(2e6)), chosen(measured(9e6), measured(2e6))
        assert weak == strong._replace(slips=True)
        assert not strong.slips

    def test_without_a_k_s_it_does_not_claim_to_slip(self) -> None:
        assert chosen(NOT_REPORTED, measured(1e6)).slips is False


class TestMemory:
    @pytest.mark.parametrize("first", [0, 1])
    def test_the_right_flipper_decides_in_any_order(self, first: int) -> None:
        strides = [stride("left", k_e=measured(1e6)), stride("right", k_e=measured(2e6))]
        assert choose_now(adapted(), NOTHING_KNOWN, strides[first:] + strides[:first]).depth_m == pytest.approx(0.03)

    def test_the_left_flipper_decides_where_the_right_one_is_unknown(self) -> None:
        strides = [stride("left", k_e=measured(2e6)), stride("right")]
        assert choose_now(adapted(), NOTHING_KNOWN, strides).depth_m == pytest.approx(0.03)

    def test_the_last_valid_coefficients_stay(self) -> None:
        adaptation = adapted()
        known = choose_now(adaptation, NOTHING_KNOWN, alike(measured(0.08e6), measured(1e6)))
        assert known.slips
        invalid = measured(9e6)._replace(valid=False)
        assert choose_now(adaptation, NOTHING_KNOWN, alike(invalid, invalid)) == known
        assert choose_now(adaptation, NOTHING_KNOWN, []) == known
        assert choose_now(adaptation, NOTHING_KNOWN, alike(invalid, measured(2e6))) == THREE_CM._replace(slips=True)
        assert choose_now(adaptation, NOTHING_KNOWN, alike(measured(0.3e6), invalid)) == THREE_CM

    def test_without_a_k_e_the_depth_stays(self) -> None:
        adaptation = adapted()
        adaptation.reset(0.04)
        kept = DepthChoice(0.04, False, "no k_e known, depth kept")
        assert choose_now(adaptation, NOTHING_KNOWN, alike(measured(1e6), NOT_REPORTED)) == kept
        assert choose_now(adaptation, estimated(reported(1e6), reported(1e6)), []) == kept

    def test_a_reset_forgets_and_starts_at_its_depth(self) -> None:
        adaptation = adapted()
        assert adaptation.choice == DepthChoice(PARAMETERS.initial_depth_m, False, "start")
        choose_now(adaptation, NOTHING_KNOWN, alike(measured(1e6), measured(1e6)))
        adaptation.reset(0.02)
        assert adaptation.choice == DepthChoice(0.02, False, "start")
        assert choose_now(adaptation, NOTHING_KNOWN, []).depth_m == 0.02

    def test_a_stuck_flipper_does_not_decide(self) -> None:
        """The paper's conditions do not include it."""
        stuck = [stride("right", released=False, depth_m=nan, k_e=measured(1e6))]
        assert choose_now(adapted(), NOTHING_KNOWN, stuck).depth_m == pytest.approx(0.05)


numbers = st.floats() | st.floats(0.0, 1e7)
estimates = st.builds(Estimate, numbers, numbers, st.just(9), st.booleans())


@given(st.lists(st.tuples(estimates, estimates), max_size=4))
def test_for_any_input_the_depth_stays_in_its_range(walk: list[tuple[Estimate, Estimate]]) -> None:
    adaptation = adapted()
    for k_s, k_e in walk:
        depth_m = choose_now(adaptation, NOTHING_KNOWN, alike(k_s, k_e)).depth_m
        assert PARAMETERS.min_depth_m <= depth_m <= PARAMETERS.max_depth_m
