"""The list of `mudskipper check` fails in exactly the lines whose faults block arming."""

from math import nan
from struct import pack
from typing import Any

import pytest

from control.faults import FAULT_KINDS, OVERRULED_BY_FORCE, Blocks, FaultKind, Reaction
from control.modes import Mode, Request
from control.records import JOINTS, Joints
from firmware_host.configuration.configuration import Configuration
from firmware_host.operator.arming_checks import arming_checks
from firmware_host.sockets.socket_methods import METHODS
from tests.firmware_host.recorded_robot import RecordedRobot

SUBJECTS = {"drive": "left_sweep", "watchdog": "left_sweep", "joint": "left_sweep", "bus": "left", "flipper": "right"}


@pytest.fixture(scope="module")
def ready(configuration: Configuration) -> RecordedRobot:
    """Return a robot that may be armed; tests add and remove faults."""
    robot = RecordedRobot(configuration)
    robot.run_until(lambda: robot.loop.mode is Mode.IDLE and not robot.loop.faults.present, 3.0)
    return robot


def lines_of(robot: RecordedRobot, *names: str, warnings: tuple[str, ...] = ()) -> dict[str, dict[str, Any]]:
    """Return the lines of a robot with only these faults."""
    faults = [FAULT_KINDS[name].fault(SUBJECTS.get(FAULT_KINDS[name].part, "")) for name in names]
    robot.loop.faults.reset()
    robot.loop.faults.update(faults, False)
    items = arming_checks(robot.loop, warnings)
    robot.loop.faults.reset()
    lines = {item["id"]: item for item in items}
    assert len(lines) == len(items)
    return lines


def test_every_line_of_a_ready_robot_is_ok(ready: RecordedRobot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ready.loop, "states", Joints(*(state._replace(angle_rad=0.5) for state in ready.loop.states)))
    lines = lines_of(ready)
    assert all(item["ok"] and not item["fix"] for item in lines.values())
    expected = {"configuration", "loop", "log", "bus.left", "bus.right"}
    assert set(lines) == expected | {f"{part}.{joint}" for part in ("drive", "joint", "watchdog") for joint in JOINTS}
    assert lines["log"]["text"] == "off"
    assert "firmware 0.6.11" in lines["drive.left_sweep"]["text"]
    assert lines["joint.left_sweep"]["text"] == "at 28.6 degrees, 30 degrees C"
    assert lines["watchdog.left_sweep"]["text"] == "trips after 0.1 s"
    assert "380" in lines["loop"]["text"]


def test_a_line_fails_exactly_if_its_fault_blocks_arming(ready: RecordedRobot) -> None:
    for kind in FaultKind:
        fault = kind.fault(SUBJECTS.get(kind.part, ""))
        lines = lines_of(ready, kind)
        line = lines[fault.check_line]
        assert line["ok"] == (kind.blocks is Blocks.NO), kind
        assert line["mandatory"] == (kind.blocks is Blocks.ALWAYS), kind
        assert line["warning"] == line["ok"], kind
        assert (line["text"], line["fix"]) == (fault.message, fault.kind.what_to_do)
        assert all(each["ok"] for identity, each in lines.items() if identity != line["id"]), kind


@pytest.mark.parametrize("by_force", [False, True])
def test_the_check_and_a_refused_arm_agree(ready: RecordedRobot, by_force: bool) -> None:
    loop = ready.loop
    for kind in FaultKind:
        fault = kind.fault(SUBJECTS.get(kind.part, ""))
        lines = lines_of(ready, kind)
        forced = kind.value if by_force and kind.value in OVERRULED_BY_FORCE else ""
        loop.faults.update([fault], False)
        loop.health = loop.health._replace(worst=loop.faults.worst)
        against = [line for line in lines.values() if not line["ok"] and (line["mandatory"] or not forced)]
        refused = loop.request(Request.ARM, ready.now_s, forced=forced)
        loop.pending_request, loop.forced = Request.NONE, ""
        loop.faults.reset()
        loop.health = loop.health._replace(worst=None)
        assert fault.message in (refused or "") if against else refused is None


def test_a_line_shows_its_blocking_faults_and_each_advice_once(ready: RecordedRobot) -> None:
    line = lines_of(ready, "drive_late", "drive_silent", "drive_version", "heartbeat_silent")["drive.left_sweep"]
    blocking = [
        kind.fault("left_sweep")
        for kind in (FaultKind.DRIVE_SILENT, FaultKind.DRIVE_VERSION, FaultKind.HEARTBEAT_SILENT)
    ]
    assert line["text"] == " ".join(fault.message for fault in blocking)
    assert line["fix"] == "; ".join(fault.kind.what_to_do for fault in blocking[:2])


def test_warnings_of_the_computer_are_lines_that_block_nothing(ready: RecordedRobot) -> None:
    line = lines_of(ready, warnings=("no real-time priority",))["realtime"]
    assert (line["ok"], line["warning"], line["text"]) == (True, True, "no real-time priority")
    assert line.keys() == METHODS["check"].answer_keys.keys() and not line["mandatory"]


def test_an_unheard_drive_is_a_mandatory_line_with_its_missing_signals(configuration: Configuration) -> None:
    robot = RecordedRobot(configuration)
    silent = robot.robot.drives[2]
    silent.cyclic_frames = lambda now_s: iter(())  # type: ignore[method-assign]
    robot.run_for(0.5)
    items = {item["id"]: item for item in arming_checks(robot.loop, [])}
    unheard = {identity for identity, item in items.items() if not item["ok"]}
    assert unheard == {"drive.right_sweep"}
    assert items["drive.right_sweep"]["text"] == "not heard: no position, current, heartbeat yet"
    assert items["drive.right_sweep"]["mandatory"] and "wiring" in items["drive.right_sweep"]["fix"]
    assert not items.keys() & {"joint.right_sweep", "watchdog.right_sweep"}
    assert "joint.left_sweep" in items and not any("nan" in item["text"] for item in items.values())
    assert robot.loop.request(Request.ARM, robot.now_s, forced="watchdog_unknown") is not None


@pytest.mark.parametrize("sent", [None, nan], ids=["never sent", "sent as no number"])
def test_a_drive_without_temperature_is_reported_but_does_not_block_arming(
    configuration: Configuration, sent: float | None
) -> None:
    robot = RecordedRobot(configuration)
    for drive in robot.robot.drives:
        everything = drive.cyclic_frames
        drive.cyclic_frames = lambda now_s, everything=everything: (  # type: ignore[method-assign, misc]
            frame if frame.arbitration_id & 0x1F != 0x15 else frame._replace(data=pack("<ff", 30.0, sent))
            for frame in everything(now_s)
            if sent is not None or frame.arbitration_id & 0x1F != 0x15
        )
    robot.run_until(lambda: robot.loop.mode is Mode.IDLE and not robot.loop.faults.blocking(), 3.0)
    items = {item["id"]: item for item in arming_checks(robot.loop, [])}
    assert all("the currents alone guard it" in items[f"drive.{joint}"]["text"] for joint in JOINTS)
    assert all(item["ok"] for item in items.values())
    assert robot.loop.faults.reaction is Reaction.NONE
