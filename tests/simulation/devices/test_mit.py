"""The simulated drive in MIT mode, and the axis that commands it, on one bus."""

from collections.abc import Mapping
from dataclasses import replace
from math import isnan, pi
from random import Random
from typing import Any

import pytest

from control.parameters.joint_limits import JointLimits
from control.records import JOINTS
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockBus
from drivers.drive_types import make_drives
from drivers.mit import codec
from drivers.mit.axis import MitAxis
from drivers.mit.codec import Answer
from drivers.mit.models import MODELS
from drivers.mit.parameters import MitParameters
from drivers.mit.settings import CONTROL_MODE, REGISTERS, TIMEOUT, TMAX
from simulation.devices.drive import DriveError, SimulatedDriveParameters
from simulation.devices.mit.device import BOOT_S, SimulatedMit
from simulation.devices.mit.registers import write_frame

IDEAL = SimulatedDriveParameters(7, type="mit", current_noise_a=0.0)
STEP_NM = MODELS["DM4310"].torque_step_nm
TICK_S = 0.0026


class Bench:
    def __init__(self, **changes: Any) -> None:
        self.drive = SimulatedMit(replace(IDEAL, **changes), Random(1))
        self.model = MODELS[changes.get("model", "DM4310")]
        self.now_s = 0.0

    def send(self, data: bytes, identifier: int = 7) -> list[Frame]:
        return self.drive.receive(Frame(identifier, data), self.now_s)

    def ask(self, data: bytes = codec.LEAVE) -> Answer:
        (frame,) = self.send(data)
        assert frame.arbitration_id == codec.feedback_id(7, self.model)
        return codec.decode_answer(frame.data, self.model)

    def command(self, torque_nm: float) -> Answer:
        return self.ask(codec.encode_torque(torque_nm, self.model.torque_nm))

    def torque_after(self, wait_s: float) -> float:
        self.now_s += wait_s
        return self.drive.torque_nm(self.now_s)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_it_sends_nothing_but_one_answer_to_each_command(bench: Bench) -> None:
    for _ in range(100):
        bench.torque_after(0.001)
        assert list(bench.drive.cyclic_frames(bench.now_s)) == []
    assert len(bench.send(codec.LEAVE)) == 1
    assert bench.send(codec.LEAVE, identifier=8) == [] == bench.send(codec.LEAVE, identifier=23)


def test_it_follows_torque_only_in_the_mode_and_answers_with_the_values_of_before(bench: Bench) -> None:
    bench.command(0.5)
    assert bench.torque_after(0.001) == 0.0
    assert bench.ask(codec.ENTER).status == codec.DISABLED
    assert bench.torque_after(0.001) == pytest.approx(0.5, abs=STEP_NM)  # the drive stored the command
    answer = bench.command(0.2)
    assert answer.status == codec.ENABLED and answer.torque_nm == pytest.approx(0.5, abs=1.5 * STEP_NM)
    assert bench.torque_after(0.001) == pytest.approx(0.2, abs=STEP_NM)
    bench.ask(codec.LEAVE)
    assert bench.torque_after(0.001) == 0.0


def test_the_code_of_zero_is_followed_as_half_a_step(bench: Bench) -> None:
    bench.ask(codec.ENTER)
    bench.command(0.0)
    assert bench.torque_after(0.001) == pytest.approx(0.5 * STEP_NM)


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_sign_turns_angle_velocity_and_torque_alike(sign: int) -> None:
    bench = Bench(sign=sign, zero_turn=0.25)
    bench.drive.measure(0.5, 2.0)
    bench.ask(codec.ENTER)
    answer = bench.command(0.4)
    assert answer.position_rad == pytest.approx(0.5 * pi + sign * 0.5, abs=1e-3)
    assert answer.velocity_rad_s == pytest.approx(sign * 2.0, abs=0.02)
    assert bench.torque_after(0.001) == pytest.approx(sign * 0.4, abs=STEP_NM)


def test_without_commands_a_damiao_leaves_the_mode_until_its_errors_are_cleared(bench: Bench) -> None:
    bench.ask(codec.ENTER)
    bench.command(0.5)
    assert bench.torque_after(0.0999) > 0.4
    assert bench.torque_after(0.0002) == 0.0
    assert bench.ask().status == codec.LOST_COMMANDS and bench.drive.failed
    bench.ask(codec.ENTER)
    assert bench.torque_after(0.001) == 0.0
    bench.ask(codec.CLEAR)
    assert bench.ask(codec.ENTER).status == codec.DISABLED
    assert bench.ask(codec.LEAVE).status == codec.ENABLED


def test_questions_for_registers_do_not_feed_the_watchdog(bench: Bench) -> None:
    bench.ask(codec.ENTER)
    bench.command(0.5)
    for _ in range(101):
        bench.send(codec.encode_read(7, TIMEOUT), codec.REGISTER_ID)
        torque_nm = bench.torque_after(0.001)
    assert torque_nm == 0.0


def test_a_watchdog_that_is_off_never_trips() -> None:
    bench = Bench(watchdog_s=0.0)
    bench.ask(codec.ENTER)
    bench.command(0.2)
    assert bench.torque_after(60.0) == pytest.approx(0.2, abs=STEP_NM)


def test_without_commands_a_cubemars_is_limp_and_reports_nothing() -> None:
    bench = Bench(model="AK80-9")
    bench.ask(codec.ENTER)
    bench.command(0.5)
    assert bench.drive.energised
    assert abs(bench.torque_after(0.2)) < 1e-9 and not bench.drive.energised
    answer = bench.command(0.5)
    assert (answer.status, answer.fault) == (0, 0)
    assert bench.torque_after(0.001) == pytest.approx(0.5, abs=bench.model.torque_step_nm)


@pytest.mark.parametrize(("model", "status", "fault"), [("DM4310", 0xA, 30), ("AK80-9", 0, 2)])
def test_a_fault_ends_torque_and_is_reported(model: str, status: int, fault: int) -> None:
    bench = Bench(model=model)
    bench.ask(codec.ENTER)
    bench.command(0.5)
    bench.drive.trip(DriveError.OVERCURRENT)
    assert bench.torque_after(0.001) == 0.0
    answer = bench.ask()
    assert (answer.status, answer.last) == (status, fault)


def test_a_restart_is_silent_and_ends_outside_of_the_mode(bench: Bench) -> None:
    bench.ask(codec.ENTER)
    bench.drive.restart(bench.now_s)
    bench.now_s += 0.99 * BOOT_S
    assert bench.send(codec.LEAVE) == []
    bench.now_s += 0.02 * BOOT_S
    assert bench.ask().status == codec.DISABLED


def test_gains_are_followed_as_the_firmware_does(bench: Bench) -> None:
    bench.ask(codec.ENTER)
    bench.ask(bytes.fromhex("8000800333000800"))  # kp of 0x333 / 4095 of 500
    bench.drive.measure(0.01, 0.0)
    assert bench.torque_after(0.001) == pytest.approx(-100.0 * 0.01, abs=0.03)


def test_malformed_frames_are_ignored(bench: Bench) -> None:
    random = Random(2)
    for _ in range(500):
        identifier = random.choice([7, codec.REGISTER_ID, random.randrange(0x800)])
        bench.send(random.randbytes(random.randint(0, 8)), identifier)
        assert not isnan(bench.torque_after(0.001))


class Robot:
    """Four axes on one bus with their simulated drives."""

    def __init__(self, changes: Mapping[str, Any] | None = None, **settings: Any) -> None:
        bus = MockBus()
        self.far = bus.open()
        parameters = {joint: MitParameters("a", index + 1, **settings) for index, joint in enumerate(JOINTS)}
        self.drives = make_drives(parameters, {"a": bus.open()}, JointLimits())
        given: dict[str, Any] = {name: settings[name] for name in ("model", "torque_range_nm") if name in settings}
        self.devices = [
            SimulatedMit(replace(IDEAL, **({"node_id": index + 1} | given | dict(changes or {}))), Random(index))
            for index in range(4)
        ]
        self.now_s = 10.0

    @property
    def axis(self) -> MitAxis:
        axis = self.drives.axes[0]
        assert isinstance(axis, MitAxis)
        return axis

    def tick(self, idle: bool = True, torque_nm: float = 0.0, count: int = 1) -> None:
        for _ in range(count):
            self.now_s += TICK_S
            self.drives.read(self.now_s)
            if idle:
                self.drives.request_settings(self.now_s)
            self.drives.send((torque_nm,) * 4, 0.1)  # type: ignore[arg-type]
            self.exchange()

    def exchange(self) -> None:
        for frame in self.far.receive():
            for device in self.devices:
                for answer in device.receive(frame, self.now_s):
                    self.far.send(answer)
        for device in self.devices:
            device.torque_nm(self.now_s)

    def follow_another(self, torque_nm: float) -> None:
        """Lets the first drive obey a command that is not on the bus."""
        self.devices[0].receive(self.devices[0].forge_torque(torque_nm), self.now_s)
        self.devices[0].torque_nm(self.now_s)

    def arm(self) -> None:
        self.drives.arm(self.now_s, at_once=True)
        self.drives.arm(self.now_s + 1.0)
        self.exchange()
        self.tick(idle=False, count=2)


def test_an_axis_reads_back_limits_and_watchdog() -> None:
    robot = Robot({"serial_number": "0badcafe"})
    robot.tick(count=3 * len(REGISTERS))
    for health in robot.drives.health:
        assert health.watchdog_s == pytest.approx(0.1) and health.firmware_supported
        assert health.serial_number == "0badcafe" and health.setting_problem == ""
    assert robot.drives.malformed_frames == robot.drives.unknown_frames == robot.drives.refused_commands == 0


@pytest.mark.parametrize(
    ("register", "value", "found"),
    [
        (21, 3.14, "PMAX (register 21) is 3.14 and that of model = 'DM4310' is 12.5: correct the key, or set"),
        (22, 45.0, "VMAX (register 22) is 45 and that of model = 'DM4310' is 30: correct the key, or set"),
        (TMAX, 28.0, "TMAX (register 23) is 28 and that of model = 'DM4310' is 10: correct the key, or set"),
        (CONTROL_MODE, 2, "CTRL_MODE (register 10) is 2: set 1"),
    ],
)
def test_a_setting_that_differs_is_named_with_what_was_found_and_what_to_do(
    register: int, value: float, found: str
) -> None:
    robot = Robot()
    robot.devices[0].receive(write_frame(1, register, value), 10.0)
    robot.tick(count=3 * len(REGISTERS))
    assert found in robot.axis.health.setting_problem
    assert robot.drives.axes[1].health.setting_problem == ""


def test_the_range_of_torque_may_be_configured_and_is_then_compared() -> None:
    robot = Robot(torque_range_nm=4.0)
    robot.tick(count=3 * len(REGISTERS))
    assert robot.axis.health.setting_problem == ""
    other = Robot({"torque_range_nm": 0.0}, torque_range_nm=4.0)
    other.tick(count=3 * len(REGISTERS))
    assert "TMAX (register 23) is 10 and that of torque_range_nm = 4 is 4" in other.axis.health.setting_problem


def test_the_watchdog_of_a_cubemars_stays_unknown() -> None:
    robot = Robot(model="AK80-9")
    robot.tick(count=300)
    health = robot.axis.health
    assert isnan(health.watchdog_s) and "AK80-9 reports none" in health.watchdog_advice
    assert health.firmware_supported and robot.drives.unknown_frames == 0


@pytest.mark.parametrize("model", ["DM4310", "AK80-9"])
def test_an_idle_drive_is_commanded_to_leave_the_mode_in_every_tick(model: str) -> None:
    robot = Robot(model=model)
    robot.tick(count=3)
    robot.devices[0].energised = True
    robot.tick()
    assert not robot.devices[0].energised


@pytest.mark.parametrize("model", ["DM4310", "AK80-9"])
def test_arming_enters_at_zero_torque_and_disarming_leaves(model: str) -> None:
    robot = Robot(model=model)
    robot.tick(count=30)
    robot.devices[0]._command = replace_torque(robot, 5.0)
    robot.arm()
    assert all(device.energised for device in robot.devices)
    assert abs(robot.devices[0].torque_nm(robot.now_s)) < MODELS[model].torque_step_nm
    robot.tick(idle=False, torque_nm=0.3, count=2)
    state = robot.drives.read(robot.now_s)[0]
    assert state.closed_loop and robot.drives.refused_commands == 0
    assert 0.083 * state.current_a == pytest.approx(0.3, abs=2.0 * MODELS[model].torque_step_nm)
    robot.drives.disarm(robot.now_s, at_once=True)
    robot.exchange()
    assert not any(device.energised for device in robot.devices)
    robot.tick(count=2)
    assert not robot.axis.closed_loop


def replace_torque(robot: Robot, torque_nm: float) -> Any:
    """Return the stored command of a drive with another torque."""
    return robot.devices[0]._command._replace(torque_nm=torque_nm)


def test_a_drive_whose_watchdog_expired_is_not_commanded_back() -> None:
    robot = Robot()
    robot.tick(count=30)
    robot.arm()
    robot.devices[0].trip(DriveError.WATCHDOG)
    robot.tick(idle=False, torque_nm=0.2, count=2)
    health = robot.axis.health
    assert health.watchdog_expired and health.errors == "watchdog expired" and not robot.axis.closed_loop
    robot.tick(idle=False, count=2)
    robot.axis.clear_errors()
    robot.exchange()
    robot.tick(idle=False, count=2)
    assert robot.axis.state.error_flags == 0 and not robot.devices[0].energised


@pytest.mark.parametrize("model", ["DM4310", "AK80-9"])
def test_a_restart_while_armed_ends_following(model: str) -> None:
    robot = Robot(model=model)
    robot.tick(count=30)
    robot.arm()
    robot.devices[0].restart(robot.now_s)
    robot.tick(idle=False, count=round((BOOT_S + 0.1) / TICK_S))
    assert robot.axis.health.restarts == 1
    assert not robot.axis.closed_loop and not robot.devices[0].energised


@pytest.mark.parametrize(("data", "counted"), [(codec.ENTER, 1), (codec.SET_ZERO, 1), (codec.LEAVE, 0)])
@pytest.mark.parametrize("model", ["DM4310", "AK80-9"])
def test_commands_of_another_program_are_counted(model: str, data: bytes, counted: int) -> None:
    robot = Robot(model=model)
    robot.tick(count=3)
    robot.far.send(Frame(1, data))
    robot.tick()
    assert robot.axis.health.foreign_commands == counted
    assert robot.drives.axes[1].health.foreign_commands == 0


@pytest.mark.parametrize("model", ["DM4310", "AK80-9"])
def test_a_drive_that_another_program_makes_leave_the_mode_is_idle(model: str) -> None:
    """No answer of a CubeMars states it."""
    robot = Robot(model=model)
    robot.tick(count=30)
    robot.arm()
    assert robot.axis.closed_loop
    robot.far.send(Frame(1, codec.LEAVE))
    robot.devices[0].energised = False
    robot.tick(idle=False, torque_nm=0.2, count=2)
    assert not robot.axis.closed_loop and not robot.devices[0].energised
    assert robot.drives.axes[1].closed_loop


@pytest.mark.parametrize("model", ["DM4310", "AK80-9", "AK80-64"])
@pytest.mark.parametrize("every", [2, 10])
def test_commands_of_another_program_that_are_not_seen_show_in_the_measured_torque(model: str, every: int) -> None:
    robot = Robot(model=model)
    robot.tick(count=30)
    robot.arm()
    for number in range(200):
        robot.tick(idle=False, torque_nm=0.2)
        assert not robot.axis.health.setpoint_problem
        if number % 40 == 7:  # a single outlier now and then is none
            robot.devices[0].receive(robot.devices[0].forge_torque(1.0), robot.now_s)
    for number in range(100):
        robot.tick(idle=False, torque_nm=0.2)
        if number % every == 0:
            robot.follow_another(1.0)
    assert "N·m where 0.2 N·m was commanded" in robot.axis.health.setpoint_problem
    assert not robot.drives.axes[1].health.setpoint_problem


def test_torque_that_is_missing_for_a_while_is_no_other_programs_command() -> None:
    """A supply that sags, or the speed, may limit the torque; the joint's monitor finds what lasts."""
    robot = Robot({"motor_current_limit_a": 1.0})
    robot.tick(count=30)
    robot.arm()
    for _ in range(4):
        robot.tick(idle=False, torque_nm=0.4, count=30)
        robot.tick(idle=False, torque_nm=0.05, count=30)
        assert not robot.axis.health.setpoint_problem


def test_a_register_that_another_program_writes_counts_for_its_drive() -> None:
    robot = Robot()
    robot.tick(count=3)
    robot.far.send(write_frame(2, TMAX, 3.0))
    robot.tick()
    assert [axis.health.foreign_commands for axis in robot.drives.axes] == [0, 1, 0, 0]


def test_more_answers_than_questions_are_a_second_drive() -> None:
    robot = Robot()
    robot.devices.append(SimulatedMit(replace(IDEAL, node_id=1), Random(9)))
    robot.tick(count=20)
    assert [axis.health.duplicate_id for axis in robot.drives.axes] == [True, False, False, False]


def test_old_cubemars_that_all_answer_under_id_0_are_distinguished_by_their_first_byte() -> None:
    robot = Robot(model="AK80-9")
    for index in range(4):
        answer = Answer(index + 1, 0, 0.1 * index, 0.0, 0.0, 30.0, 0)
        robot.far.send(Frame(0, codec.encode_answer(answer, MODELS["AK80-9"])))
    states = robot.drives.read(robot.now_s)
    assert [state.angle_rad for state in states] == pytest.approx([0.0, 0.1, 0.2, 0.3], abs=1e-3)
    assert robot.drives.malformed_frames == robot.drives.unknown_frames == 0


def test_answers_of_another_node_or_another_length_are_malformed() -> None:
    robot = Robot()
    robot.far.send(Frame(17, codec.encode_answer(Answer(2, 0, 0.0, 0.0, 0.0, 30.0, 30), MODELS["DM4310"])))
    robot.far.send(Frame(17, bytes(6)))
    robot.drives.read(robot.now_s)
    assert robot.drives.malformed_frames == 2 and not robot.axis.state.heard
