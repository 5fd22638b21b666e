"""A base that moved in a trial is reported; one that did not move is not."""

import pytest

from control.modes import Mode
from control.records import Phase
from experiments.flipper.measurement import (
    ADDUCTION_NM,
    INVALID_M,
    SWEEP_NM,
    load_remarks,
    pose_remarks,
    surface_remarks,
)
from logs.files.log_reader import Log
from tests.experiments.synthetic_strides import (
    CONFIGURATION,
    RIGHT_ADDUCTION,
    RIGHT_SWEEP,
    make_log,
    make_stride,
    make_ticks,
)

NM_A = CONFIGURATION.torque_constants_nm_a[RIGHT_SWEEP]


def trial(joint: int, before_nm: float, after_nm: float) -> Log:
    """Return a log with these torques in air, before the insertion and after the stride; otherwise it is 1 N·m."""
    before, stride = make_ticks([Phase.REST] * 20), make_ticks([Phase.INSERTION] * 50, start_s=0.2)
    after = make_ticks([Phase.REST] * 50, start_s=0.7)
    after["mode"] = Mode.HOLD
    for ticks, torque_nm in ((before, before_nm), (stride, 1.0), (after, after_nm)):
        ticks["current_a"][:, joint] = torque_nm / NM_A
    after["current_a"][:30, joint] = 1.0 / NM_A
    return make_log(before, stride, after)


@pytest.mark.parametrize(("joint", "still_nm", "moved_nm"), [(RIGHT_SWEEP, 0.04, 0.06), (RIGHT_ADDUCTION, 0.2, 0.3)])
def test_a_changed_load_in_free_air_is_reported(joint: int, still_nm: float, moved_nm: float) -> None:
    for sign in (1.0, -1.0):
        assert not load_remarks(trial(joint, 0.1, 0.1 + sign * still_nm), CONFIGURATION, "right")
        (remark,) = load_remarks(trial(joint, 0.1, 0.1 + sign * moved_nm), CONFIGURATION, "right")
        assert ("right_sweep" if joint == RIGHT_SWEEP else "right_adduction") in remark
        bound_nm = SWEEP_NM if joint == RIGHT_SWEEP else ADDUCTION_NM
        assert f"{moved_nm:.2f} N·m, more than {bound_nm:g} N·m" in remark


def test_the_other_flipper_and_a_log_without_an_insertion_give_no_remark() -> None:
    assert not load_remarks(trial(RIGHT_SWEEP, 0.0, 0.9), CONFIGURATION, "left")
    assert not load_remarks(make_log(make_ticks([Phase.REST] * 5)), CONFIGURATION, "right")


def test_a_pose_that_moved_is_reported_in_millimetres() -> None:
    assert "-4.7 mm, more than 2 mm" in pose_remarks(0.1, 0.0953)[0]
    assert not pose_remarks(0.1, 0.0953, INVALID_M) and pose_remarks(0.1, 0.0853, INVALID_M)
    for before_m, after_m in ((0.1, 0.1015), (None, 0.1), (0.1, None), (None, None)):
        assert not pose_remarks(before_m, after_m)


def test_mud_met_far_from_its_nominal_height_is_reported() -> None:
    for surface_m, where in ((0.012, "below"), (-0.012, "above")):
        (remark,) = surface_remarks(make_stride(surface_m=surface_m))
        assert f"12 mm {where} its nominal height, more than 10 mm" in remark
    for still_m in (0.005, None):
        assert not surface_remarks(make_stride(surface_m=still_m))
