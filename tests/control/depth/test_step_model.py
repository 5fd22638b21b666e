"""The predicted step against the same equation of motion, integrated a thousand times as finely by numpy.

The reference has the traction force as its state: it grows with k times the speed between arms and body, up to what the
mud withstands. There the plates shear through.
"""

from functools import cache
from itertools import product
from math import cos, pi, radians, sin

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from control.depth import step_model
from control.depth.step_model import BodyDrag, Traction, coast_m, step_m
from control.gait.gait import RAMP_S
from control.parameters.gait_parameters import GaitParameters

Array = NDArray[np.float64]

LENGTH_M = 0.120
WALKING = GaitParameters()
CAREFUL = GaitParameters(sweep_angle_deg=20.0, stance_speed_m_s=0.3, extraction_speed_m_s=0.15)
RAIL = BodyDrag(2.5, 6.0, 1.0)
FINE_S = 1e-5

THRUSTS_N = (2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 12.5)
STIFFNESSES_N_M = (300.0, 500.0, 3000.0)
DRAGS = [BodyDrag(*drag, 1.0) for drag in product((2.5, 5.0), (0.0, 6.0, 20.0))] + [BodyDrag(2.5, 6.0, 2.5)]
DEPTHS_M = (0.015, 0.05)
CASES = list(product(THRUSTS_N, STIFFNESSES_N_M, DRAGS, DEPTHS_M))


def stance_duration_s(gait: GaitParameters) -> float:
    return 2.0 * radians(gait.sweep_angle_deg) * LENGTH_M / gait.stance_speed_m_s


def top_speed_m_s(gait: GaitParameters) -> float:
    """Return the arms' top speed, at which they cover the sweep with a ramp of half a cosine at either end."""
    return 2.0 * LENGTH_M * sin(radians(gait.sweep_angle_deg)) / (stance_duration_s(gait) - RAMP_S)


def arm_speed_m_s(gait: GaitParameters, time_s: float) -> float:
    to_an_end_s = min(time_s, stance_duration_s(gait) - time_s)
    if to_an_end_s <= 0.0:
        return 0.0
    return top_speed_m_s(gait) * (1.0 - cos(pi * min(to_an_end_s / RAMP_S, 1.0))) / 2.0


@cache
def finely_m(gait: GaitParameters) -> Array:
    """Return the steps of all CASES at once."""
    flat = [(thrust, stiffness, *drag, depth) for thrust, stiffness, drag, depth in CASES]
    withstands, stiffness, dry, damping, mass, depth = np.array(flat).T
    stance_s, leaving_s = stance_duration_s(gait), depth / gait.extraction_speed_m_s
    force, speed, path = np.zeros((3, len(flat)))
    for i in range(int((stance_s + leaving_s.max()) / FINE_S) + 1):
        time_s = (i + 0.5) * FINE_S
        fades = np.minimum(np.maximum(1.0 - (time_s - stance_s) / leaving_s, 0.0), 1.0)
        force += FINE_S * stiffness * (arm_speed_m_s(gait, time_s) - speed)
        force = np.minimum(np.maximum(force, -withstands * fades), withstands * fades)
        speed = np.maximum(speed + FINE_S * (force - dry - damping * speed) / mass, 0.0)
        path += FINE_S * speed
    while speed.any():
        speed = np.maximum(speed - 10.0 * FINE_S * (dry + damping * speed) / mass, 0.0)
        path += 10.0 * FINE_S * speed
    return path


def coarsely_m(gait: GaitParameters) -> Array:
    return np.array([step_m(gait, LENGTH_M, drag, Traction(*traction), depth_m) for *traction, drag, depth_m in CASES])


def predicted_m(thrust_n: float, stiffness_n_m: float = 500.0, drag: BodyDrag = RAIL, depth_m: float = 0.03) -> float:
    return step_m(WALKING, LENGTH_M, drag, Traction(thrust_n, stiffness_n_m), depth_m)


class TestAgainstFineSteps:
    """Steps of 10 ms shift an event by less than one of them: the tolerance is that time at the arms' top speed."""

    @pytest.mark.parametrize("gait", [WALKING, CAREFUL])
    def test_the_step_is_that_of_the_equation_of_motion(self, gait: GaitParameters) -> None:
        off_m = np.abs(coarsely_m(gait) - finely_m(gait))
        assert off_m.max() < step_model.STEP_S * top_speed_m_s(gait)

    @pytest.mark.parametrize("gait", [WALKING, CAREFUL])
    def test_what_differs_is_the_size_of_the_steps_alone(
        self, gait: GaitParameters, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(step_model, "STEP_S", 0.001)
        monkeypatch.setattr(step_model, "motion_of", step_model.motion_of.__wrapped__)  # its cache has the coarse steps
        off_m = np.abs(coarsely_m(gait) - finely_m(gait))
        assert off_m.max() < 0.001 * top_speed_m_s(gait)

    def test_the_cases_hold_steps_of_every_length(self) -> None:
        fractions = finely_m(WALKING) / LENGTH_M
        assert np.histogram(fractions, [0.0, 0.01, 0.25, 0.5, 0.75, 1.0, 2.0])[0].min() > 5


class TestLimits:
    @given(st.floats(0.01, 12.5), st.floats(0.0, 1.0), st.floats(0.0, 50.0), st.floats(20.0, 5000.0))
    def test_thrust_below_dry_drag_moves_nothing(
        self, dry_n: float, fraction: float, damping_n_s_m: float, stiffness_n_m: float
    ) -> None:
        assert predicted_m(fraction * dry_n, stiffness_n_m, BodyDrag(dry_n, damping_n_s_m, 1.0)) == 0.0

    @given(st.floats(0.5, 8.0), st.floats(0.0, 20.0), st.tuples(*[st.floats(0.5, 12.5)] * 2), st.floats(200.0, 1000.0))
    def test_more_thrust_never_shortens_a_step_within_the_sweep(
        self, dry_n: float, damping_n_s_m: float, pair: tuple[float, float], stiffness_n_m: float
    ) -> None:
        """The plates brake a body that was thrown ahead of the arms, the harder the more they withstand."""
        drag = BodyDrag(dry_n, damping_n_s_m, 1.0)
        weak_m, strong_m = (predicted_m(thrust_n, stiffness_n_m, drag) for thrust_n in sorted(pair))
        assume(weak_m < 2.0 * LENGTH_M * sin(radians(WALKING.sweep_angle_deg)))
        assert strong_m >= weak_m

    def test_on_the_papers_rail_more_thrust_is_a_longer_step_up_to_what_the_motors_push(self) -> None:
        steps_m = [predicted_m(thrust_n) for thrust_n in np.arange(2.6, 12.5, 0.1)]
        assert all(shorter < longer for shorter, longer in zip(steps_m[:-1], steps_m[1:], strict=True))

    def test_firm_mud_and_stiff_traction_carry_the_body_as_far_as_the_arms_sweep(self) -> None:
        """The spring yields by what drag and start take, m a + f_r + b v, and overshoots by no more."""
        top_m_s, stiffness_n_m = top_speed_m_s(WALKING), 10000.0
        acceleration_m_s2 = top_m_s * pi / (2.0 * RAMP_S)
        give_m = (1.0 * acceleration_m_s2 + 2.5 + 6.0 * top_m_s) / stiffness_n_m
        step = predicted_m(1e4, stiffness_n_m)
        assert step == pytest.approx(2.0 * LENGTH_M * sin(radians(30.0)), abs=2.0 * give_m)

    def test_soft_traction_in_firm_mud_throws_the_body_ahead_of_the_arms(self) -> None:
        assert predicted_m(50.0, 500.0) > 1.1 * predicted_m(50.0, 10000.0)

    def test_a_heavier_drag_never_makes_the_step_longer(self) -> None:
        steps_m = [predicted_m(8.0, drag=RAIL._replace(dry_n=dry_n)) for dry_n in np.arange(0.5, 9.0, 0.5)]
        assert steps_m == sorted(steps_m, reverse=True)
        assert steps_m[-1] == 0.0 < steps_m[0]


class TestCoast:
    @given(st.floats(0.01, 10.0), st.floats(0.1, 20.0), st.floats(0.05, 10.0), st.floats(0.01, 2.0))
    def test_it_is_the_integral_of_speed_over_deceleration(
        self, dry_n: float, damping_n_s_m: float, mass_kg: float, speed_m_s: float
    ) -> None:
        """The coast is ∫ m v / (f_r + b v) dv, by Simpson's rule on squared nodes, which are dense where the integrand
        bends.
        """
        nodes = np.linspace(0.0, 1.0, 20001)
        v = speed_m_s * nodes**2
        integrand = mass_kg * v / (dry_n + damping_n_s_m * v) * 2.0 * speed_m_s * nodes
        weights = np.ones_like(nodes)
        weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
        expected_m = float(integrand @ weights) / 3.0 / 20000.0
        drag = BodyDrag(dry_n, damping_n_s_m, mass_kg)
        assert coast_m(drag, speed_m_s) == pytest.approx(expected_m, rel=1e-8)  # Simpson's own error is smaller

    def test_without_viscous_drag_it_is_the_kinetic_energy_over_friction(self) -> None:
        assert coast_m(BodyDrag(2.5, 0.0, 2.0), 0.6) == pytest.approx(2.0 * 0.6**2 / 2.0 / 2.5)

    @pytest.mark.parametrize("damping_n_s_m", [1e-3, 1e-5, 1e-7, 1e-9, 5e-324])
    def test_it_goes_over_into_dry_friction_alone(self, damping_n_s_m: float) -> None:
        """To first order it is shorter by the fraction 2 b v / 3 f_r; 1e-9 covers the rounding."""
        drag = BodyDrag(2.5, damping_n_s_m, 2.0)
        short = 2.0 * damping_n_s_m * 0.6 / (3.0 * 2.5)
        assert coast_m(drag, 0.6) == pytest.approx(coast_m(drag._replace(damping_n_s_m=0.0), 0.6), rel=short + 1e-9)

    def test_without_dry_friction_it_is_the_speed_times_the_lag(self) -> None:
        assert coast_m(BodyDrag(0.0, 6.0, 2.0), 0.6) == pytest.approx(0.6 * 2.0 / 6.0)
        assert coast_m(BodyDrag(1e-9, 6.0, 2.0), 0.6) == pytest.approx(0.6 * 2.0 / 6.0)

    @given(st.floats(0.01, 10.0), st.floats(0.0, 20.0))
    def test_a_body_that_stands_stays(self, dry_n: float, damping_n_s_m: float) -> None:
        assert coast_m(BodyDrag(dry_n, damping_n_s_m, 1.0), 0.0) == 0.0
