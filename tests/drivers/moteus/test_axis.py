"""One moteus as a joint: the meaning of its answers, the questions to it, and the faults that are noticed."""

from math import isfinite, nan, pi
from typing import Any
from unittest.mock import Mock

import pytest

from drivers.drive import FD, DriveHealth
from drivers.moteus import codec, registers
from drivers.moteus.axis import MoteusAxis
from drivers.moteus.codec import Mode
from drivers.moteus.parameters import MoteusParameters
from drivers.moteus.registers import Register, Resolution
from drivers.odrive.drive_type import Odrive
from simulation.devices.drive import DriveError
from simulation.devices.moteus.device import SimulatedMoteus
from simulation.devices.moteus.forgeries import answer_frame, command_frame
from tests.drivers.bench.simulated_bus import simulated
from tests.simulation.devices.driven_drives import TICK_S, DrivenDrives


class Bench(DrivenDrives):
    """The drives, of which the tests examine node 1, and the port of another program; each tick reads, then sends."""

    def __init__(self, **changes: Any) -> None:
        super().__init__("moteus", changes, current_limit_a=12.0)
        self.other_program = self.bus.open()

    def tick(self, torque_nm: float | None = 0.0, count: int = 1) -> None:
        """Run ticks that command this torque; none: that ask for signals and settings."""
        for _ in range(count):
            self.now_s += TICK_S
            self.exchange()
            self.drives.read(self.now_s)
            if torque_nm is None:
                self.drives.request_settings(self.now_s)
                self.drives.poll()
            else:
                self.drives.send((torque_nm,) * 4, TICK_S)  # type: ignore[arg-type]

    @property
    def device(self) -> SimulatedMoteus:
        (device, *_) = self.devices
        assert isinstance(device, SimulatedMoteus)
        return device

    @property
    def health(self) -> DriveHealth:
        return self.drives.health[0]


@pytest.mark.parametrize("sign", [1, -1])
def test_an_answer_is_the_motion_of_the_joint(sign: int) -> None:
    axis = MoteusAxis("left_sweep", MoteusParameters("a", 1, "moteus", sign=sign, zero_turn=0.25), Mock())
    axis.begin_read(1.0)
    answer = codec.AT_REST._replace(position_turn=0.5, velocity_turn_s=2.0, q_current_a=3.0)
    axis.receivers[codec.reply_id(1) | FD](codec.encode_reply(answer), 1.0)
    state = axis.state
    assert (state.angle_rad, state.velocity_rad_s) == pytest.approx((sign * 0.5 * pi, sign * 4.0 * pi), rel=1e-4)
    assert state.current_a == pytest.approx(sign * 3.0, rel=1e-3)


def test_the_first_answer_has_the_time_at_which_it_is_read() -> None:
    bench = Bench()
    bench.drives.poll()
    bench.exchange()
    state = bench.drives.read(bench.now_s)[0]
    assert state.heard and state.angle_stamp_s == state.current_stamp_s == bench.now_s


def test_a_drive_that_restarts_under_torque_is_not_commanded_back_into_it() -> None:
    bench = Bench()
    bench.arm()
    bench.device.mode = Mode.STOPPED  # as after a short dip of its supply
    bench.tick()
    bench.device.mode = Mode.STOPPED
    bench.tick(count=20)
    assert bench.device.mode is Mode.STOPPED and bench.devices[1].energised


@pytest.mark.parametrize("every", [1, 2, 3])
def test_an_idle_drive_that_another_program_starts_again_and_again_is_stopped_in_every_tick(every: int) -> None:
    """Its torque lasts one tick, since this program's stop leaves before the drive's answer to the next question."""
    bench = Bench()
    bench.tick(count=20)
    energised = []
    for tick in range(60):
        bench.tick()
        energised.append(bench.devices[0].energised)
        if tick % every == 0:
            bench.other_program.send(command_frame(1, codec.encode_torque(0.3)))
    assert sum(energised[5:]) <= len(energised[5:]) / every + 1
    assert bench.health.foreign_commands >= 59 // every
    bench.tick(count=43)
    heard = [frame.data for frame in bench.far.receive() if frame.arbitration_id == codec.command_id(1)]
    assert heard == [codec.QUERY_ALONE] and not bench.devices[0].energised


def test_an_idle_drive_is_stopped_in_the_tick_that_hears_a_command_of_another_program() -> None:
    bench = Bench()
    bench.tick(count=20)
    bench.other_program.send(command_frame(1, codec.encode_torque(0.3)))
    bench.tick()
    assert [frame.data for frame in bench.far.receive()][0] == codec.STOP_AND_QUERY


def test_a_drive_that_alternates_between_stops_and_torque_counts_as_in_closed_loop() -> None:
    bench = Bench()
    bench.tick(count=20)
    closed_loop = []
    for _ in range(30):
        bench.other_program.send(command_frame(1, codec.encode_torque(0.0)))
        bench.tick()
        closed_loop.append(bench.state.closed_loop)
    assert all(closed_loop[3:])


@pytest.mark.parametrize("mode", [Mode.CURRENT, Mode.STAY_WITHIN])
def test_an_idle_drive_that_another_program_gives_torque_in_another_mode_is_stopped(mode: Mode) -> None:
    bench = Bench()
    bench.tick(count=20)
    bench.device.mode = mode
    bench.tick()
    assert bench.health.busy_state == f"mode {mode}"
    bench.tick(count=20)
    assert bench.device.mode is Mode.STOPPED and bench.health.busy_state == ""


def test_a_latched_watchdog_is_not_cleared_by_the_stops_of_a_disturbed_drive() -> None:
    """A drive in this mode ignores the torque of others until a stop."""
    bench = Bench()
    bench.tick(count=20)
    bench.devices[0].trip(DriveError.WATCHDOG)
    bench.tick(count=4)
    bench.other_program.send(command_frame(1, codec.encode_torque(0.3)))
    bench.tick(count=20)
    assert bench.device.mode is Mode.TIMEOUT


def test_an_answer_without_a_stamp_is_as_old_as_its_question() -> None:
    bench = Bench()
    bench.tick(count=20)
    bench.exchange()
    state = bench.drives.read(bench.now_s + 3.0)[0]  # the loop hung: the stamp is too old for this clock
    assert state.angle_stamp_s == state.current_stamp_s == bench.now_s


def test_questions_of_others_for_other_registers_hide_no_second_drive() -> None:
    bench = Bench()
    bench.devices.append(simulated("moteus", 1))
    for _ in range(400):
        bench.other_program.send(command_frame(1, registers.padded(codec.POWER_QUERY)))
        bench.tick()
    assert bench.health.duplicate_id


def test_a_register_that_another_program_sets_to_zero_is_its_command() -> None:
    bench = Bench()
    zero = registers.encode_values(registers.WRITE, Resolution.INT8, Register.WATCHDOG, [0.0])
    bench.other_program.send(command_frame(1, registers.padded(zero)))
    bench.tick()
    assert bench.health.foreign_commands == 1


@pytest.mark.parametrize("data", [codec.QUERY_ALONE, codec.STOP_AND_QUERY, codec.STOP])
def test_questions_and_stops_of_others_are_no_foreign_commands(data: bytes) -> None:
    bench = Bench()
    for _ in range(50):
        bench.other_program.send(command_frame(1, data))
        bench.tick()
    assert bench.health.foreign_commands == 0 and not bench.health.duplicate_id


def test_an_expired_watchdog_is_an_error_until_it_is_cleared() -> None:
    bench = Bench()
    bench.arm()
    bench.now_s += 0.2  # in which this program hangs
    for device in bench.devices:
        device.torque_nm(bench.now_s)
    bench.tick(count=8)
    assert bench.health.watchdog_expired and bench.health.active_errors == "watchdog expired"
    assert bench.state.error_flags == codec.TIMEOUT_FLAG
    bench.drives.disarm(bench.now_s, at_once=True)
    bench.tick(count=8)
    assert bench.health.active_errors == ""  # the stop cleared it in the drive
    assert bench.health.errors == "watchdog expired"
    bench.drives.clear_errors()
    bench.tick(count=8)
    assert bench.health.errors == "" and not bench.health.watchdog_expired


def test_a_supply_that_is_too_low_is_a_cut_of_the_power() -> None:
    bench = Bench()
    bench.device.mode, bench.device.fault = Mode.FAULT, codec.UNDER_VOLTAGE
    bench.tick(count=4)
    assert [health.power_cut for health in bench.drives.health] == [True, False, False, False]


def test_an_error_of_an_idle_drive_is_cleared_by_a_stop_and_forgotten_when_it_is_armed() -> None:
    bench = Bench()
    bench.tick(count=20)
    for commands in ([bench.drives.clear_errors], [bench.axis.disarm, bench.axis.close_loop]):
        bench.devices[0].trip(DriveError.WATCHDOG)
        bench.tick(count=4)
        assert bench.health.errors == "watchdog expired"
        for command in commands:
            command()
        bench.tick(count=4)
        assert bench.device.mode is not Mode.TIMEOUT and bench.health.errors == ""


def test_a_disarmed_drive_gets_no_torque_command_also_of_zero() -> None:
    bench = Bench()
    bench.arm()
    bench.disarm()
    bench.tick(count=20)
    assert bench.device.mode is Mode.STOPPED and bench.drives.refused_commands == 0


@pytest.mark.parametrize("torque_nm", [1e39, -1e39, nan])
def test_a_torque_that_no_binary32_represents_becomes_zero(torque_nm: float) -> None:
    bench = Bench()
    bench.arm()
    bench.tick(0.2)
    bench.tick(torque_nm)
    bench.exchange()
    assert bench.torque_nm() == 0.0 and bench.drives.refused_commands == 4


def test_settings_are_read_back_and_again_after_a_change() -> None:
    bench = Bench(serial_number="0123456789abcdef00112233")
    bench.tick(None, count=380)
    health = bench.health
    assert (health.firmware, health.firmware_supported, health.watchdog_s) == ("1.1.0", True, 0.1)
    assert health.serial_number == "0123456789abcdef00112233" and health.setting_problem == ""
    bench.device.console.settings["servo.default_timeout_s"] = nan
    bench.tick(None, count=950)
    assert bench.health.watchdog_s == 0.0


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("servo.max_current_A", 5.0, "servo.max_current_A is 5 and current_limit_a = 12"),
        ("motor.Kv", 300.0, "torque_constant_nm_a = 0.083"),
        ("motor.Kv", 0.0, "torque_constant_nm_a = 0.083"),
        ("motor_position.rotor_to_output_ratio", 0.25, "must be 1"),
        ("servo.timeout_mode", 10.0, "servo.timeout_mode is 10"),
    ],
)
def test_a_setting_that_differs_is_named_with_what_was_found(key: str, value: float, text: str) -> None:
    bench = Bench()
    bench.device.console.settings[key] = value
    bench.tick(None, count=380)
    assert text in bench.health.setting_problem
    assert bench.drives.health[1].setting_problem == ""


def test_a_console_that_does_not_answer_leaves_the_watchdog_unknown() -> None:
    bench = Bench()
    bench.device.console.write = lambda text: None  # type: ignore[method-assign]
    bench.tick(None, count=1140)
    assert not isfinite(bench.health.watchdog_s) and bench.health.firmware_supported


def test_old_output_of_the_console_is_no_answer() -> None:
    bench = Bench()
    bench.device.console.write(b"conf get motor.Kv\n" * 40)
    bench.tick(None, count=380)
    assert bench.health.watchdog_s == 0.1 and bench.health.setting_problem == ""


def test_a_signal_that_a_drive_does_not_know_keeps_its_old_stamp() -> None:
    bench = Bench()
    bench.tick(count=20)
    reply = codec.decode_reply(bench.devices[0].receive(command_frame(1, codec.QUERY_ALONE), 0.0)[0].data)
    for name in ("position_turn", "q_current_a"):
        data = codec.encode_reply(codec.Reply(**(reply._asdict() | {name: nan})))
        before_s = bench.state.angle_stamp_s
        bench.axis.receivers[codec.reply_id(1) | FD](data, bench.now_s + 1.0)
        assert (bench.state.angle_stamp_s > before_s) is (name != "position_turn")
        assert isfinite(bench.state.angle_rad + bench.state.current_a)
        bench.tick(count=2)


def test_a_commanded_torque_that_an_idle_drive_reports_is_no_other_program_s() -> None:
    bench = Bench()
    bench.tick(count=20)
    reply = codec.decode_reply(bench.devices[0].receive(command_frame(1, codec.QUERY_ALONE), 0.0)[0].data)
    data = codec.encode_reply(reply._replace(control_torque_nm=50.0))
    bench.axis.receivers[codec.reply_id(1) | FD](data, bench.now_s)
    assert bench.health.setpoint_problem == ""


@pytest.mark.parametrize("register", [Register.REGISTER_MAP, Register.SERIAL_NUMBER])
def test_a_setting_that_a_drive_does_not_know_stays_unknown(register: Register) -> None:
    bench = Bench()
    data = registers.encode_values(registers.REPLY, Resolution.INT32, register, [nan, nan, nan])
    bench.far.send(answer_frame(1, registers.padded(data)))
    bench.tick()
    assert (bench.health.firmware, bench.health.serial_number) == ("", "")


def test_a_motor_without_thermistor_has_no_temperature() -> None:
    for temperature_c, known in ((0.0, False), (40.0, True)):
        bench = Bench(temperature_c=temperature_c)
        bench.tick(count=20)
        assert (bench.state.temperature_c == temperature_c) is known is isfinite(bench.state.temperature_c)


def test_an_odrive_under_the_id_of_a_moteus_is_noticed() -> None:
    bench = Bench()
    bench.devices.clear()
    bench.other_program.send(Odrive().announces(1))
    bench.tick()
    assert bench.health.other_protocol == "odrive" and not bench.drives.heard
    assert bench.drives.health[1].other_protocol == ""
    bench.drives.reset()
    assert bench.health.other_protocol == ""
