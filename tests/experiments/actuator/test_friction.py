"""Friction from loops is recovered from synthetic motions with known friction, and from a simulated joint."""

from collections.abc import Callable
from math import copysign, cos, pi, sin
from pathlib import Path

import pytest

from experiments.actuator import simulation as actuator_simulation
from experiments.actuator.friction import friction_of, loop_of, swing_arm
from experiments.actuator.reading import HeldSample, MovedError
from experiments.actuator.simulation import TRUE_CONSTANT_NM_A
from tests.experiments.actuator.test_reading import held_arm

HALF_RAD, DRY_A, VISCOUS_A_S = 0.09, 0.18, 0.03


def made_stroke(direction: float, duration_s: float, taken_a: Callable[[float, float], float]) -> list[HeldSample]:
    """Return half a cosine from rest to rest; `taken_a` is the current besides friction, by angle and acceleration."""
    samples, rate = [], pi / duration_s
    for number in range(501):
        now_s = duration_s * number / 500
        angle_rad = -direction * HALF_RAD * cos(rate * now_s)
        velocity_rad_s = direction * HALF_RAD * rate * sin(rate * now_s)
        friction_a = copysign(DRY_A, direction) + VISCOUS_A_S * velocity_rad_s
        load_a = taken_a(angle_rad, -(rate**2) * angle_rad)
        samples.append(HeldSample(now_s, angle_rad, load_a + friction_a, 30.0))
    rest = HeldSample(2.0 * duration_s, direction * HALF_RAD, load_a, 30.0)
    return [*samples, *[rest._replace(now_s=rest.now_s + 0.01 * number) for number in range(60)]]


def weight_magnets_and_inertia(angle_rad: float, acceleration_rad_s2: float) -> float:
    return 0.6 * cos(angle_rad) + 0.18 * sin(168.0 * angle_rad + 1.0) + 0.008 * acceleration_rad_s2


@pytest.mark.parametrize("duration_s", [0.3, 2.0])
def test_a_loop_shows_friction_and_no_reversible_work(duration_s: float) -> None:
    up, down = (made_stroke(direction, duration_s, weight_magnets_and_inertia) for direction in (1.0, -1.0))
    loop = loop_of(up, down, quick=False)
    speed_rad_s = pi / 4.0 * HALF_RAD * pi / duration_s  # mean over the path of half a cosine
    assert loop.speed_rad_s == pytest.approx(speed_rad_s, rel=1e-3)
    assert loop.spent_a == pytest.approx(DRY_A + VISCOUS_A_S * speed_rad_s, rel=1e-3)
    assert loop.held_a == pytest.approx(0.6, abs=0.015)  # the weight alone


def test_a_stop_within_a_loop_does_no_work() -> None:
    up, down = (made_stroke(direction, 0.5, lambda *_: 0.6) for direction in (1.0, -1.0))
    stops = [sample._replace(current_a=0.6) for sample in up[200:201]] * 300
    stopped = loop_of([*up[:201], *stops, *up[200:]], down, quick=False)
    assert stopped.spent_a == pytest.approx(loop_of(up, down, quick=False).spent_a, rel=1e-6)


def test_a_blocked_arm_makes_no_loop() -> None:
    up, down = (made_stroke(direction, 0.5, lambda *_: 0.6) for direction in (1.0, -1.0))
    with pytest.raises(MovedError, match=r"swings by 0\.0 degrees only: is it blocked"):
        loop_of(up, up, quick=True)
    with pytest.raises(MovedError, match=r"swings by -10\.3 degrees"):
        loop_of(down, up, quick=True)


def test_a_simulated_joint_has_the_friction_that_it_was_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(actuator_simulation, "COULOMB_NM", 0.03)
    with held_arm("right_sweep", 6, tmp_path) as (robot, _, held):
        middle_rad = held.held_rad
        dry_a, dry_error_a, viscous_a_s, viscous_error_a_s = friction_of(swing_arm(held) + swing_arm(held))
        assert held.held_rad == pytest.approx(middle_rad)
        viscous_nm_s = robot.lockstep.robot.plant.parameters.joint_friction_nm_s
    assert dry_error_a * TRUE_CONSTANT_NM_A < 0.0015
    assert abs(dry_a - 0.03 / TRUE_CONSTANT_NM_A) < 2.0 * dry_error_a
    assert abs(viscous_a_s - viscous_nm_s / TRUE_CONSTANT_NM_A) < 2.0 * viscous_error_a_s
