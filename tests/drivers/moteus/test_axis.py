"""One moteus as a joint: the meaning of its answers, the questions to it, and the faults that are noticed."""

from dataclasses import replace
from math import isfinite, nan
from random import Random
from typing import Any

import pytest

from control.rate import PERIOD_S
from control.records import JOINTS, DriveStates, Joints
from drivers.can.mock_bus import MockBus
from drivers.drive import DriveHealth
from drivers.drive_types import make_drives
from drivers.moteus import codec, registers
from drivers.moteus.codec import Mode
from drivers.moteus.parameters import MoteusParameters
from drivers.moteus.registers import Register, Resolution
from drivers.odrive.drive_type import Odrive
from simulation.devices.drive import DriveError, SimulatedDriveParameters
from simulation.devices.moteus.device import SimulatedMoteus
from simulation.devices.moteus.forgeries import answer_frame, command_frame

NO_TORQUE = Joints(0.0, 0.0, 0.0, 0.0)


class Bench:
    """Four simulated drives on one bus, of which the tests examine node 1; each tick reads, then asks or commands."""

    def __init__(self, **changes: Any) -> None:
        bus = MockBus()
        self.far, self.other_program = bus.open(), bus.open()
        self.parameters = {
            joint: MoteusParameters("one", node, current_limit_a=12.0) for node, joint in enumerate(JOINTS, 1)
        }
        self.drives = make_drives(self.parameters, {"one": bus.open()})
        ideal = SimulatedDriveParameters(1, type="moteus", torque_constant_nm_a=0.0719, current_noise_a=0.0)
        self.devices = [SimulatedMoteus(replace(ideal, node_id=node, **changes), Random(node)) for node in (1, 2, 3, 4)]
        self.now_s, self.silent = 0.0, False

    def tick(self, torques_nm: Joints[float] | None = None, settings: bool = False) -> DriveStates:
        self.now_s += PERIOD_S
        for frame in self.far.receive():
            for device in self.devices:
                for answer in () if self.silent else device.receive(frame, self.now_s):
                    self.far.send(answer)
        for device in self.devices:
            device.torque_nm(self.now_s)
        states = self.drives.read(self.now_s)
        if settings:
            self.drives.request_settings(self.now_s)
        if torques_nm is None:
            self.drives.poll()
        else:
            self.drives.send(torques_nm, PERIOD_S)
        return states

    def run(self, duration_s: float, torques_nm: Joints[float] | None = None, settings: bool = False) -> DriveStates:
        for _ in range(round(duration_s / PERIOD_S)):
            states = self.tick(torques_nm, settings)
        return states

    def arm(self) -> None:
        self.run(0.05)
        self.drives.arm(self.now_s, at_once=True)
        self.run(0.01, NO_TORQUE)
        self.drives.arm(self.now_s + 1.0)
        self.run(0.02, NO_TORQUE)

    @property
    def health(self) -> DriveHealth:
        return self.drives.health[0]


def test_a_drive_that_restarts_under_torque_is_not_commanded_back_into_it() -> None:
    bench = Bench()
    bench.arm()
    bench.devices[0].mode = Mode.STOPPED  # as after a short dip of its supply
    bench.tick(NO_TORQUE)
    bench.devices[0].mode = Mode.STOPPED
    bench.run(0.05, NO_TORQUE)
    assert bench.devices[0].mode is Mode.STOPPED and bench.devices[1].mode is Mode.POSITION


@pytest.mark.parametrize("every", [1, 2, 3])
def test_an_idle_drive_that_another_program_starts_again_and_again_is_stopped_in_every_tick(every: int) -> None:
    """Its torque lasts one tick, since this program's stop leaves before the drive's answer to the next question."""
    bench = Bench()
    bench.run(0.05, NO_TORQUE)
    energised = []
    for tick in range(60):
        bench.tick(NO_TORQUE)
        energised.append(bench.devices[0].energised)
        if tick % every == 0:
            bench.other_program.send(command_frame(1, codec.encode_torque(0.3)))
    assert sum(energised[5:]) <= len(energised[5:]) / every + 1
    assert bench.health.foreign_commands >= 59 // every
    bench.run(0.11, NO_TORQUE)
    heard = [frame.data for frame in bench.far.receive() if frame.arbitration_id == codec.command_id(1)]
    assert heard == [codec.QUERY_ALONE] and not bench.devices[0].energised


def test_a_drive_that_alternates_between_stops_and_torque_counts_as_in_closed_loop() -> None:
    bench = Bench()
    bench.run(0.05, NO_TORQUE)
    states = []
    for _ in range(30):
        bench.other_program.send(command_frame(1, codec.encode_torque(0.0)))
        states.append(bench.tick(NO_TORQUE)[0])
    assert all(state.closed_loop for state in states[3:])


@pytest.mark.parametrize("mode", [Mode.CURRENT, Mode.STAY_WITHIN])
def test_an_idle_drive_that_another_program_gives_torque_in_another_mode_is_stopped(mode: Mode) -> None:
    bench = Bench()
    bench.run(0.05, NO_TORQUE)
    bench.devices[0].mode = mode
    bench.run(0.05, NO_TORQUE)
    assert bench.devices[0].mode is Mode.STOPPED


def test_a_latched_watchdog_is_not_cleared_by_the_stops_of_a_disturbed_drive() -> None:
    """A drive in this mode ignores the torque of others until a stop."""
    bench = Bench()
    bench.run(0.05, NO_TORQUE)
    bench.devices[0].trip(DriveError.WATCHDOG)
    bench.run(0.01, NO_TORQUE)
    bench.other_program.send(command_frame(1, codec.encode_torque(0.3)))
    bench.run(0.05, NO_TORQUE)
    assert bench.devices[0].mode is Mode.TIMEOUT


def test_an_answer_without_a_stamp_is_as_old_as_its_question() -> None:
    bench = Bench()
    bench.run(0.05, NO_TORQUE)
    asked_s = bench.now_s
    bench.now_s += 3.0  # the loop hung: the stamp of the answer is too old for this clock
    for frame in bench.far.receive():
        for device in bench.devices:
            for answer in device.receive(frame, asked_s):
                bench.far.send(answer)
    state = bench.drives.read(bench.now_s)[0]
    assert state.angle_stamp_s == state.current_stamp_s == pytest.approx(asked_s)


@pytest.mark.parametrize("data", [codec.QUERY_ALONE, codec.STOP_AND_QUERY, codec.STOP])
def test_questions_and_stops_of_others_are_no_foreign_commands(data: bytes) -> None:
    bench = Bench()
    for _ in range(50):
        bench.other_program.send(command_frame(1, data))
        bench.tick(NO_TORQUE)
    assert bench.health.foreign_commands == 0 and not bench.health.duplicate_id


def test_an_expired_watchdog_is_an_error_until_it_is_cleared() -> None:
    bench = Bench()
    bench.arm()
    bench.now_s += 0.2  # in which this program hangs
    for device in bench.devices:
        device.torque_nm(bench.now_s)
    bench.run(0.02, NO_TORQUE)
    assert bench.health.watchdog_expired and bench.health.active_errors == "watchdog expired"
    assert bench.tick(NO_TORQUE)[0].error_flags == codec.TIMEOUT_FLAG
    bench.drives.disarm(bench.now_s, at_once=True)
    bench.run(0.02, NO_TORQUE)
    assert bench.health.active_errors == ""  # the stop cleared it in the drive
    assert bench.health.errors == "watchdog expired"
    bench.drives.clear_errors()
    bench.run(0.02, NO_TORQUE)
    assert bench.health.errors == "" and not bench.health.watchdog_expired


def test_settings_are_read_back_and_again_after_a_change() -> None:
    bench = Bench(serial_number="0123456789abcdef00112233")
    bench.run(1.0, NO_TORQUE, settings=True)
    health = bench.health
    assert (health.firmware, health.firmware_supported, health.watchdog_s) == ("1.1.0", True, 0.1)
    assert health.serial_number == "0123456789abcdef00112233" and health.setting_problem == ""
    bench.devices[0].console.settings["servo.default_timeout_s"] = nan
    bench.run(2.5, NO_TORQUE, settings=True)
    assert bench.health.watchdog_s == 0.0


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("servo.max_current_A", 5.0, "servo.max_current_A is 5 and current_limit_a = 12"),
        ("motor.Kv", 300.0, "torque_constant_nm_a = 0.0719"),
        ("motor.Kv", 0.0, "torque_constant_nm_a = 0.0719"),
        ("motor_position.rotor_to_output_ratio", 0.25, "must be 1"),
        ("servo.timeout_mode", 10.0, "servo.timeout_mode is 10"),
    ],
)
def test_a_setting_that_differs_is_named_with_what_was_found(key: str, value: float, text: str) -> None:
    bench = Bench()
    bench.devices[0].console.settings[key] = value
    bench.run(1.0, NO_TORQUE, settings=True)
    assert text in bench.health.setting_problem
    assert bench.drives.health[1].setting_problem == ""


def test_a_console_that_does_not_answer_leaves_the_watchdog_unknown() -> None:
    bench = Bench()
    for device in bench.devices:
        device.console.write = lambda text: None  # type: ignore[method-assign]
    bench.run(3.0, NO_TORQUE, settings=True)
    assert not isfinite(bench.health.watchdog_s) and bench.health.firmware_supported


def test_old_output_of_the_console_is_no_answer() -> None:
    bench = Bench()
    bench.devices[0].console.write(b"conf get motor.Kv\n" * 40)
    bench.run(1.0, NO_TORQUE, settings=True)
    assert bench.health.watchdog_s == 0.1 and bench.health.setting_problem == ""


def test_a_signal_that_a_drive_does_not_know_keeps_its_old_stamp() -> None:
    bench = Bench()
    bench.run(0.05)
    before = bench.tick()[0]
    reply = codec.decode_reply(bench.devices[0].receive(command_frame(1, codec.QUERY_ALONE), 0.0)[0].data)
    for name in ("position_turn", "q_current_a"):
        data = codec.encode_reply(codec.Reply(**(reply._asdict() | {name: nan})))
        axis = bench.drives.axes[0]
        axis.receivers[next(iter(axis.receivers))](data, bench.now_s + 1.0)
        state = axis.state
        assert (state.angle_stamp_s > before.angle_stamp_s) is (name != "position_turn")
        assert isfinite(state.angle_rad + state.current_a)
        bench.tick()
        before = bench.tick()[0]


@pytest.mark.parametrize("register", [Register.REGISTER_MAP, Register.SERIAL_NUMBER])
def test_a_setting_that_a_drive_does_not_know_stays_unknown(register: Register) -> None:
    bench = Bench()
    data = registers.encode_values(registers.REPLY, Resolution.INT32, register, [nan, nan, nan])
    bench.far.send(answer_frame(1, registers.padded(data)))
    bench.tick()
    assert (bench.health.firmware, bench.health.serial_number) == ("", "")


def test_a_motor_without_thermistor_has_no_temperature() -> None:
    assert not isfinite(Bench(temperature_c=0.0).run(0.05)[0].temperature_c)
    assert Bench(temperature_c=40.0).run(0.05)[0].temperature_c == 40.0


def test_an_odrive_under_the_id_of_a_moteus_is_noticed() -> None:
    bench = Bench()
    bench.silent = True
    bench.other_program.send(Odrive().announces(1))
    bench.tick()
    assert bench.health.other_protocol == "odrive" and not bench.drives.heard
    assert bench.drives.health[1].other_protocol == ""
