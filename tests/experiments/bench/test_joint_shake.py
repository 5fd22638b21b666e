"""A shake finds a stuck encoder before the joint moves far, and passes a working one."""

from dataclasses import replace

import pytest

from control.parameters.arm_mass import ArmMass
from control.rate import PERIOD_S
from control.records import JOINTS, DriveState, same_for_all
from experiments.bench.joint_shake import FIRST_NM, HALF_TICKS, SHAKE_TICKS, UNSEEN_RAD, Shake, shake_joint
from experiments.bench.rig import SimulatedRig
from experiments.bench.sign_check import check_nudge
from experiments.bench.simulated_hand import simulated_operator
from experiments.bench.test_rig import TestRig
from experiments.robot.bench_errors import BenchError
from firmware_host.configuration.configuration import Configuration
from firmware_host.ticker import Tick
from simulation.harness.blocks import on_blocks


class Bench:
    """A simulated robot, and the largest true distance of one joint from its start."""

    def __init__(self, configuration: Configuration, joint: str, inertia: float = 1.0, noise_rad: float = 0.0) -> None:
        index, arm = JOINTS.index(joint), configuration.arm
        mass = ArmMass(
            arm.arm_mass_kg,
            arm.center_of_mass_m,
            inertia * arm.sweep_inertia_kg_m2,
            inertia * arm.adduction_inertia_kg_m2,
        )
        drives = on_blocks(configuration).drives(configuration)
        drives[joint] = replace(drives[joint], encoder_noise_rad=noise_rad)
        self.rig = SimulatedRig(configuration, replace(configuration, arm=mass), drives)
        self.test_rig = TestRig(self.rig, simulated_operator(self.rig))
        self.drive = self.rig.robot.drives[index]
        self.farthest_rad = 0.0
        before_rad = self.rig.robot.plant.angles_rad[index]

        def observe_farthest(rig: SimulatedRig) -> None:
            self.farthest_rad = max(self.farthest_rad, abs(rig.robot.plant.angles_rad[index] - before_rad))

        self.rig.others.append(observe_farthest)

    def stick_encoder(self) -> None:
        """Let the encoder always report the same angle and a speed of exactly zero."""
        self.drive.measure(self.rig.robot.plant.angles_rad[self.rig.robot.drives.index(self.drive)], 0.0)
        self.drive.measure = lambda angle_rad, velocity_rad_s: None  # type: ignore[method-assign]

    def without_friction(self) -> None:
        for arm in self.rig.robot.plant.arms:
            arm.parameters = replace(arm.parameters, joint_coulomb_nm=0.0)


@pytest.mark.parametrize(("joint", "farthest_rad"), [("left_sweep", 0.02), ("right_adduction", 0.08)])
def test_a_joint_with_a_stuck_encoder_hardly_moves_and_is_reported(
    configuration: Configuration, joint: str, farthest_rad: float
) -> None:
    bench = Bench(configuration, joint)
    bench.stick_encoder()
    readings = list(check_nudge(bench.test_rig, joint))
    assert bench.farthest_rad < farthest_rad < UNSEEN_RAD
    (reading,) = readings  # no further attempt follows
    assert not reading.good and f"{joint}: answer to a shake is 0 rad" in reading.message
    assert "turn it by hand while its torque is off" in reading.message
    assert not any(drive.torque_nm(bench.rig.now_s) > 0.01 for drive in bench.rig.robot.drives)


def shake_of(bench: Bench, joint: str) -> Shake:
    bench.test_rig.arm()
    return shake_joint(bench.test_rig, joint)


def test_a_working_encoder_answers_a_weak_shake(configuration: Configuration) -> None:
    bench = Bench(configuration, "left_sweep", noise_rad=0.0004)
    assert shake_of(bench, "left_sweep").answered
    assert bench.farthest_rad < 0.01


def test_a_late_tick_ends_a_shake_which_starts_again(
    configuration: Configuration, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(configuration, "left_sweep")
    bench.test_rig.arm()
    wait, ticks = bench.rig.wait, [0]

    def late_at(*missing: int) -> None:
        def tick() -> Tick:
            ticks[0] += 1
            return wait()._replace(missed=1) if ticks[0] in missing else wait()

        ticks[0] = 0
        monkeypatch.setattr(bench.rig, "wait", tick)

    late_at(45)  # in the first shake
    assert shake_joint(bench.test_rig, "left_sweep").answered
    late_at(45, 90, 135)
    with pytest.raises(BenchError, match="Ticks are missed while a joint is shaken: end other programs"):
        shake_joint(bench.test_rig, "left_sweep")


def test_a_shake_leaves_a_free_joint_at_rest_where_it_was() -> None:
    law, given_nm_s = Shake(0, 1, 0.003), []
    states = same_for_all(DriveState(angle_rad=0.0))
    while not law.done:
        given_nm_s.append(
            law(
                same_for_all(0.0),
                states,
            )[0]
            * PERIOD_S
        )
    assert sum(given_nm_s) == pytest.approx(0.0, abs=1e-12)
    assert max(given_nm_s) == pytest.approx(FIRST_NM * PERIOD_S) and len(given_nm_s) > SHAKE_TICKS == 4 * HALF_TICKS
    travel = speed = 0.0
    for impulse in given_nm_s:
        speed += impulse
        travel += speed
    assert travel == pytest.approx(0.0, abs=1e-12)
