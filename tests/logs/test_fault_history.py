"""The faults of a log are read back as the causes that the daemon reported."""

from typing import Any

import pytest

from control.controller import WalkOrder
from control.faults import FaultKind
from control.modes import Mode
from control.records import FLIPPERS, JOINTS
from drivers.fault_injection.failures import Failures
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.rows import EVENT, EVENT_KIND
from firmware_host.loop_events import LoopEvents
from logs.fault_history import read_buses, read_causes
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.recorded_events import EventRecorder
from verification.faults.failing_robot import RowList

TEXT = "\n".join(f'[drive.{joint}]\nbus = "{joint.partition("_")[0]}"' for joint in JOINTS)
SUBJECTS = {
    **dict.fromkeys(("drive", "watchdog", "joint"), JOINTS),
    **dict.fromkeys(("bus", "flipper", "estimator"), FLIPPERS),
}


def events(*texts: str) -> list[dict[str, Any]]:
    return [{"stamp_s": 10.0 + i, "text": text} for i, text in enumerate(texts)]


@pytest.mark.parametrize("kind", FaultKind)
def test_every_fault_of_every_part_is_read_back(kind: FaultKind) -> None:
    for subject in SUBJECTS.get(kind.part, ("",)):
        recorder = EventRecorder()
        written = LoopEvents(recorder, 1.0, {})
        written.report_mode_change(0.0, Mode.BOOT, Mode.IDLE, None, rested=False, flippers_up=True)
        written.report_faults(10.0, [kind.fault(subject)], [])
        (cause,) = read_causes(events(*recorder.texts), TEXT)
        assert (cause.name, cause.subjects, cause.consequences) == (kind, (subject,), ())


def test_faults_that_were_never_present_together_do_not_follow_from_each_other() -> None:
    bus, silent = "fault bus_off (damping): The left bus is off.", "fault drive_silent (damping): The left_sweep drive."
    apart = read_causes(events(bus, "over: bus_off left", silent), TEXT)
    assert [cause.name for cause in apart] == ["bus_off", "drive_silent"]
    (together,) = read_causes(events(bus, silent), TEXT)
    assert together.name == "bus_off" and together.consequences == ("drive_silent",)
    (again,) = read_causes(events(bus, "over: bus_off left", bus), TEXT)
    assert (again.first_s, again.times) == (10.0, 2)


def test_a_cause_has_time_and_message_of_its_own_faults_and_not_of_a_consequence_of_the_same_kind() -> None:
    bus, left = "fault bus_off (damping): The left bus is off.", "fault drive_silent (damping): The left_sweep drive."
    right = left.replace("left", "right")
    (_, silent) = read_causes(events(bus, left, right, "over: drive_silent right_sweep", right), TEXT)
    assert (silent.first_s, silent.subjects, silent.times) == (12.0, ("right_sweep",), 2)
    assert silent.message == "The right_sweep drive."


def test_what_a_drive_reports_soon_after_its_start_was_no_fault() -> None:
    unknown, over = "fault watchdog_unknown (none): The left_sweep drive.", "over: watchdog_unknown left_sweep"
    heard = "mode boot to idle"
    assert read_causes(events(unknown, heard, over), TEXT) == []
    assert len(read_causes(events(unknown, heard, *["nothing"] * 3, over), TEXT)) == 1
    assert len(read_causes(events(heard, *["nothing"] * 3, unknown, over), TEXT)) == 1


def test_a_bus_that_fails_in_a_walk_is_one_cause(configuration: Configuration) -> None:
    recorder = RowList()
    track = Track([(2.0, MUDS["48.5"])])
    robot = Lockstep(configuration, track, recorder=recorder, failures=Failures(configuration.bus))
    robot.arm()
    robot.walk(WalkOrder(0.03))
    robot.run_for(0.5)
    robot.fail("bus.left", "off")
    robot.run_for(1.0)
    reported = [EVENT.decode(row) for number, row in recorder.rows if number == EVENT_KIND]
    causes = read_causes(reported, configuration.text)
    (bus,) = [cause for cause in causes if cause.name == "bus_refuses"]
    assert bus.subjects == ("left",) and "drive_silent" in bus.consequences
    assert not {"drive_silent", "drive_quiet", "drive_late"} & {cause.name for cause in causes}


@pytest.mark.parametrize("text", ["", "drive = 3", "no TOML [", "[drive]\nleft_sweep = 3"])
def test_a_configuration_without_buses_hides_no_fault(text: str) -> None:
    assert read_buses(text) == {}
    assert len(read_causes(events("fault pose_lost (warn): The body's position is no longer reported."), text)) == 1


def test_other_texts_are_no_faults() -> None:
    assert read_causes(events("mode idle to arming", "fault of another version (warn): x", "over: nothing"), TEXT) == []
