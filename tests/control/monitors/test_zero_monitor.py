"""An angle that a drive reports after a gap of this program's own is no shifted zero; one after its silence may be."""

from control.monitors.zero_monitor import ZeroMonitor
from control.records import DriveState

JUMP_RAD = 0.1
BEFORE = DriveState(angle_rad=0.3, velocity_rad_s=0.0, angle_stamp_s=1.0)
AFTER = BEFORE._replace(angle_rad=-0.1, angle_stamp_s=1.05)


def test_an_angle_that_was_asked_for_before_a_gap_of_ours_does_not_end_it() -> None:
    monitor = ZeroMonitor("left_sweep", JUMP_RAD)
    monitor.update(BEFORE._replace(angle_stamp_s=0.997))
    monitor.skip_gap(1.05)
    assert monitor.update(BEFORE) is None  # the answer to the last question before the gap
    assert monitor.update(AFTER) is None
    assert monitor.update(BEFORE._replace(angle_stamp_s=1.2)) is not None


def test_an_angle_after_a_silence_of_the_drive_is_a_shift() -> None:
    monitor = ZeroMonitor("left_sweep", JUMP_RAD)
    assert monitor.update(BEFORE) is None
    assert monitor.update(AFTER) is not None
