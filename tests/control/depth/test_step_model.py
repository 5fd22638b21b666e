"""The predicted step against the same equation of motion, integrated two hundred times as finely by numpy.

The reference has the stretch of mud and servo as its state: it grows with the speed between arms and body, up to what
the mud withstands. There the plates shear through. A motor at its limit lets the stretch grow, less what the plates
creep.
"""

from dataclasses import replace
from functools import cache
from itertools import product
from math import cos, inf, pi, radians, sin

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from control.depth import step_model
from control.depth.step_model import BodyDrag, Motion, Traction, carried_m, coast_m, motion_of, motion_of_path
from control.gait.gait import RAMP_S
from control.gait.stride_table import crutching, stride_table
from control.geometry import FlipperGeometry
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import GaitPath, GaitPhase, WayPoint

Array = NDArray[np.float64]

GEOMETRY = FlipperGeometry()
LENGTH_M, CLEARANCE_M = 0.120, 0.0145
WALKING = GaitParameters()
CAREFUL = GaitParameters(sweep_angle_deg=20.0, stance_speed_m_s=0.3, extraction_speed_m_s=0.15)
RAIL = BodyDrag(2.5, 6.0, 1.0)
FINE_S = 5e-5

YIELDS_N = (2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 12.5, 20.0)
MOTORS_N = (11.0, 12.0, 1e3)  # against a yield of 12.5 N the plates creep by 0.08, 0.69 and all of the lag
STIFFNESSES_N_M = (300.0, 500.0, 3000.0)
DRAGS = [BodyDrag(*drag, 1.0) for drag in product((2.5, 5.0), (0.0, 6.0, 20.0))] + [BodyDrag(2.5, 6.0, 2.5)]
DEPTHS_M = (0.015, 0.05)
CASES = [  # a servo of 3000 N/m would be at its limit after 4 mm, which the arms travel in less than one coarse step
    case
    for case in product(YIELDS_N, MOTORS_N, STIFFNESSES_N_M, DRAGS, DEPTHS_M)
    if case[1] > 100.0 or case[2] < 1000.0
]


def stance_duration_s(gait: GaitParameters) -> float:
    return 2.0 * radians(gait.sweep_angle_deg) * LENGTH_M / gait.stance_speed_m_s


def ramped_m_s(length_m: float, duration_s: float, time_s: float) -> float:
    """Return the speed at `time_s` on a path that begins and ends with a ramp of half a cosine."""
    ramp_s, to_an_end_s = min(RAMP_S, duration_s / 2.0), min(time_s, duration_s - time_s)
    if to_an_end_s <= 0.0:
        return 0.0
    return length_m / (duration_s - ramp_s) * (1.0 - cos(pi * min(to_an_end_s / ramp_s, 1.0))) / 2.0


def mirrored_phase(phase: GaitPhase) -> GaitPhase:
    return replace(phase, way_points=tuple(replace(each, sweep_deg=-each.sweep_deg) for each in phase.way_points))


def swept_m(gait: GaitParameters) -> float:
    return 2.0 * LENGTH_M * sin(radians(gait.sweep_angle_deg))


def top_speed_m_s(gait: GaitParameters) -> float:
    return ramped_m_s(swept_m(gait), stance_duration_s(gait), stance_duration_s(gait) / 2.0)


@cache
def finely_m(gait: GaitParameters) -> Array:
    """Return the steps of all CASES at once."""
    flat = [(yield_n, motor, stiffness, *drag, depth) for yield_n, motor, stiffness, drag, depth in CASES]
    withstands, motor, stiffness, dry, damping, mass, depth = np.array(flat).T
    stance_s = stance_duration_s(gait)
    extraction_s = {z: (z + CLEARANCE_M) / gait.extraction_speed_m_s for z in DEPTHS_M}
    stretch, speed, path, lag = np.zeros((4, len(flat)))
    creeping = np.clip((motor / withstands - step_model.CREEP) / (1.0 - step_model.CREEP), 0.0, 1.0)
    submerged = depth.copy()
    for i in range(int((stance_s + max(extraction_s.values())) / FINE_S) + 1):
        time_s = (i + 0.5) * FINE_S
        for z, duration_s in extraction_s.items():
            submerged[depth == z] -= FINE_S * ramped_m_s(z + CLEARANCE_M, duration_s, time_s - stance_s)
        held = withstands * np.maximum(submerged, 0.0) / depth
        stretch += FINE_S * (ramped_m_s(swept_m(gait), stance_s, time_s) - speed)
        stretch -= creeping * np.maximum(stretch - motor / stiffness - lag, 0.0)
        lag = np.maximum(stretch - motor / stiffness, 0.0)
        force = np.minimum(stiffness * stretch, motor)
        shears = np.abs(force) > held
        force = np.clip(force, -held, held)
        stretch = np.where(shears, force / stiffness, stretch)
        speed = np.maximum(speed + FINE_S * (force - dry - damping * speed) / mass, 0.0)
        path += FINE_S * speed
    while speed.any():
        speed = np.maximum(speed - 10.0 * FINE_S * (dry + damping * speed) / mass, 0.0)
        path += 10.0 * FINE_S * speed
    return path


def motion_along(path: GaitPath, depth_m: float = 0.03) -> Motion:
    return motion_of_path(stride_table(path, GEOMETRY, depth_m), GEOMETRY, depth_m)


def step_m(gait: GaitParameters, drag: BodyDrag, traction: Traction, depth_m: float) -> float:
    return carried_m(motion_of(gait, GEOMETRY, depth_m), drag, traction)


def predicted_m(
    yield_n: float, stiffness_n_m: float = 500.0, drag: BodyDrag = RAIL, depth_m: float = 0.03, motor_n: float = inf
) -> float:
    return step_m(WALKING, drag, Traction(yield_n, motor_n, stiffness_n_m), depth_m)


class TestAgainstFineSteps:
    """Steps of 10 ms shift an event by less than one of them, and a stride has two: the limit of the motors, and the
    mud that lets go. The tolerance is that time at the arms' top speed.
    """

    @pytest.mark.parametrize("gait", [WALKING, CAREFUL])
    def test_the_step_is_that_of_the_equation_of_motion(self, gait: GaitParameters) -> None:
        coarsely_m = [step_m(gait, drag, Traction(*traction), depth_m) for *traction, drag, depth_m in CASES]
        assert np.abs(coarsely_m - finely_m(gait)).max() < 2.0 * step_model.STEP_S * top_speed_m_s(gait)


class TestPaths:
    @pytest.mark.parametrize("motor_n", [12.0, 1e3])
    def test_the_crutching_gait_carries_the_body_as_far_where_it_is_a_path(self, motor_n: float) -> None:
        """But for the last of the extraction, in which the thrust of a path falls a little sooner."""
        path = crutching(WALKING)
        for yield_n in (4.0, 8.0, 20.0):
            traction = Traction(yield_n, motor_n, 500.0)
            along_m = carried_m(motion_along(path), RAIL, traction)
            assert along_m == pytest.approx(step_m(WALKING, RAIL, traction, 0.03), rel=0.05)

    def test_a_path_and_its_mirror_image_push_alike(self) -> None:
        path = crutching(CAREFUL)
        mirrored = replace(path, phase=tuple(map(mirrored_phase, path.phase)))
        forward, backward = (motion_along(each) for each in (path, mirrored))
        assert backward == forward and max(swept for swept, _ in forward) == pytest.approx(swept_m(CAREFUL))

    def test_mud_holds_a_path_only_where_it_is_deep(self) -> None:
        """Half an ellipse of 3 cm: past its peak all of the thrust, on the surface none, and less on the way down."""
        ends = WayPoint(-30.0, depth_m=0.0), WayPoint(30.0, depth_m=0.0)
        stance = GaitPhase("stance", (WayPoint(0.0, depth_fraction=1.0), ends[0]), "half_ellipse", duration_s=0.5)
        path = GaitPath((stance, GaitPhase("swing", (WayPoint(0.0, depth_m=-0.01), ends[1]), duration_s=0.5)))
        swept, fractions = zip(*motion_along(path), strict=True)
        assert max(fractions) > 0.99 and fractions[-1] == pytest.approx(0.0, abs=1e-6)
        assert swept[-1] == pytest.approx(2.0 * LENGTH_M * 0.5)
        shallow = [each > 0.5**1.5 for each in fractions[25:]].index(False) + 25  # the first step above 1.5 cm
        half_m = LENGTH_M * (0.5 + sin(radians(30.0 * cos(pi / 6.0))))
        assert swept[shallow - 1] < half_m * (1.0 + 1e-9) and swept[shallow] >= half_m * (1.0 - 1e-9)
        assert fractions[9] == pytest.approx(step_model.SINKING * fractions[39])

    def test_a_path_that_only_swings_carries_nothing(self) -> None:
        here = WayPoint(30.0, depth_m=-0.01)
        path = GaitPath(tuple(GaitPhase(name, (here,), duration_s=0.5) for name in ("stance", "swing")))
        assert carried_m(motion_along(path), RAIL, Traction(8.0, 12.0, 500.0)) == 0.0

    def test_the_longest_path_takes_no_more_time_steps_than_two_seconds(self) -> None:
        slow = replace(WALKING, stance_speed_m_s=0.01, extraction_speed_m_s=0.01, insertion_speed_m_s=0.01)
        assert len(motion_along(crutching(slow))) <= 2.0 / step_model.STEP_S + 3


class TestLimits:
    @given(st.floats(0.5, 8.0), st.floats(0.0, 20.0), st.tuples(*[st.floats(0.5, 12.5)] * 2), st.floats(200.0, 1000.0))
    def test_more_thrust_never_shortens_a_step_within_the_sweep(
        self, dry_n: float, damping_n_s_m: float, pair: tuple[float, float], stiffness_n_m: float
    ) -> None:
        """The plates brake a body that was thrown ahead of the arms, the harder the more they withstand."""
        drag = BodyDrag(dry_n, damping_n_s_m, 1.0)
        weak_m, strong_m = (predicted_m(thrust_n, stiffness_n_m, drag) for thrust_n in sorted(pair))
        assume(weak_m < 2.0 * LENGTH_M * sin(radians(WALKING.sweep_angle_deg)))
        assert strong_m >= weak_m

    def test_the_weaker_of_mud_and_motor_must_exceed_the_dry_drag(self) -> None:
        assert predicted_m(50.0, motor_n=2.5) == predicted_m(2.5, motor_n=50.0) == 0.0
        assert predicted_m(50.0, motor_n=2.6) > 0.0


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

    @pytest.mark.parametrize("damping_n_s_m", [1e-3, 1e-9, 5e-324])
    def test_it_goes_over_into_dry_friction_alone(self, damping_n_s_m: float) -> None:
        """To first order it is shorter by the fraction 2 b v / 3 f_r; 1e-9 covers the rounding."""
        drag = BodyDrag(2.5, damping_n_s_m, 2.0)
        short = 2.0 * damping_n_s_m * 0.6 / (3.0 * 2.5)
        assert coast_m(drag, 0.6) == pytest.approx(coast_m(drag._replace(damping_n_s_m=0.0), 0.6), rel=short + 1e-9)

    def test_without_dry_friction_it_is_the_speed_times_the_lag(self) -> None:
        assert coast_m(BodyDrag(0.0, 6.0, 2.0), 0.6) == pytest.approx(0.6 * 2.0 / 6.0)
        assert coast_m(BodyDrag(1e-9, 6.0, 2.0), 0.6) == pytest.approx(0.6 * 2.0 / 6.0)
