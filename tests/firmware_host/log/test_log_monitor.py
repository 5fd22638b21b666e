"""What the log's writer tells becomes a fault on one side of each bound and none on the other."""

from __future__ import annotations

import pytest

from control.faults import Blocks, FaultKind, Reaction
from control.monitors.joint_monitor import FaultBounds
from firmware_host.log.log_monitor import LogMonitor
from firmware_host.log.recorder import HEALTHY, LogReport

BOUNDS = FaultBounds(disk_free_fraction=0.05, disk_slow_s=2.0)


def names(report: LogReport) -> list[str]:
    return [fault.name for fault in LogMonitor(BOUNDS).update(report)]


def test_a_healthy_log_is_no_fault() -> None:
    assert names(HEALTHY) == []


@pytest.mark.parametrize(
    ("well", "ill", "name"),
    [
        ({"free_fraction": 0.05}, {"free_fraction": 0.0499}, "disk_low"),
        ({"slowest_write_s": 2.0}, {"slowest_write_s": 2.01}, "disk_slow"),
        ({"problem": ""}, {"problem": "The log's disk is read-only."}, "log_unwritable"),
        ({"alive": True}, {"alive": False}, "recorder_dead"),
        ({"dropped": 0}, {"dropped": 1}, "rows_lost"),
    ],
)
def test_each_bound_has_two_sides(well: dict[str, object], ill: dict[str, object], name: str) -> None:
    assert names(HEALTHY._replace(**well)) == []  # type: ignore[arg-type]
    assert names(HEALTHY._replace(**ill)) == [name]  # type: ignore[arg-type]


def test_rows_are_told_lost_when_they_are_lost_and_not_for_ever() -> None:
    watch = LogMonitor(BOUNDS)
    lost = HEALTHY._replace(dropped=7)
    assert watch.update(lost) == [FaultKind.ROWS_LOST.fault(rows=7)]
    assert watch.update(lost) == []
    assert len(watch.update(HEALTHY._replace(dropped=8))) == 1


def test_rows_that_a_dead_writer_does_not_take_are_no_second_fault() -> None:
    assert names(HEALTHY._replace(alive=False, dropped=9)) == ["recorder_dead"]


def test_no_trouble_of_the_log_stops_a_robot_and_what_cannot_be_written_stands_against_arming() -> None:
    ill = LogReport(True, 3, "No space left on device.", 0.0, 0, 9.0)
    faults = LogMonitor(BOUNDS).update(ill) + LogMonitor(BOUNDS).update(HEALTHY._replace(alive=False))
    assert {fault.kind.reaction for fault in faults} == {Reaction.WARN}
    against = {fault.name for fault in faults if fault.kind.blocks is Blocks.UNLESS_FORCED}
    assert against == {"disk_low", "log_unwritable", "recorder_dead"}
