"""A pose that fails on purpose."""

from math import isfinite, isnan

import pytest

from control.records import BodyPose
from drivers.fault_injection.failing_pose import LATE_S, FailingPose
from drivers.fault_injection.failures import Failures
from drivers.pose.pose_port import NO_SOURCE, PoseReport

PERIOD_S = 0.01
BEGIN_S, END_S, STOP_S = 0.5, 1.5, 2.0


class RisingPose:
    """A body that moves at 1 m/s."""

    def read(self, now_s: float) -> BodyPose:
        return BodyPose(now_s, now_s)

    def report(self) -> PoseReport:
        return NO_SOURCE


def run(kind: str) -> list[tuple[float, BodyPose]]:
    failures = Failures(())
    pose = FailingPose(RisingPose(), failures)
    seen = []
    for tick in range(round(STOP_S / PERIOD_S)):
        now_s = tick * PERIOD_S
        failures.update(now_s)
        if tick == round(BEGIN_S / PERIOD_S):
            failures.begin("pose", kind, now_s, END_S - BEGIN_S)
        seen.append((now_s, pose.read(now_s)))
    return seen


def during(kind: str) -> list[tuple[float, BodyPose]]:
    return [(now_s, body) for now_s, body in run(kind) if BEGIN_S <= now_s < END_S - 1e-9]


@pytest.mark.parametrize("kind", ["off", "stuck", "garbage", "slow", "intermittent"])
def test_before_and_after_its_failure_the_pose_is_true_and_a_seed_repeats_it(kind: str) -> None:
    assert repr(run(kind)) == repr(run(kind))
    outside = [(now_s, body) for now_s, body in run(kind) if not BEGIN_S <= now_s < END_S + PERIOD_S]
    assert len(outside) > 90 and all(body == (now_s, now_s) for now_s, body in outside)


def test_no_pose_arrives_or_about_half_of_them() -> None:
    assert all(isnan(body.x_m) and body.stamp_s < 0.0 for _, body in during("off"))
    assert 30 < sum(isfinite(body.x_m) for _, body in during("intermittent")) < 70


def test_a_stuck_body_stands_with_fresh_stamps() -> None:
    assert {body.x_m for _, body in during("stuck")} == {BEGIN_S}
    assert all(body.stamp_s == now_s for now_s, body in during("stuck"))


def test_a_corrupted_position_is_plausible_or_not_finite_or_huge() -> None:
    positions_m = [body.x_m for _, body in during("garbage")]
    assert any(isnan(x_m) for x_m in positions_m) and any(abs(x_m) > 1e30 for x_m in positions_m)
    assert any(isfinite(x_m) and 0.0 < abs(x_m) < 100.0 for x_m in positions_m)


def test_a_delayed_position_is_an_earlier_one_with_a_fresh_stamp() -> None:
    early = [body for now_s, body in during("slow") if now_s < BEGIN_S + LATE_S - 0.5 * PERIOD_S]
    later = [(now_s, body) for now_s, body in during("slow") if now_s > BEGIN_S + LATE_S + 0.5 * PERIOD_S]
    assert all(isnan(body.x_m) for body in early) and len(early) == 20
    assert all(abs(now_s - LATE_S - body.x_m) < 1.5 * PERIOD_S and body.stamp_s == now_s for now_s, body in later)
