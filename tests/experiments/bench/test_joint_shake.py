"""A shake finds a stuck encoder before the joint moves far, and passes a working one."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from control.records import JOINTS, DriveState, same_for_all
from experiments.bench.joint_shake import FIRST_NM, HALF_TICKS, SHAKE_TICKS, UNSEEN_RAD, Shake, shake_joint
from experiments.bench.rig import SimulatedRig
from experiments.bench.sign_check import check_nudge
from experiments.bench.simulated_hand import simulated_operator
from experiments.bench.test_rig import TestRig
from experiments.robot.bench_errors import BenchError
from firmware_host.configuration.configuration import Configuration
from simulation.harness.blocks import on_blocks


class Bench:
    """A simulated robot, and the largest true distance of one joint from its start."""

    def __init__(self, configuration: Configuration, joint: str, noise_rad: float = 0.0) -> None:
        drives = on_blocks(configuration).drives(configuration)
        drives[joint] = replace(drives[joint], encoder_noise_rad=noise_rad)
        self.rig = SimulatedRig(configuration, drives=drives)
        self.test_rig = TestRig(self.rig, simulated_operator(self.rig))
        self.index = JOINTS.index(joint)
        self.farthest_rad, self._start_rad = 0.0, self.angle_rad
        self.rig.others.append(self._observe_farthest)

    @property
    def angle_rad(self) -> float:
        return self.rig.robot.plant.angles_rad[self.index]

    def _observe_farthest(self, rig: SimulatedRig) -> None:
        self.farthest_rad = max(self.farthest_rad, abs(self.angle_rad - self._start_rad))

    def stick_encoder(self) -> None:
        """Let the encoder always report the same angle and a speed of exactly zero."""
        drive = self.rig.robot.drives[self.index]
        drive.measure(self.angle_rad, 0.0)
        drive.measure = lambda angle_rad, velocity_rad_s: None  # type: ignore[method-assign]


@pytest.mark.parametrize(("joint", "farthest_rad"), [("left_sweep", 0.02), ("right_adduction", 0.08)])
def test_a_joint_with_a_stuck_encoder_hardly_moves_and_is_reported(
    configuration: Configuration, joint: str, farthest_rad: float
) -> None:
    bench = Bench(configuration, joint)
    bench.stick_encoder()
    (reading,) = check_nudge(bench.test_rig, joint)  # no further attempt follows
    assert bench.farthest_rad < farthest_rad < UNSEEN_RAD
    assert not reading.good and f"{joint}: answer to a shake is 0 rad" in reading.message
    assert not any(drive.torque_nm(bench.rig.now_s) > 0.01 for drive in bench.rig.robot.drives)


def test_a_working_encoder_answers_a_weak_shake(configuration: Configuration) -> None:
    bench = Bench(configuration, "left_sweep", noise_rad=0.0004)
    bench.test_rig.arm()
    assert shake_joint(bench.test_rig, "left_sweep").answered
    assert bench.farthest_rad < 0.01


def test_a_late_tick_ends_a_shake_which_starts_again(
    configuration: Configuration, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(configuration, "left_sweep")
    bench.test_rig.arm()
    wait = bench.rig.wait

    def shake_missing(*missing: int) -> Shake:
        ticks = count(1)
        monkeypatch.setattr(bench.rig, "wait", lambda: wait()._replace(missed=int(next(ticks) in missing)))
        return shake_joint(bench.test_rig, "left_sweep")

    assert shake_missing(45).answered  # in the first shake
    with pytest.raises(BenchError, match="Ticks are missed while a joint is shaken"):
        shake_missing(45, 90, 135)


def test_a_shake_leaves_a_free_joint_at_rest_where_it_was() -> None:
    law, given_nm = Shake(0, 1, 0.003), []
    states = same_for_all(DriveState(angle_rad=0.0))
    while not law.done:
        given_nm.append(law(same_for_all(0.0), states)[0])
    assert max(given_nm) == pytest.approx(FIRST_NM) and len(given_nm) > SHAKE_TICKS == 4 * HALF_TICKS
    speeds = np.cumsum(given_nm)
    assert [speeds[-1], np.sum(speeds)] == pytest.approx([0.0, 0.0], abs=1e-9)
