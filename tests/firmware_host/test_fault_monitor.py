"""The fault monitor checks more than single joints: buses, gate, arming, drive health, pose, and trust in encoders."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf, nan, sin
from typing import Any, Literal, cast

import pytest

from control.faults import FAULT_KINDS, Fault, FaultKind
from control.limits import LimitedTorques
from control.modes import ENERGISED, Mode
from control.monitors.motion_monitor import PROBED, SETTLING_S
from control.rate import PERIOD_S
from control.records import JOINTS, BodyPose, DriveState, DriveStates, Joints, JointTarget, Phase, Torques, same_for_all
from drivers.can.mock_bus import MockBus, MockPort
from drivers.can.port_health import BusState
from drivers.drive import DriveCalibration, DriveHealth
from drivers.drives import Drives
from firmware_host.bus_monitor import REFUSED_TICKS, TROUBLE_S
from firmware_host.configuration.configuration import Configuration
from firmware_host.fault_monitor import ARMING_S, FaultMonitor, MonitorInput
from firmware_host.log.recorder import HEALTHY
from firmware_host.ticker import Tick
from tests.control.synthetic_states import NO_TORQUE

START_S = 100.0
ADDUCTIONS = (1, 3)


class HealthyDrives:
    """The part of `Drives` that the fault monitor reads."""

    def __init__(self, ports: dict[str, MockPort]) -> None:
        self.ports = ports
        self.heard = True
        self.refused_commands = 0
        self.last_refusal = ""
        self.health = [
            DriveHealth(joint, firmware="0.6.11", firmware_supported=True, watchdog_s=0.1) for joint in JOINTS
        ]

    def report(self, joint: int, **changes: Any) -> None:
        self.health[joint] = self.health[joint]._replace(**changes)


def sent(torques_nm: Torques) -> LimitedTorques:
    return LimitedTorques(torques_nm, limited=False, finite=True)


class Bench:
    """Owns a fault monitor, the drives' ends of two buses, and the ticks."""

    def __init__(self, configuration: Configuration) -> None:
        self.ports: dict[str, MockPort] = {name: MockBus().open() for name in configuration.bus}
        self.drives = HealthyDrives(self.ports)
        self.monitor = FaultMonitor(configuration, cast(Drives, self.drives))
        self.tick_number = 0

    @property
    def now_s(self) -> float:
        return START_S + self.tick_number * PERIOD_S

    def states(self, index: int = -1, **changes: Any) -> DriveStates:
        """Return fresh, healthy states of the next tick, with changes to one joint."""
        now_s = self.now_s + PERIOD_S
        well = DriveState(0.1, 0.0, now_s, 0.0, now_s, True, 0, now_s, 25.0, now_s, 24.0)
        a, b, c, d = (well._replace(**changes) if joint == index else well for joint in range(4))
        return Joints(a, b, c, d)

    def tick(
        self,
        mode: Mode = Mode.HOLD,
        states: DriveStates | None = None,
        missed: int = 0,
        late_s: float = 0.0,
        **changes: Any,
    ) -> list[Fault]:
        self.tick_number += missed
        states = states or self.states()
        self.tick_number += 1
        monitor_input = MonitorInput(mode, START_S, states, BodyPose(), sent(NO_TORQUE), False, 0.0, HEALTHY, "")
        tick = Tick(self.now_s, late_s, self.tick_number, missed)
        return self.monitor.update(tick, monitor_input._replace(**changes))


@pytest.fixture
def bench(configuration: Configuration) -> Bench:
    return Bench(configuration)


def reported(faults: Sequence[Fault]) -> list[tuple[str, str]]:
    return [(fault.name, fault.subject) for fault in faults]


@pytest.mark.parametrize("mode", sorted(ENERGISED))
def test_healthy_ticks_have_no_fault(bench: Bench, mode: Mode) -> None:
    for _ in range(200):
        assert bench.tick(mode) == []


@pytest.mark.parametrize("index", range(4))
@pytest.mark.parametrize(("angle_rad", "is_range_of"), [(2.0, ()), (-1.4, ADDUCTIONS)])
def test_a_joint_beyond_its_own_range_is_named(
    bench: Bench, index: int, angle_rad: float, is_range_of: tuple[int, ...]
) -> None:
    expected = [] if index in is_range_of else [("joint_position", JOINTS[index])]
    assert reported(bench.tick(states=bench.states(index, angle_rad=angle_rad))) == expected


def test_joints_are_not_monitored_before_all_drives_were_heard(bench: Bench) -> None:
    nothing = same_for_all(DriveState())
    bench.drives.heard = False
    assert bench.tick(Mode.BOOT, nothing) == []
    assert bench.tick(Mode.IDLE, nothing) != []
    bench.drives.heard = True
    assert bench.tick(Mode.BOOT, nothing) != []


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"lost_lease_holder": "anna"}, FaultKind.LEASE_LOST.fault(holder="anna")),
        ({"log": HEALTHY._replace(alive=False)}, FaultKind.RECORDER_DEAD.fault()),
        ({"sent": sent(NO_TORQUE)._replace(finite=False)}, FaultKind.TORQUE_NOT_FINITE.fault()),
        ({"power_cut": "the input is open"}, FaultKind.POWER_CUT.fault(reason="the input is open")),
    ],
)
def test_a_fault_of_the_loop_s_other_parts_is_passed_on_as_long_as_it_lasts(
    bench: Bench, change: dict[str, Any], expected: Fault
) -> None:
    assert bench.monitor.power_cut == ""  # the loop reads it before the first tick too
    assert bench.tick(**change) == bench.tick(**change) == [expected]
    assert bench.monitor.power_cut == change.get("power_cut", "")
    assert bench.tick() == []
    assert bench.monitor.power_cut == ""


def test_joints_without_a_calibration_are_named(configuration: Configuration) -> None:
    drives = dict(configuration.drive)
    for joint in JOINTS[1:3]:
        drives[joint] = replace(drives[joint], calibrated=DriveCalibration())
    bench = Bench(replace(configuration, drive=drives))
    assert bench.tick() == [FaultKind.UNCALIBRATED.fault(joints="left_adduction, right_sweep")]


# power


@pytest.mark.parametrize(("apart_s", "is_cut"), [(0.0, True), (0.09, True), (0.11, False)])
def test_drives_that_all_fall_silent_within_a_tenth_of_a_second_have_no_power(
    bench: Bench, apart_s: float, is_cut: bool
) -> None:
    cut = FaultKind.POWER_CUT.fault(reason="all drives fell silent at once")
    well, begun_s = bench.states(), bench.now_s
    silent = Joints(well[0]._replace(angle_stamp_s=begun_s - apart_s, current_stamp_s=begun_s - apart_s), *well[1:])
    while bench.now_s < begun_s + 0.3:
        found = bench.tick(states=silent)
        last_s = bench.now_s - silent[0].angle_stamp_s
        all_are = [fault.kind for fault in found].count(FaultKind.DRIVE_SILENT) == 4
        assert (found[:1] == [cut]) is (cut in found) is (is_cut and all_are and last_s > 0.1)
        assert (bench.monitor.power_cut != "") is (cut in found)
    bench.ports["left"].state = BusState.OFF
    assert cut not in bench.tick(states=silent)
    bench.ports["left"].state = BusState.ACTIVE
    bench.tick(states=silent, power_cut="the input is open")
    assert bench.monitor.power_cut == "the input is open"
    assert cut not in bench.tick(states=Joints(*silent[:3], bench.states()[3]))


@pytest.mark.parametrize("source", ["drives", ""])
def test_a_drive_s_report_of_a_power_cut_counts_where_the_drives_are_asked(
    configuration: Configuration, source: Literal["drives", ""]
) -> None:
    bench = Bench(replace(configuration, emergency_stop=replace(configuration.emergency_stop, source=source)))
    assert bench.tick() == []
    bench.drives.report(2, power_cut=True, active_errors="ESTOP")
    cut = FaultKind.POWER_CUT.fault(reason="the right_sweep drive reports ESTOP")
    assert bench.tick() == ([cut] if source else [])
    assert (cut in bench.tick(lost_lease_holder="anna")) is (source != "")
    bench.drives.report(2, power_cut=False)
    assert bench.tick() == []
    assert bench.monitor.power_cut == ""


# buses


@pytest.mark.parametrize(
    ("state", "name"),
    [(BusState.WARNING, "bus_warning"), (BusState.PASSIVE, "bus_passive"), (BusState.OFF, "bus_off")],
)
def test_a_degraded_bus_is_a_fault_with_the_last_error(bench: Bench, state: BusState, name: str) -> None:
    bench.ports["right"].state = state
    bench.ports["right"].last_error = "no acknowledgement"
    (fault,) = bench.tick()
    assert fault == FAULT_KINDS[name].fault("right", reason="no acknowledgement")


def test_a_bus_that_loses_commands_in_three_ticks_in_a_row_is_a_fault(bench: Bench) -> None:
    found = []
    for _ in range(5):
        bench.ports["left"].failed_sends += 2
        bench.ports["left"].last_send_error = "No buffer space available"
        found.append(bench.tick())
    assert [reported(each) for each in found] == [[]] * (REFUSED_TICKS - 1) + [[("bus_refuses", "left")]] * 3
    assert found[2] == [FaultKind.BUS_REFUSES.fault("left", ticks=3, reason="No buffer space available")]
    assert bench.tick() == []
    assert FaultKind.BUS_REFUSES.bound_ticks > REFUSED_TICKS + 1


def test_two_consecutive_ticks_of_lost_commands_are_no_fault(bench: Bench) -> None:
    for tick in range(100):
        bench.ports["left"].failed_sends += tick % 3 > 0
        bench.ports["right"].failed_sends += tick % 3 == 0
        assert bench.tick() == []


@pytest.mark.parametrize("state", [BusState.WARNING, BusState.PASSIVE])
def test_bus_warnings_end_without_error_frames_but_bus_off_stays(bench: Bench, state: BusState) -> None:
    bench.ports["left"].state = state
    for _ in range(int(TROUBLE_S / PERIOD_S) - 1):
        assert bench.tick()
    bench.tick()
    assert bench.tick() == []
    bench.ports["left"].error_frames += 1
    assert bench.tick()
    bench.ports["right"].state = BusState.OFF
    assert all("bus_off" in [fault.name for fault in bench.tick()] for _ in range(1000))


# drives


def lose_frames(bench: Bench) -> None:
    bench.ports["right"].lost_frames += 7


def refuse_commands(bench: Bench) -> None:
    bench.drives.refused_commands += 2
    bench.drives.last_refusal = "A torque was refused."


@pytest.mark.parametrize(
    ("happen", "expected"),
    [
        (lose_frames, FaultKind.FRAMES_LOST.fault("right", frames=7)),
        (refuse_commands, FaultKind.COMMAND_REFUSED.fault(reason="A torque was refused.")),
        (lambda bench: bench.drives.report(3, restarts=1), FaultKind.DRIVE_RESTARTED.fault("right_adduction")),
        (
            lambda bench: bench.drives.report(2, foreign_commands=5),
            FaultKind.FOREIGN_COMMANDS.fault("right_sweep", commands=5),
        ),
    ],
)
def test_an_event_is_reported_once(bench: Bench, happen: Callable[[Bench], None], expected: Fault) -> None:
    assert bench.tick() == []
    happen(bench)
    assert bench.tick() == [expected]
    assert bench.tick() == []


def test_a_drive_that_does_not_arm_within_two_seconds_is_a_fault_while_arming(bench: Bench) -> None:
    ticks = 0
    while not (found := bench.tick(Mode.ARMING, bench.states(2, closed_loop=False))):
        ticks += 1
        assert ticks < 1000
    assert reported(found) == [("arming_failed", "right_sweep")]
    assert ticks == pytest.approx(ARMING_S / PERIOD_S, abs=1)
    assert ticks < FaultKind.ARMING_FAILED.bound_ticks
    assert reported(bench.tick(Mode.HOLD, bench.states(2, closed_loop=False))) == [("drive_disarmed", "right_sweep")]


def test_a_drive_s_error_explains_its_leaving_closed_loop_and_nothing_else(bench: Bench) -> None:
    bench.drives.report(2, errors="watchdog expired")
    states = bench.states(2, closed_loop=False, angle_rad=2.0)
    assert [fault for fault in bench.tick(states=states) if "reason" in dict(fault.values)] == [
        FaultKind.DRIVE_DISARMED.fault("right_sweep", reason="watchdog expired")
    ]


@pytest.mark.parametrize(("version", "shown"), [("", "unknown"), ("0.5.6", "0.5.6")])
def test_an_unsupported_firmware_is_a_fault(bench: Bench, version: str, shown: str) -> None:
    bench.drives.report(0, firmware=version, firmware_supported=False, supported_firmware="0.6")
    fault = FaultKind.DRIVE_VERSION.fault("left_sweep", version=shown, supported="0.6")
    assert bench.tick(Mode.IDLE, bench.states()) == [fault]
    assert "type or model" in fault.advice  # an ODrive 3.6 has no newer firmware


@pytest.mark.parametrize(
    ("watchdog_s", "expected"),
    [
        (nan, FaultKind.WATCHDOG_UNKNOWN.fault("left_sweep")),
        (0.0, FaultKind.WATCHDOG_OFF.fault("left_sweep", setting="off", longest_s=0.3)),
        (0.31, FaultKind.WATCHDOG_OFF.fault("left_sweep", setting="set to 0.31 s", longest_s=0.3)),
    ],
)
def test_a_watchdog_that_is_unknown_off_or_slow_is_a_fault(bench: Bench, watchdog_s: float, expected: Fault) -> None:
    bench.drives.report(0, watchdog_s=watchdog_s)
    assert bench.tick() == [expected]
    bench.drives.report(0, watchdog_s=0.3)
    assert bench.tick() == []


@pytest.mark.parametrize(
    ("report", "expected"),
    [
        ({"duplicate_id": True}, FaultKind.DUPLICATE_NODE_ID.fault("left_sweep")),
        ({"setpoint_problem": "0.5 N·m"}, FaultKind.SETPOINT_MISMATCH.fault("left_sweep", reason="0.5 N·m")),
        ({"setting_problem": "its id"}, FaultKind.DRIVE_SETTINGS.fault("left_sweep", reason="its id")),
        (
            {"expected_serial_number": "A"},
            FaultKind.WRONG_DRIVE.fault("left_sweep", serial="unknown", expected="A"),
        ),
        (
            {"expected_serial_number": "A", "serial_number": "B"},
            FaultKind.WRONG_DRIVE.fault("left_sweep", serial="B", expected="A"),
        ),
        ({"expected_serial_number": "A", "serial_number": "A"}, None),
        ({"serial_number": "B"}, None),
    ],
)
def test_what_is_wrong_in_a_drive_s_report_is_a_fault_as_long_as_it_is_reported(
    bench: Bench, report: dict[str, Any], expected: Fault | None
) -> None:
    before = bench.drives.health[0]
    bench.drives.report(0, **report)
    assert bench.tick() == bench.tick() == ([expected] if expected else [])
    bench.drives.health[0] = before
    assert bench.tick() == []


@pytest.mark.parametrize(
    ("missed", "restarts", "is_shifted"), [(0, 0, False), (5, 0, True), (7, 0, True), (8, 0, False), (8, 1, True)]
)
def test_another_angle_after_missed_ticks_is_a_shifted_zero_unless_the_drive_was_only_not_asked(
    bench: Bench, missed: int, restarts: int, is_shifted: bool
) -> None:
    bench.tick()
    bench.drives.report(1, restarts=restarts)
    bench.tick_number += missed
    moved = bench.states(1, angle_rad=0.5)
    bench.tick_number -= missed
    assert (("zero_shifted", JOINTS[1]) in reported(bench.tick(states=moved, missed=missed))) is is_shifted


# pose


def test_a_lost_pose_is_reported_until_it_returns_or_is_forgotten(bench: Bench) -> None:
    known = BodyPose(START_S, 0.5)
    assert bench.tick(body=known) == []
    assert reported(bench.tick()) == [("pose_lost", "")]
    assert bench.tick(body=known) == []
    lost = [bool(bench.tick()) for _ in range(round(10.0 / PERIOD_S) + 10)]
    assert sum(lost) == pytest.approx(10.0 / PERIOD_S, abs=2)
    assert not lost[-1]


# trust in encoders


@pytest.mark.parametrize("index", range(4))
def test_an_encoder_that_is_silent_is_trusted_again_with_its_next_message(bench: Bench, index: int) -> None:
    bench.tick()
    bench.tick(states=bench.states(index, angle_stamp_s=bench.now_s - 0.02))
    assert bench.monitor.trusted == tuple(joint != index for joint in range(4))
    bench.tick()
    assert bench.monitor.trusted == (True, True, True, True)


def test_a_silent_current_does_not_affect_trust_in_the_encoder(bench: Bench) -> None:
    assert reported(bench.tick(states=bench.states(0, current_stamp_s=0.0))) == [("current_silent", "left_sweep")]
    assert bench.monitor.trusted == (True, True, True, True)


def test_an_encoder_that_jumped_is_not_trusted_until_torque_is_off(bench: Bench) -> None:
    bench.tick()
    assert reported(bench.tick(states=bench.states(2, angle_rad=0.5))) == [("encoder_jump", "right_sweep")]
    for _ in range(100):
        assert reported(bench.tick(Mode.DAMPING, bench.states(2, angle_rad=0.5))) == []
        assert bench.monitor.trusted == (True, True, False, True)
    bench.tick(Mode.FAULT, bench.states(2, angle_rad=0.5))
    assert bench.monitor.trusted == (True, True, True, True)


# heat


def test_the_limits_see_the_windings_heat_once_it_matters(bench: Bench) -> None:
    states = bench.states()
    assert bench.monitor.with_winding_heat(states) is states
    bench.monitor.joints[1].winding.temperature_c = 75.0
    reported_c = [state.temperature_c for state in bench.monitor.with_winding_heat(states)]
    assert reported_c == [30.0, 75.0, 30.0, 30.0]
    assert bench.monitor.with_winding_heat(states)[1]._replace(temperature_c=25.0) == states[1]


def test_only_a_joint_that_is_probed_gets_less_than_the_wanted_torque(bench: Bench) -> None:
    wanted = Joints(0.3, -2.0, 0.3, 0.05)
    assert bench.monitor.with_probes(wanted, 0.75) is wanted
    for joint in bench.monitor.joints[1:]:
        joint.motion.driven_back, joint.probed = PROBED, True
    assert bench.monitor.with_probes(wanted, 0.75) == (0.3, -0.625, 0.175, 0.0)


@pytest.mark.parametrize(
    ("wanted_nm", "largest_nm", "expected_nm"),
    [(0.5, 0.75, 0.25), (-0.1, 0.75, 0.15), (2.0, 0.75, 0.5), (0.0, 0.2, -0.2)],
)
def test_a_joint_that_ignores_a_change_of_its_torque_gets_a_step(
    bench: Bench, wanted_nm: float, largest_nm: float, expected_nm: float
) -> None:
    for tick in range(18):
        bench.tick(sent=sent(Joints(0.0, 0.5 if tick > 9 else 0.0, 0.0, 0.0)))
    probed = bench.monitor.with_probes(Joints(*[wanted_nm] * 4), largest_nm)
    assert probed == pytest.approx((wanted_nm, expected_nm, wanted_nm, wanted_nm))


def test_a_joint_must_follow_its_torque_in_a_walk_but_not_in_a_recovery(bench: Bench) -> None:
    full = sent(Joints(0.75, 0.0, 0.0, 0.0))

    def ticks(mode: Mode, freeing: bool) -> list[Fault]:
        found: list[Fault] = []
        for tick in range(800):
            states = bench.states(0, current_a=0.75 / 0.083, velocity_rad_s=1e-4 * (tick % 2))
            found += bench.tick(mode, states, sent=full, freeing=freeing)
        return found

    assert ticks(Mode.WALKING, True) == []
    assert ticks(Mode.DAMPING, False) == []
    assert set(reported(ticks(Mode.WALKING, False))) == {("joint_not_following", "left_sweep")}


def test_a_joint_may_lag_in_one_swing_of_a_walk_but_not_in_two_in_a_row(bench: Bench) -> None:
    """Two swings of two walks are not in a row, whatever their numbers."""
    off = same_for_all(JointTarget(0.5, 0.0))

    def swing(walk_s: float, stride: int) -> set[tuple[str, str]]:
        found: list[Fault] = []
        for _ in range(240):
            last = bench.tick(Mode.WALKING, mode_since_s=walk_s, phase=Phase.SWING, stride=stride, targets=off)
            found += last
        assert set(found) == set(last)  # to its end
        return set(reported(found))

    everywhere = {("following_error", joint) for joint in JOINTS}
    assert [swing(1.0, stride) for stride in (0, 2, 4, 5)] == [set(), set(), set(), everywhere]
    assert [swing(2.0, stride) for stride in (5, 7, 8)] == [set(), set(), everywhere]
    assert [swing(3.0, stride) for stride in (9, 10)] == [set(), everywhere]
    assert [swing(4.0, stride) for stride in (10, 11)] == [set(), everywhere]


@pytest.mark.parametrize("missed", [0, 1])
def test_a_joint_may_lag_in_the_mud_and_for_a_moment_after_it_and_in_a_recovery(bench: Bench, missed: int) -> None:
    off = same_for_all(JointTarget(0.5, 0.0))

    def lag_s(**changes: Any) -> float:
        """Return after which time the lag of all joints is a fault."""
        begun_s = bench.now_s
        while bench.now_s < begun_s + 1.0:
            found = [name for name, _ in reported(bench.tick(targets=off, missed=missed, **changes))]
            if "following_error" in found:
                assert found.count("following_error") == 4
                return bench.now_s - begun_s
        return inf

    tick_s = (1 + missed) * PERIOD_S
    bench.tick(missed=8)
    assert lag_s() == pytest.approx(SETTLING_S, abs=2.0 * tick_s)
    assert lag_s() == pytest.approx(tick_s)
    assert lag_s(phase=Phase.STANCE) == lag_s(freeing=True, phase=Phase.STANCE) == inf
    bench.tick(targets=off, phase=Phase.STANCE)
    assert lag_s() == pytest.approx(0.3, abs=2.0 * tick_s)
    assert lag_s(freeing=True) == inf


def test_a_flipper_that_is_in_the_mud_by_its_angles_may_lag_in_hold(bench: Bench) -> None:
    off = same_for_all(JointTarget(0.5, 0.0))
    for _ in range(240):
        found = bench.tick(states=bench.states(1, angle_rad=-0.5), targets=off)
    assert reported(found) == [("following_error", "right_sweep"), ("following_error", "right_adduction")]


def test_a_torque_that_is_missing_while_a_fault_lets_the_joints_sink_leads_to_idle_drives(bench: Bench) -> None:
    def names(mode: Mode) -> set[str]:
        return {fault.name for _ in range(60) for fault in bench.tick(mode, sent=sent(Joints(0.75, 0.0, 0.0, 0.0)))}

    assert names(Mode.HOLD) == {"torque_missing"}
    assert names(Mode.DAMPING) == {"torque_missing", "damping_failed"}


@pytest.mark.parametrize(
    ("late_bound_s", "late_ticks", "is_found"), [(0.1, 0.49, True), (0.1, 0.5, False), (0.11, 0.0, False)]
)
def test_a_weak_motor_is_found_by_its_motion_in_a_swing_of_punctual_ticks_on_a_computer_with_real_time(
    configuration: Configuration, late_bound_s: float, late_ticks: float, is_found: bool
) -> None:
    bench = Bench(replace(configuration, faults=replace(configuration.faults, late_s=late_bound_s)))
    inertia_kg_m2, speed_rad_s, found = configuration.arm.sweep_inertia_kg_m2, 2.0, set[tuple[str, str]]()
    for phase, ticks in ((Phase.SWING, 200), (Phase.PAUSE, 1)):
        for tick in range(ticks):
            torque_nm = 0.02 * sin(tick / 6.0)
            speed_rad_s += 0.2 * torque_nm / inertia_kg_m2 * PERIOD_S
            states, torques = bench.states(2, velocity_rad_s=speed_rad_s), sent(Joints(0.0, 0.0, torque_nm, 0.0))
            late_s = late_ticks * PERIOD_S
            found.update(reported(bench.tick(Mode.WALKING, states, sent=torques, phase=phase, late_s=late_s)))
    assert (("torque_gain", "right_sweep") in found) is is_found


def test_a_calibrating_drive_blocks_arming_but_does_not_stop_a_walk(bench: Bench) -> None:
    bench.drives.report(2, busy_state="axis state 4")
    assert ("drive_energised", JOINTS[2]) in reported(bench.tick(Mode.IDLE))
    assert bench.tick(Mode.WALKING) == []
