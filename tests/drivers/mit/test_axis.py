"""One MIT motor as a joint: what its answers mean, when it follows torque, and which commands are another program's."""

import struct
from collections.abc import Mapping
from typing import Any

import pytest

from control.records import DriveState
from drivers.can.frames import Frame, MalformedMessageError
from drivers.mit import codec
from drivers.mit.axis import MitAxis
from drivers.mit.codec import Answer
from drivers.mit.drive_type import SIGNALS, Mit
from drivers.mit.models import MODELS
from drivers.mit.parameters import MitParameters
from drivers.mit.settings import PMAX

DAMIAO, CUBEMARS, ROBSTRIDE = "DM4310", "AK80-9", "RS05"
each_model = pytest.mark.parametrize("model", [DAMIAO, CUBEMARS, ROBSTRIDE])
NODE = 1
TICK_S = 0.0026


class Bench:
    """One axis whose frames are collected, and answers that the tests write. It reads every tick."""

    def __init__(self, model: str, **settings: Any) -> None:
        self.sent: list[Frame] = []
        parameters = MitParameters(bus="a", node_id=NODE, type="mit", model=model, torque_constant_nm_a=0.1, **settings)
        self.model = MODELS[model]
        self.axis = MitAxis("left_sweep", parameters, self)
        self.now_s = 10.0
        self.axis.begin_read(self.now_s)

    def send(self, frame: Frame) -> None:
        self.sent.append(frame)

    @property
    def last(self) -> bytes:
        return self.sent[-1].data

    def answer(self, status: int = codec.DISABLED, fault: int = 0, **values: float) -> DriveState:
        """Let a tick pass in which the drive answers."""
        given = {"position_rad": 0.0, "velocity_rad_s": 0.0, "torque_nm": 0.0, "temperature_c": 30.0} | values
        last = 41 if self.model.has_registers else fault
        shown = status if self.model.has_registers else 0
        data = codec.encode_answer(Answer(NODE, shown, last=last, **given), self.model)
        self.hear(codec.feedback_id(NODE, self.model), data)
        return self.axis.state

    def hear(self, identifier: int, data: bytes) -> None:
        self.read()
        self.axis.receivers[identifier](data, self.now_s - 0.001)

    def read(self) -> None:
        """Let a tick pass."""
        self.now_s += TICK_S
        self.axis.begin_read(self.now_s)

    def enter(self) -> None:
        self.axis.prepare()
        self.axis.close_loop()
        self.answer(codec.ENABLED)


@each_model
@pytest.mark.parametrize("sign", [1, -1])
def test_an_answer_is_the_motion_of_the_joint(model: str, sign: int) -> None:
    bench = Bench(model, sign=sign, zero_turn=0.1)
    state = bench.answer(position_rad=1.0, velocity_rad_s=2.0, torque_nm=0.5)
    assert state.angle_rad == pytest.approx(sign * (1.0 - 0.2 * 3.14159265), abs=1e-3)
    assert state.velocity_rad_s == pytest.approx(sign * 2.0, abs=0.05)
    assert state.current_a == pytest.approx(sign * 0.5 / bench.axis.parameters.reported_constant_nm_a, rel=0.05)
    assert state.angle_stamp_s == state.current_stamp_s == state.heartbeat_stamp_s == bench.now_s - TICK_S
    assert state.temperature_c == (41.0 if bench.model.has_registers else 30.0)


def test_an_answer_before_the_first_question_has_the_time_at_which_it_arrived() -> None:
    bench = Bench(CUBEMARS)
    data = codec.encode_answer(Answer(NODE, 0, 0.0, 0.0, 0.0, 30.0, 0), bench.model)
    bench.axis.receivers[NODE](data, bench.now_s - 0.001)
    assert bench.axis.state.angle_stamp_s == bench.now_s - 0.001


def test_a_temperature_of_zero_is_that_of_no_sensor() -> None:
    bench = Bench(CUBEMARS)
    assert bench.answer(temperature_c=50.0).temperature_c == 50.0
    assert bench.answer(temperature_c=0.0).temperature_c == 50.0


@each_model
def test_an_idle_drive_is_commanded_to_leave_the_mode_in_every_tick(model: str) -> None:
    bench = Bench(model)
    for ask in (bench.axis.poll, lambda: bench.axis.send_torque(0.0)):
        bench.sent.clear()
        ask()
        assert bench.last == codec.LEAVE
    bench.enter()
    bench.axis.send_torque(0.0)
    assert codec.decode_torque(bench.last, bench.model.torque_nm) == 0.0
    bench.axis.disarm()
    assert bench.last == codec.LEAVE
    bench.axis.send_torque(0.0)
    assert bench.last == codec.LEAVE


def test_no_remembered_command_is_followed_on_entering() -> None:
    bench = Bench(DAMIAO)
    bench.axis.prepare()
    bench.axis.close_loop()
    torque_nm, entering = (frame.data for frame in bench.sent[-2:])
    assert codec.decode_torque(torque_nm, bench.model.torque_nm) == 0.0
    assert entering == codec.ENTER


def test_a_cubemars_follows_from_its_first_answer_after_the_command_until_one_to_leave() -> None:
    bench = Bench(CUBEMARS)
    assert not bench.answer().closed_loop
    bench.axis.close_loop()
    assert bench.answer().closed_loop
    bench.axis.disarm()
    assert not bench.answer().closed_loop


def test_a_fault_ends_the_mode_of_a_cubemars_and_it_is_not_entered_again() -> None:
    bench = Bench(CUBEMARS)
    bench.enter()
    assert not bench.answer(fault=1).closed_loop
    assert "over-temperature" in bench.axis.health.errors
    assert not bench.answer().closed_loop
    bench.axis.send_torque(0.0)
    assert bench.last == codec.LEAVE


def test_a_cubemars_with_a_fault_does_not_enter_the_mode() -> None:
    bench = Bench(CUBEMARS)
    bench.axis.close_loop()
    assert not bench.answer(fault=1).closed_loop
    assert not bench.answer().closed_loop


@pytest.mark.parametrize("status", [codec.LOST_COMMANDS, codec.DISABLED])
def test_a_damiao_that_left_the_mode_is_not_commanded_back_into_it(status: int) -> None:
    bench = Bench(DAMIAO)
    bench.enter()
    assert not bench.answer(status).closed_loop
    assert bench.axis.health.watchdog_expired is (status == codec.LOST_COMMANDS)
    bench.axis.send_torque(0.0)
    assert bench.last == codec.LEAVE


@pytest.mark.parametrize("model", [CUBEMARS, ROBSTRIDE])
def test_a_drive_that_has_restarted_follows_no_torque_and_has_to_report_its_faults_again(model: str) -> None:
    bench = Bench(model)
    bench.enter()
    if model == ROBSTRIDE:
        bench.hear(0, codec.encode_faults(NODE, 0))
    assert bench.axis.health.firmware_supported
    for _ in range(round(0.4 / TICK_S)):  # it does not answer
        bench.axis.send_torque(0.1)
        bench.read()
    assert not bench.answer().closed_loop
    assert bench.axis.health.restarts == 1
    assert bench.axis.health.firmware_supported is (model == CUBEMARS)


def test_a_robstride_that_answers_the_question_for_faults_alone_has_not_restarted() -> None:
    bench = Bench(ROBSTRIDE)
    bench.enter()
    for _ in range(round(0.4 / TICK_S)):
        bench.axis.request_supply()
        bench.hear(0, codec.encode_faults(NODE, 0))
    assert bench.answer().closed_loop
    assert bench.axis.health.restarts == 0


@pytest.mark.parametrize(
    ("data", "foreign"),
    [
        (codec.LEAVE, {DAMIAO: 0, CUBEMARS: 0, ROBSTRIDE: 0}),
        (codec.CLEAR, {DAMIAO: 0, CUBEMARS: 1, ROBSTRIDE: 0}),
        (codec.FAULT_QUESTION, {DAMIAO: 1, CUBEMARS: 1, ROBSTRIDE: 0}),  # to the first two a command with full gains
        *((data, {DAMIAO: 1, CUBEMARS: 1, ROBSTRIDE: 1}) for data in (codec.ENTER, codec.SET_ZERO)),
        (codec.encode_torque(0.1, 18.0), {DAMIAO: 1, CUBEMARS: 1, ROBSTRIDE: 1}),
    ],
)
def test_only_commands_that_stop_a_drive_are_anybody_s(data: bytes, foreign: Mapping[str, int]) -> None:
    for model, counted in foreign.items():
        bench = Bench(model)
        bench.hear(NODE, data)
        assert bench.axis.health.foreign_commands == counted


@pytest.mark.parametrize("master", [0, 0xFD])
def test_a_fault_that_a_robstride_reports_when_asked_ends_the_mode_until_it_is_cleared(master: int) -> None:
    bench = Bench(ROBSTRIDE)
    bench.enter()
    for node, faults in ((NODE + 1, 0x10), (NODE, 0)):  # another drive's, and none
        assert not bench.axis.health.firmware_supported  # a drive of another maker would follow the question
        assert "faults" in bench.axis.health.supported_firmware
        bench.hear(master, codec.encode_faults(node, faults))
        assert bench.answer().closed_loop
    assert bench.axis.health.firmware_supported
    bench.axis.request_supply()
    assert bench.sent[-1] == Frame(NODE, bytes.fromhex("ffffffffffff00fb"))
    bench.hear(master, codec.encode_faults(NODE, 1 << 2))
    assert not bench.answer().closed_loop
    assert bench.axis.health.active_errors == "under-voltage" and bench.axis.health.power_cut
    bench.axis.clear_errors()
    assert bench.last == codec.CLEAR
    bench.hear(master, codec.encode_faults(NODE, 0))
    assert not bench.answer().closed_loop and not bench.axis.health.active_errors


@pytest.mark.parametrize(("model", "identifier"), [(CUBEMARS, 0), (CUBEMARS, NODE), (ROBSTRIDE, 0), (ROBSTRIDE, 0xFD)])
def test_an_answer_is_read_as_its_drive_s_wherever_it_is_heard(model: str, identifier: int) -> None:
    """The bench counts such frames, and injected failures change them."""
    bench = Bench(model)
    assert identifier in bench.axis.receivers
    data = codec.encode_answer(Answer(NODE, 0, 0.1, 0.2, 0.3, 30.0, 0), bench.model)
    content = Mit().read_frame(Frame(identifier, data))
    assert content is not None
    assert (content.node_id, content.is_command, content.signals) == (NODE, False, SIGNALS)


@pytest.mark.parametrize(
    ("node_id", "kind", "foreign"),
    [(NODE, codec.WRITE, 1), (NODE, codec.STORE, 1), (NODE, codec.READ, 0), (NODE + 1, codec.WRITE, 0)],
)
def test_a_register_that_another_program_writes_is_its_command(node_id: int, kind: int, foreign: int) -> None:
    bench = Bench(DAMIAO)
    bench.hear(codec.REGISTER_ID, codec.encode_register(node_id, kind, PMAX, bytes(4)))
    assert bench.axis.health.foreign_commands == foreign


def test_errors_of_a_damiao_are_cleared_and_those_of_a_cubemars_only_end() -> None:
    for model, data in ((DAMIAO, codec.CLEAR), (CUBEMARS, codec.LEAVE)):
        bench = Bench(model)
        bench.axis.clear_errors()
        assert bench.last == data


def run_following(
    bench: Bench, commanded_nm: float, measured_nm: float, velocity_rad_s: float = 0.0, every: int = 2
) -> None:
    """Command a torque in every tick; the drive measures another one in every `every`th answer."""
    for tick in range(40):
        bench.axis.send_torque(commanded_nm)
        torque_nm = commanded_nm if tick % every else measured_nm
        bench.answer(codec.ENABLED, torque_nm=torque_nm, velocity_rad_s=velocity_rad_s)


@pytest.mark.parametrize(
    ("velocity_rad_s", "commanded_nm", "is_clamped"),
    [(9.0, 0.5, True), (-9.0, -0.5, True), (5.0, 0.5, False), (9.0, -0.5, False)],
)
def test_a_motor_whose_voltage_is_used_up_gives_less_torque_than_commanded(
    velocity_rad_s: float, commanded_nm: float, is_clamped: bool
) -> None:
    bench = Bench("DM4340P")  # whose speeds end at 10 rad/s
    bench.enter()
    run_following(bench, commanded_nm, 0.0, velocity_rad_s)
    assert (bench.axis.health.setpoint_problem == "") == is_clamped


def test_a_torque_that_was_not_commanded_again_and_again_is_another_program_s() -> None:
    bench = Bench(DAMIAO)
    bench.enter()
    run_following(bench, 0.5, 0.5)
    assert bench.axis.health.setpoint_problem == ""
    run_following(bench, 0.5, -0.5)
    assert "where 0.5 N·m was commanded" in bench.axis.health.setpoint_problem
    bench.axis.disarm()
    bench.answer(codec.DISABLED)
    assert bench.axis.health.setpoint_problem == ""
    run_following(bench, 0.5, 0.5)
    bench.axis.disarm()
    for tick in range(40):  # what an idle drive measures belongs to no command
        bench.answer(codec.DISABLED, torque_nm=tick % 2)
    assert bench.axis.health.setpoint_problem == ""


@pytest.mark.parametrize(("measured_nm", "differs"), [(0.05, False), (0.06, True)])
def test_a_torque_differs_by_more_than_the_tolerance_and_a_step_of_its_code(measured_nm: float, differs: bool) -> None:
    bench = Bench(DAMIAO)
    bench.enter()
    run_following(bench, 0.0, measured_nm)
    assert (bench.axis.health.setpoint_problem != "") is differs


def test_torque_that_stays_away_is_not_another_program_s() -> None:
    bench = Bench(DAMIAO)
    bench.enter()
    run_following(bench, 0.5, -0.5, every=1)
    assert bench.axis.health.setpoint_problem == ""


@pytest.mark.parametrize(
    ("identifier", "data"),
    [(NODE, codec.LEAVE), (codec.REGISTER_ID, codec.encode_register(NODE, codec.STATE, 0, bytes(4)))],
)
def test_answers_to_the_questions_of_another_program_are_no_second_drive_s(identifier: int, data: bytes) -> None:
    bench = Bench(DAMIAO)
    for _ in range(20):
        bench.hear(identifier, data)
        bench.answer()
    assert not bench.axis.health.duplicate_id


def test_an_answer_under_its_id_that_another_drive_sent_is_refused() -> None:
    bench = Bench(DAMIAO)
    data = codec.encode_answer(Answer(NODE + 1, 0, 1.0, 0.0, 0.0, 30.0, 40), bench.model)
    with pytest.raises(MalformedMessageError):
        bench.hear(codec.feedback_id(NODE, bench.model), data)


@pytest.mark.parametrize("data", [codec.LEAVE, codec.CLEAR, codec.ENTER])
def test_of_another_program_only_the_command_to_leave_ends_what_a_cubemars_follows(data: bytes) -> None:
    bench = Bench(CUBEMARS)
    bench.enter()
    bench.hear(NODE, data)
    assert bench.answer().closed_loop is (data != codec.LEAVE)


def test_a_damiao_that_has_not_entered_the_mode_yet_is_still_to_follow() -> None:
    bench = Bench(DAMIAO)
    bench.axis.close_loop()
    assert not bench.answer(codec.DISABLED).closed_loop
    bench.axis.send_torque(0.0)
    assert codec.decode_torque(bench.last, bench.model.torque_nm) == 0.0


def test_the_registers_of_a_damiao_are_asked_for_and_their_answers_are_no_motion() -> None:
    bench = Bench(DAMIAO)
    bench.answer(position_rad=0.5)
    bench.axis.request_settings(bench.now_s)
    request = bench.sent[-1]
    assert (request.arbitration_id, request.data[2]) == (codec.REGISTER_ID, codec.READ)
    sent = len(bench.sent)
    bench.axis.request_settings(bench.now_s)  # the answer is awaited
    assert len(bench.sent) == sent
    assert bench.axis.health.setting_problem == "" and "register" in bench.axis.health.supported_firmware
    other_range = codec.encode_register(NODE, codec.READ, PMAX, struct.pack("<f", 99.0))
    bench.hear(codec.feedback_id(NODE, bench.model), other_range)
    assert "PMAX" in bench.axis.health.setting_problem
    assert bench.axis.state.angle_rad == pytest.approx(0.5, abs=1e-3)


def test_a_status_that_returns_to_normal_is_reported_again() -> None:
    bench = Bench(DAMIAO)
    bench.answer(0xA)
    assert "over-current" in bench.axis.health.errors
    bench.answer(0xB)
    assert "transistors" in bench.axis.health.errors
    bench.answer(codec.DISABLED)
    assert bench.axis.health.errors == ""
