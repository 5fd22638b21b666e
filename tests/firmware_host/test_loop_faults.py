"""The whole loop limits the motion of joints after a fault, stays disarmed, and lets operators overrule and clear.

One robot walks through all phases and is copied in each, so that every failure begins in the same state. Failures are
those of the table; the fault matrix proves that each is reported in time, in every phase.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace

import pytest

from control.controller import SOFT_STOP_S, WalkOrder
from control.fault_causes import group_by_cause
from control.faults import Clears, FaultKind, Reaction
from control.modes import Mode, Request
from control.rate import PERIOD_S
from control.records import JOINTS, Phase
from drivers.fault_injection.failure_table import BY_NAME
from drivers.power_switch import EmergencyStopParameters, PowerSwitch
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from simulation.devices.drive import DriveError
from simulation.devices.odrive.device import SimulatedOdrive
from simulation.mud.clay import Clay
from simulation.mud.track import Track
from tests.control.synthetic_states import NO_TORQUE
from tests.copied_robots import copy_of
from tests.firmware_host.recorded_robot import RecordedRobot as Robot
from verification.faults.injection import ACTS, inject

WALK = WalkOrder(0.03, adaptive=False)
STAGES = ("insertion", "swing", "stopping")
UP_RAD = 0.12
JOINT = "left_adduction"


Copied = Callable[[str], Robot]


def mode_of(robot: Robot) -> Mode:
    return robot.loop.mode


def is_up(robot: Robot) -> bool:
    """Return whether both flippers are out of the mud."""
    return all(abs(robot.robot.plant.angles_rad[joint]) < UP_RAD for joint in (1, 3))


def until_phase(robot: Robot, phase: Phase, and_for_s: float) -> None:
    assert robot.run_until(lambda: robot.loop.target.phase is phase, 5.0)
    robot.run_for(and_for_s)


@pytest.fixture(scope="module")
def stages(configuration: Configuration) -> dict[str, Robot]:
    """Return copies of one robot, one in each stage of a walk."""
    robot = Robot(configuration)
    robot.run_for(2.0)
    found = {"idle": copy_of(robot)}
    robot.arm()
    robot.run_for(0.6)
    found["holding"] = copy_of(robot)
    robot.walk(WALK)
    robot.run_for(0.1)
    found["raising"] = copy_of(robot)
    for phase, and_for_s in ((Phase.INSERTION, 0.1), (Phase.STANCE, 0.1), (Phase.EXTRACTION, 0.02), (Phase.SWING, 0.2)):
        until_phase(robot, phase, and_for_s)
        found[phase.name.lower()] = copy_of(robot)
    until_phase(robot, Phase.STANCE, 0.1)
    robot.loop.request(Request.STOP, robot.now_s)
    robot.run_for(0.1)
    assert mode_of(robot) is Mode.STOPPING
    return found | {"stopping": robot}


@pytest.fixture
def at(stages: dict[str, Robot]) -> Copied:
    return lambda stage: copy_of(stages[stage])


def fail(robot: Robot, fault: str, joint: str = JOINT) -> AbstractContextManager[None]:
    """Begin the failure that leads to this fault; leaving the returned context ends it."""
    injection = inject(robot, BY_NAME[fault], joint)
    injection.__enter__()
    return injection


def end(injection: AbstractContextManager[None]) -> None:
    injection.__exit__(None, None, None)


def ticks_until(robot: Robot, name: str, longest: int) -> int:
    for tick in range(1, longest + 1):
        robot.step()
        if name in {fault.name for fault in robot.loop.faults.begun}:
            return tick
    raise AssertionError(f"no {name} in {longest} ticks, but {robot.loop.faults.present}")


@pytest.mark.parametrize("stage", STAGES)
def test_a_drive_that_falls_silent_leads_to_damping_and_then_to_idle_drives(at: Copied, stage: str) -> None:
    robot = at(stage)
    fail(robot, "drive_silent")
    ticks: dict[Mode, int] = {}
    for tick in range(1, 20):
        robot.step()
        ticks.setdefault(mode_of(robot), tick)
    assert ticks[Mode.DAMPING] <= FaultKind.DRIVE_QUIET.bound_ticks
    assert ticks[Mode.DAMPING] < ticks[Mode.FAULT] <= FaultKind.DRIVE_SILENT.bound_ticks
    assert robot.loop.sent.torques_nm == NO_TORQUE
    assert JOINT in robot.loop.events.notice and "stopped by drive_silent" in robot.loop.events.notice


def after_release(robot: Robot) -> None:
    """Once the power is back nothing moves until an operator clears and arms."""
    robot.run_for(2.0)
    assert mode_of(robot) in (Mode.FAULT, Mode.IDLE) and not any(robot.energised)
    assert robot.loop.request(Request.ARM, robot.now_s) is not None
    for zero in robot.loop.fault_monitor.zeros:  # of joints that fell meanwhile: `clear --zero`
        zero.confirm()
    assert robot.loop.request(Request.CLEAR, robot.now_s) is None
    robot.run_for(2.0)  # version and watchdog are read again in this time
    assert mode_of(robot) is Mode.IDLE and not robot.loop.faults.present
    assert robot.loop.request(Request.ARM, robot.now_s) is None
    assert robot.run_until(lambda: mode_of(robot) is Mode.HOLD, 1.0)
    assert [text.partition(":")[0] for text in robot.recorder.about("power") if "mode " not in text] == [
        "fault power_cut (drives_idle)",
        "the motors' power is back",
        "over",
    ]


@pytest.mark.parametrize(
    ("stage", "failure"),
    [("idle", "power_cut"), ("stance", "power_cut"), ("stopping", "power_cut, the drives restart")],
)
def test_all_drives_that_fall_silent_at_once_have_no_power(at: Copied, stage: str, failure: str) -> None:
    robot = at(stage)
    cut = fail(robot, failure)
    ticks_until(robot, "power_cut", FaultKind.POWER_CUT.bound_ticks)
    robot.run_for(1.0)
    assert robot.loop.fault_monitor.power_cut
    causes = group_by_cause(robot.loop.aged_faults, robot.loop.configuration.bus_of)
    assert [cause.root.name for cause in causes] == ["power_cut"]
    assert robot.loop.events.notice.startswith("stopped by power_cut: ") or stage == "idle"
    if mode_of(robot) is Mode.IDLE:
        refused = robot.loop.request(Request.ARM, robot.now_s) or ""
        assert refused.startswith("The motors' power was cut") and "No message" not in refused  # the cause alone
    assert robot.loop.request(Request.CLEAR, robot.now_s) is None
    robot.run_for(0.6)
    assert "power_cut" in robot.fault_names  # the cause is still there
    end(cut)
    after_release(robot)


@pytest.mark.parametrize(("failing", "spread_s"), [(("bus.left",), 0.0), (("bus.left", "bus.right"), 0.3)])
def test_one_bus_or_one_drive_after_the_other_is_no_cut_of_the_power(
    at: Copied, failing: tuple[str, ...], spread_s: float
) -> None:
    robot = at("holding")
    for component in failing:
        robot.fail(component, "off", 3.0)
        robot.run_for(spread_s)
    robot.run_for(1.0)
    names = robot.fault_names
    assert "drive_silent" in names and "power_cut" not in names


def test_an_input_that_says_that_the_power_is_cut_idles_the_drives(at: Copied) -> None:
    robot, pressed = at("stance"), [True]
    robot.loop.power_switch = PowerSwitch(lambda: pressed[0], "line 17 of /dev/gpiochip0")
    ticks_until(robot, "power_cut", 10)
    assert mode_of(robot) is Mode.FAULT and "line 17" in robot.loop.events.notice
    pressed[0] = False
    after_release(robot)


def test_a_clear_before_a_cut_of_the_power_does_not_clear_the_cut(at: Copied) -> None:
    """A request to clear lasts for half a second, and a cut may be as short."""
    robot, pressed = at("idle"), [False]
    robot.loop.power_switch = PowerSwitch(lambda: pressed[0], "line 17 of /dev/gpiochip0")
    assert robot.loop.request(Request.CLEAR, robot.now_s) is None
    robot.run_for(0.05)
    pressed[0] = True
    ticks_until(robot, "power_cut", 10)
    pressed[0] = False
    after_release(robot)


def test_a_drive_may_say_that_the_power_is_cut(configuration: Configuration) -> None:
    robot = Robot(replace(configuration, emergency_stop=EmergencyStopParameters("drives")))
    robot.run_for(2.0)
    robot.arm()
    robot.drive(JOINT).trip(DriveError.UNDERVOLTAGE)
    ticks_until(robot, "power_cut", 50)
    assert f"the {JOINT} drive reports bus under-voltage" in robot.loop.events.notice
    after_release(robot)


@pytest.mark.parametrize("stage", STAGES)
def test_damping_never_speeds_a_joint_up(at: Copied, stage: str) -> None:
    """This holds from the third tick on, because the slew limit needs two to end the previous torque."""
    robot = at(stage)
    silent = fail(robot, "position_stale")
    ticks = 0
    while mode_of(robot) is not Mode.FAULT:
        robot.step()
        ticks += mode_of(robot) is Mode.DAMPING
        if mode_of(robot) is Mode.DAMPING and ticks == 3:
            end(silent)  # like a plug that makes contact again
        if mode_of(robot) is Mode.DAMPING and ticks > 3:
            for torque_nm, state in zip(robot.loop.sent.torques_nm, robot.loop.states, strict=True):
                assert torque_nm * state.velocity_rad_s <= 0.0
                assert abs(torque_nm) <= 0.4
        assert ticks * PERIOD_S < 3.1
    assert ticks > 100
    assert robot.loop.fault is not None and robot.loop.fault.name == "position_stale"


def test_a_joint_whose_encoder_jumped_gets_no_torque_until_the_drives_are_idle(at: Copied) -> None:
    robot = at("stance")
    fail(robot, "encoder_jump", "left_sweep")
    ticks_until(robot, "encoder_jump", FaultKind.ENCODER_JUMP.bound_ticks)
    assert mode_of(robot) is Mode.DAMPING
    robot.run_for(3 * PERIOD_S)
    torques = []
    while mode_of(robot) is Mode.DAMPING:
        torques.append(robot.loop.sent.torques_nm)
        robot.step()
    assert len(torques) > 50
    assert {each[0] for each in torques} == {0.0}
    assert any(each[2] for each in torques)  # the other joints are braked


@pytest.mark.parametrize(("stage", "is_held"), [*((stage, False) for stage in STAGES), ("stance", True)])
def test_a_soft_stop_ends_in_time_with_the_flippers_up_unless_the_mud_holds_them(
    at: Copied, stage: str, is_held: bool
) -> None:
    robot = at(stage)
    for arm in robot.robot.plant.arms if is_held else ():
        arm.track = Track([(5.0, Clay("40 kPa", 40e3))])
    fail(robot, "voltage_under")
    ticks_until(robot, "voltage_under", FaultKind.VOLTAGE_UNDER.bound_ticks)
    assert robot.run_until(lambda: mode_of(robot) is Mode.FAULT, SOFT_STOP_S + 0.2)
    assert is_up(robot) is not is_held
    robot.step()
    assert not any(robot.energised)


def test_a_fault_that_ends_with_its_cause_does_not_arm_the_robot_again(at: Copied) -> None:
    robot = at("holding")
    low = fail(robot, "voltage_under")
    assert robot.run_until(lambda: mode_of(robot) is Mode.FAULT, 4.0)
    robot.run_for(0.5)
    assert mode_of(robot) is Mode.FAULT  # the cause lasts
    end(low)
    assert robot.run_until(lambda: mode_of(robot) is Mode.IDLE, 0.5)
    for _ in range(500):
        robot.step()
        assert mode_of(robot) is Mode.IDLE
        assert not any(robot.energised)
    assert robot.loop.fault is None
    assert "stopped by voltage_under" in robot.loop.events.notice  # still shown
    assert robot.loop.request(Request.ARM, robot.now_s) is None


@pytest.mark.parametrize("name", ["drive_silent", "drive_restarted", "encoder_jump", "drive_disarmed"])
def test_a_fault_that_must_be_cleared_stays_until_then_even_against_force(at: Copied, name: str) -> None:
    robot = at("stance")
    failure = fail(robot, name)
    assert robot.run_until(lambda: mode_of(robot) is Mode.FAULT, 4.0)
    end(failure)
    robot.run_for(1.0)
    assert mode_of(robot) is Mode.FAULT
    assert name in {fault.name for fault in robot.loop.faults.present if fault.kind.clears is Clears.BY_HAND}
    assert robot.loop.request(Request.ARM, robot.now_s, forced="watchdog_unknown") is not None
    assert robot.loop.request(Request.CLEAR, robot.now_s) is None
    assert robot.run_until(lambda: mode_of(robot) is Mode.IDLE, 0.6)
    robot.run_for(1.5)  # version and watchdog are read again in this time
    assert mode_of(robot) is Mode.IDLE and not robot.loop.faults.present
    assert sum(text.startswith(f"fault {name} ") for text in robot.recorder.texts) == 1
    assert robot.loop.request(Request.ARM, robot.now_s) is None


# force


OVERRULED = "watchdog_unknown,uncalibrated"


@pytest.fixture
def unfit(example_text: str) -> Robot:
    """Return a robot that is not calibrated, with a drive whose watchdog settings cannot be read."""
    robot = Robot(parse_configuration(example_text))
    drive = robot.robot.drives[2]
    assert isinstance(drive, SimulatedOdrive)
    drive._read_parameter = lambda data: []  # type: ignore[method-assign]
    robot.run_for(1.5)
    assert {fault.name for fault in robot.loop.faults.blocking()} == set(OVERRULED.split(","))
    return robot


def test_arming_by_force_logs_every_overruled_fault(unfit: Robot) -> None:
    for forced, named in (("uncalibrated", ["right_sweep"]), ("watchdog_unknown", JOINTS), ("", JOINTS)):
        refused = unfit.loop.request(Request.ARM, unfit.now_s, forced=forced)
        assert refused is not None and all(joint in refused for joint in named)
    assert unfit.loop.request(Request.ARM, unfit.now_s, forced=OVERRULED) is None
    assert unfit.run_until(lambda: mode_of(unfit) is Mode.HOLD, 1.0)
    assert unfit.loop.forced and "uncalibrated" in unfit.fault_names
    watchdog, calibration = unfit.recorder.about("armed by force despite ")
    assert "watchdog_unknown" in watchdog and "right_sweep" in watchdog
    assert "uncalibrated" in calibration and all(joint in calibration for joint in JOINTS)
    assert f"request arm by force against {OVERRULED}" in unfit.recorder.texts


@pytest.mark.parametrize("name", ["everything", "disk_low"])
def test_force_overrules_the_one_check_that_it_names(unfit: Robot, name: str) -> None:
    refused = unfit.loop.request(Request.ARM, unfit.now_s, forced=name)
    assert refused is not None and (name in refused) is (name != "disk_low")


def test_a_disarmed_request_by_force_leaves_no_trace(unfit: Robot) -> None:
    assert unfit.loop.request(Request.ARM, unfit.now_s, forced=OVERRULED) is None
    unfit.loop.request(Request.DISARM, unfit.now_s)
    unfit.step()
    assert mode_of(unfit) is Mode.IDLE
    assert unfit.loop.request(Request.ARM, unfit.now_s) is not None
    unfit.run_for(0.1)
    assert mode_of(unfit) is Mode.IDLE


@pytest.mark.parametrize(("stage", "order"), [("idle", Request.ARM), ("holding", Request.WALK)])
def test_nothing_that_a_disarm_of_the_same_tick_drops_is_accepted(at: Copied, stage: str, order: Request) -> None:
    robot = at(stage)
    assert robot.loop.request(Request.DISARM, robot.now_s) is None
    assert "disarm" in (robot.loop.request(order, robot.now_s) or "")
    robot.step()
    assert robot.loop.request(Request.ARM, robot.now_s) is None


def test_force_without_a_fault_to_overrule_is_not_recorded(at: Copied) -> None:
    robot = at("idle")
    assert robot.loop.request(Request.ARM, robot.now_s, forced="watchdog_unknown") is None
    assert robot.run_until(lambda: mode_of(robot) is Mode.HOLD, 1.0)
    assert not robot.loop.forced
    assert not any("despite" in text for text in robot.recorder.texts)


# faults that hold, and warnings


def test_during_a_fault_with_hold_the_robot_stops_on_request_and_walks_again_after_it(at: Copied) -> None:
    """The currents of one drive are lost for five ticks: enough for a hold, too few for a stop."""
    robot = at("stance")
    silent = fail(robot, "current_stale")
    ticks_until(robot, "current_stale", FaultKind.CURRENT_STALE.bound_ticks)
    end(silent)
    assert mode_of(robot) is Mode.HOLD
    assert robot.loop.faults.reaction is Reaction.HOLD
    assert not is_up(robot)
    assert robot.loop.request(Request.WALK, robot.now_s, WALK) is not None
    assert robot.loop.request(Request.STOP, robot.now_s) is None
    robot.step()
    assert mode_of(robot) is Mode.STOPPING
    assert robot.run_until(lambda: mode_of(robot) is Mode.HOLD, SOFT_STOP_S)
    assert is_up(robot) and not robot.loop.faults.present
    assert robot.loop.request(Request.WALK, robot.now_s, WALK) is None
    robot.step()
    assert mode_of(robot) is Mode.WALKING


def test_warnings_change_no_torque(at: Copied) -> None:
    well, warned = at("insertion"), at("insertion")
    for name in ("voltage_low", "bus_warning"):
        fail(warned, name)
    for _ in range(500):
        well.step()
        warned.step()
        assert warned.loop.sent == well.loop.sent
    assert mode_of(warned) is Mode.WALKING
    assert {"voltage_low", "bus_warning"} <= warned.fault_names


@pytest.mark.parametrize("step_s", [-2.0, -0.012, 0.005, 0.1])
def test_a_walk_goes_on_while_the_wall_clock_is_stepped(at: Copied, step_s: float) -> None:
    """The kernel stamps frames with this clock."""
    robot = at("insertion")
    with ACTS["wall_clock_stepped"](robot, JOINT, step_s):
        for _ in range(300):
            robot.step()
            assert robot.loop.faults.reaction is Reaction.NONE
    assert mode_of(robot) is Mode.WALKING


def test_a_robot_without_requests_disarms_by_itself(configuration: Configuration) -> None:
    motion = replace(configuration.motion, longest_hold_s=1.0)
    robot = Robot(replace(configuration, motion=motion))
    robot.arm()
    robot.run_for(0.9)
    assert mode_of(robot) is Mode.HOLD
    robot.run_for(0.2)
    assert mode_of(robot) is Mode.IDLE
    assert not any(robot.energised)


def test_a_lease_that_is_lost_right_after_an_arm_request_prevents_arming(at: Copied) -> None:
    robot = at("idle")
    robot.loop.lease.renew("alice", robot.now_s, 1.0)
    assert robot.loop.request(Request.ARM, robot.now_s) is None
    robot.loop.lease.hang_up("alice")
    robot.step()
    assert mode_of(robot) is Mode.IDLE
    assert FaultKind.LEASE_LOST.fault(holder="alice") in robot.loop.faults.present
