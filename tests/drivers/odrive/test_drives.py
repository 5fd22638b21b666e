"""Four drives as joints, over buses in this process: which frames are understood, ignored and transmitted."""

from math import inf, nan, pi
from struct import pack
from unittest.mock import Mock

import pytest

from control.parameters.joint_limits import JointLimits
from control.rate import PERIOD_S
from control.records import JOINTS, NEVER_S, DriveStates, Joints
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockPort
from drivers.drives import REPEAT_S
from drivers.odrive.codec import (
    GET_BUS_VOLTAGE_CURRENT,
    GET_ENCODER_ESTIMATES,
    GET_ERROR,
    GET_IQ,
    GET_TEMPERATURE,
    GET_VERSION,
    HEARTBEAT,
    Message,
    arbitration_id,
)
from drivers.odrive.settings import REPEAT_UNKNOWN_S
from tests.drivers.odrive.odrive_bench import OdriveBench

SIGNALS: list[tuple[Message, tuple[float, ...]]] = [
    (GET_ENCODER_ESTIMATES, (0.5, 2.0)),
    (GET_IQ, (1.0, 3.0)),
    (HEARTBEAT, (0, 8, 0, 0)),
]
SLOW_SIGNALS: list[tuple[Message, tuple[float, ...]]] = [
    (GET_TEMPERATURE, (25.0, 40.0)),
    (GET_BUS_VOLTAGE_CURRENT, (24.0, 1.0)),
    (GET_ERROR, (0, 0)),
    (GET_VERSION, (2, 4, 4, 58, 0, 6, 11, 0)),
]
BOUNDLESS = JointLimits(torque_nm=1e9, torque_rate_nm_s=1e12)


class Bench(OdriveBench):
    """Reports every signal, and reads what is sent."""

    def report_everything(self, now_s: float, closed_loop: bool = True) -> DriveStates:
        for joint in JOINTS:
            for message, values in SIGNALS + SLOW_SIGNALS:
                self.report(message, *values, joint=joint)
            self.heartbeat(8 if closed_loop else 1, joint=joint)
        return self.drives.read(now_s)

    def sent(self) -> dict[str, list[Frame]]:
        return {name: port.receive() for name, port in self.far.items()}

    def sent_for_closed_loop(self) -> int:
        """Return how many drives are asked for it."""
        return sum(frame.arbitration_id & 0x1F == 0x07 for frames in self.sent().values() for frame in frames)

    def silent(self) -> bool:
        return not any(self.sent().values())


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_the_newest_measured_current_counts_and_the_zero_is_subtracted_before_the_sign(bench: Bench) -> None:
    bench.report(GET_ENCODER_ESTIMATES, 0.5, 2.0, joint="left_adduction")
    for current_a in (1.0, 2.0, 1.5):
        bench.report(GET_IQ, 9.0, current_a)
    states = bench.drives.read(1.0)
    assert states[0].current_a == 1.5
    assert (states[1].angle_rad, states[1].velocity_rad_s) == pytest.approx((-0.25 * 2.0 * pi, -2.0 * 2.0 * pi))
    assert bench.silent()  # reading transmits nothing


def test_each_port_is_told_to_listen_to_its_own_drives(monkeypatch: pytest.MonkeyPatch) -> None:
    nodes: list[set[int]] = []
    monkeypatch.setattr(MockPort, "listen_to", lambda port, ids: nodes.append({number >> 5 for number in ids}))
    Bench()
    assert [each & {0, 1, 2, 3} - {0} for each in nodes] == [{1}, {2, 3}]  # 0 is also an id of other types of drive


def test_every_signal_has_its_own_stamp(bench: Bench) -> None:
    for now_s, (message, values) in enumerate(SIGNALS, start=1):
        bench.report(message, *values)
        bench.drives.read(float(now_s))
    state, unreported = bench.drives.read(9.0)[:2]
    assert (state.angle_stamp_s, state.current_stamp_s, state.heartbeat_stamp_s) == (1.0, 2.0, 3.0)
    assert {unreported.angle_stamp_s, unreported.current_stamp_s, unreported.heartbeat_stamp_s} == {NEVER_S}


@pytest.mark.parametrize(
    ("frame_s", "stamp_s"),
    [(8.999, 8.999), (9.0, 9.0), (8.96, 8.96), (7.01, 7.01), (7.0, 9.0), (9.001, 9.0), (1.7e9, 9.0), (NEVER_S, 9.0)],
)
def test_a_signal_has_the_stamp_of_its_frame_unless_that_is_of_another_clock(
    bench: Bench, frame_s: float, stamp_s: float
) -> None:
    bench.report(GET_IQ, 0.0, 1.0, stamp_s=frame_s)
    assert bench.drives.read(9.0)[0].current_stamp_s == stamp_s


def test_every_field_comes_from_its_message(bench: Bench) -> None:
    bench.report_everything(1.0)
    bench.heartbeat(error=0x1000000)
    state = bench.drives.read(2.0)[0]
    assert (state.closed_loop, state.error_flags, state.heartbeat_stamp_s) == (False, 0x1000000, 2.0)
    assert (state.temperature_c, state.bus_voltage_v, state.bus_current_a) == (40.0, 24.0, 1.0)
    assert (state.temperature_stamp_s, state.bus_voltage_stamp_s) == (1.0, 1.0)
    bench.report(GET_ERROR, 0x2000000, 0x1000000)
    assert bench.drives.read(3.0)[0].error_flags == 0x2000000
    assert bench.axis.disarm_reason == 0x1000000


def known_frame(message: Message, data: bytes, **flags: bool) -> Frame:
    return Frame(arbitration_id(0, message), data, **flags)


MALFORMED = [
    known_frame(GET_ENCODER_ESTIMATES, bytes(7)),
    known_frame(GET_ENCODER_ESTIMATES, pack("<ff", nan, 0.0)),
    known_frame(GET_ENCODER_ESTIMATES, pack("<ff", 0.0, -inf)),
    known_frame(GET_IQ, pack("<ff", 0.0, nan)),
    known_frame(GET_IQ, pack("<ff", 0.0, inf)),
    known_frame(GET_IQ, b""),
    known_frame(HEARTBEAT, bytes(4)),
    known_frame(GET_ERROR, bytes(3)),
    known_frame(GET_TEMPERATURE, bytes(9)),
    known_frame(GET_BUS_VOLTAGE_CURRENT, bytes(1)),
    known_frame(GET_VERSION, bytes(6)),
]
UNKNOWN = [
    known_frame(GET_IQ, b"", is_remote=True),
    known_frame(GET_IQ, pack("<ff", 0.0, 9.0), is_extended=True),
    Frame(arbitration_id(5, GET_IQ), pack("<ff", 0.0, 9.0)),
    Frame(arbitration_id(0, Message(0x0A, "<ii")), bytes(8)),
]


@pytest.mark.parametrize(
    ("frames", "malformed", "unknown"), [(MALFORMED, len(MALFORMED), 0), (UNKNOWN, 0, len(UNKNOWN))]
)
def test_malformed_and_unknown_frames_are_counted_and_change_nothing(
    bench: Bench, frames: list[Frame], malformed: int, unknown: int
) -> None:
    before = bench.report_everything(1.0)
    for frame in frames:
        bench.far["left"].send(frame)
    assert bench.drives.read(2.0) == before
    assert (bench.drives.malformed_frames, bench.drives.unknown_frames) == (malformed, unknown)


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("missing", [message for message, _ in SIGNALS])
def test_the_drives_are_heard_once_every_signal_of_all_has_come(bench: Bench, joint: str, missing: Message) -> None:
    for other in JOINTS:
        for message, values in SIGNALS:
            if (other, message) != (joint, missing):
                bench.report(message, *values, joint=other)
    bench.drives.read(1.0)
    assert not bench.drives.heard
    bench.report(missing, *dict(SIGNALS)[missing], joint=joint)
    bench.drives.read(2.0)
    assert bench.drives.heard


def test_torques_leave_in_the_order_of_the_joints_with_these_bytes() -> None:
    bench = Bench(limits=BOUNDLESS)
    bench.drives.gate.open()
    bench.drives.send(Joints(0.5, 0.25, -1.0, 2.0), PERIOD_S)
    assert bench.sent() == {
        "left": [Frame(0x00E, bytes.fromhex("0000003f")), Frame(0x02E, bytes.fromhex("000080be"))],
        "right": [Frame(0x06E, bytes.fromhex("0000803f")), Frame(0x04E, bytes.fromhex("00000040"))],
    }


def test_a_refused_torque_is_counted_with_the_reason(bench: Bench) -> None:
    bench.drives.send(Joints(0.1, 0.0, 0.0, 0.0), PERIOD_S)
    assert bench.drives.refused_commands == 1 and "armed" in bench.drives.last_refusal


def test_one_joint_may_get_another_torque_within_the_step_of_the_last_ones() -> None:
    bench = Bench(limits=BOUNDLESS)
    bench.drives.gate.open()
    bench.drives.send(Joints(0.0, 0.0, 0.0, 0.0), PERIOD_S)
    bench.sent()
    bench.drives.send_torque("right_sweep", -1.0)
    assert bench.sent() == {"left": [], "right": [Frame(0x06E, bytes.fromhex("0000803f"))]}


def test_older_torques_are_another_program_s_but_not_while_the_bus_refuses_newer_ones() -> None:
    bench = Bench(limits=BOUNDLESS)
    bench.heartbeat(8)
    bench.drives.read(1.0)
    bench.drives.gate.open()
    for torque_nm, is_full, differs in ((0.3, False, False), (0.6, True, False), (0.6, False, True)):
        bench.drives.ports["left"].full = is_full  # type: ignore[attr-defined]
        for tick in range(20):
            bench.drives.send(Joints(torque_nm, 0.0, 0.0, 0.0), PERIOD_S)
            bench.report(GET_IQ, 0.3 / 0.083, 0.3 / 0.083)
            bench.drives.read(1.0 + tick * PERIOD_S)
        assert (bench.health.setpoint_problem != "") is differs


def test_arming_sends_mode_limits_gain_zero_torque_and_closed_loop_in_that_order(bench: Bench) -> None:
    bench.report_everything(1.0, closed_loop=False)
    bench.drives.arm(1.0)
    right = [frame for frame in bench.sent()["right"] if frame.arbitration_id >> 5 == 2]
    assert right == [
        Frame(0x04B, bytes.fromhex("01000000 01000000")),
        Frame(0x04F, bytes.fromhex("00000041 0000c040")),  # 8 turns/s, 6 A
        Frame(0x05B, bytes.fromhex("0000003f 00000000")),  # 0.5 N·m per turn/s
        Frame(0x04E, bytes.fromhex("00000000")),
        Frame(0x047, bytes.fromhex("08000000")),
    ]
    assert bench.drives.refused_commands == 0


def test_at_once_drives_are_prepared_and_not_yet_asked(bench: Bench) -> None:
    bench.report_everything(1.0, closed_loop=False)
    bench.drives.arm(1.0, at_once=True)
    assert bench.sent_for_closed_loop() == 0
    bench.drives.arm(1.0)
    assert bench.sent_for_closed_loop() == 4


def test_no_drive_is_asked_for_closed_loop_while_its_preparation_is_lost(bench: Bench) -> None:
    bench.report_everything(1.0, closed_loop=False)
    port = bench.drives.ports["left"]
    assert isinstance(port, MockPort)
    port.full = True
    bench.drives.arm(1.0)
    port.full = False
    assert bench.sent_for_closed_loop() == 0
    bench.drives.arm(1.01 + REPEAT_S)
    assert bench.sent_for_closed_loop() == 4


def test_arming_is_repeated_after_a_while_and_only_for_drives_not_in_closed_loop(bench: Bench) -> None:
    bench.report_everything(1.0, closed_loop=False)
    bench.drives.arm(1.0)
    assert {name: len(frames) for name, frames in bench.sent().items()} == {"left": 10, "right": 10}
    for joint in JOINTS[:3]:
        bench.heartbeat(8, joint=joint)
    bench.drives.read(1.05)
    bench.drives.arm(1.0 + 0.99 * REPEAT_S)
    assert bench.silent()
    bench.drives.arm(1.01 + REPEAT_S)
    sent = bench.sent()
    assert sent["left"] == []
    assert [frame.arbitration_id >> 5 for frame in sent["right"]] == [2] * 5


def test_disarming_at_once_goes_to_all_with_zero_torque_and_idle(bench: Bench) -> None:
    bench.report_everything(1.0, closed_loop=False)
    bench.drives.arm(1.0)
    bench.sent()
    bench.drives.disarm(1.0, at_once=True)
    assert not bench.drives.gate.is_open and bench.drives.refused_commands == 0
    assert bench.sent() == {
        "left": [Frame(0x00E, bytes(4)), Frame(0x007, b"\1\0\0\0"), Frame(0x02E, bytes(4)), Frame(0x027, b"\1\0\0\0")],
        "right": [Frame(0x06E, bytes(4)), Frame(0x067, b"\1\0\0\0"), Frame(0x04E, bytes(4)), Frame(0x047, b"\1\0\0\0")],
    }


@pytest.mark.parametrize(("state", "repeated"), [(8, True), (14, False), (16, False), (17, True)])
def test_disarming_is_repeated_for_drives_in_closed_loop_or_a_state_that_none_has_but_not_for_a_calibration(
    bench: Bench, state: int, repeated: bool
) -> None:
    bench.report_everything(1.0, closed_loop=False)
    bench.heartbeat(state, joint="left_adduction")
    bench.drives.read(1.0)
    for _ in range(3):
        bench.drives.disarm(1.0)
    zero_and_idle = [Frame(0x02E, bytes(4)), Frame(0x027, b"\1\0\0\0")]
    assert bench.sent() == {"left": zero_and_idle if repeated else [], "right": []}
    bench.drives.disarm(1.01 + REPEAT_S)
    assert bench.sent()["left"] == (zero_and_idle if repeated else [])


def test_disarming_that_the_bus_refused_is_repeated_for_any_report_of_the_drives(bench: Bench) -> None:
    bench.report_everything(1.0, closed_loop=False)
    bench.drives.read(1.0)
    bench.drives.ports["left"].full = True  # type: ignore[attr-defined]
    bench.drives.disarm(1.0, at_once=True)
    bench.drives.ports["left"].full = False  # type: ignore[attr-defined]
    bench.sent()
    bench.drives.disarm(1.01 + REPEAT_S)
    assert [frame.arbitration_id for frame in bench.sent()["left"]] == [0x00E, 0x007, 0x02E, 0x027]
    bench.drives.disarm(1.02 + 2.0 * REPEAT_S)
    assert bench.silent()


def test_forcing_idle_closes_the_gate_and_reaches_the_drives_of_a_bus_next_to_one_that_raises(bench: Bench) -> None:
    bench.drives.gate.open()
    bench.drives.ports["left"].send = Mock(side_effect=OSError)  # type: ignore[method-assign]
    bench.drives.force_idle(3)
    zero_and_idle = [
        Frame(0x06E, bytes(4)), Frame(0x067, b"\1\0\0\0"), Frame(0x04E, bytes(4)), Frame(0x047, b"\1\0\0\0"),
    ]  # fmt: skip
    assert bench.sent() == {"left": [], "right": 3 * zero_and_idle}
    assert not bench.drives.gate.is_open


def test_drives_that_do_not_report_their_supply_are_asked_one_after_the_other_every_tenth_tick(bench: Bench) -> None:
    bench.report(GET_BUS_VOLTAGE_CURRENT, 24.0, 1.0, joint="left_adduction", stamp_s=1.0)
    bench.drives.read(1.25)
    asked = []
    for tick in range(1, 51):
        if tick == 50:
            bench.drives.read(1.26)
        bench.drives.request_supply()
        asked += [(tick, frame.arbitration_id) for frames in bench.sent().values() for frame in frames]
    assert asked == [(20, 0x077), (30, 0x057), (40, 0x017), (50, 0x037)]


def test_closed_drives_hear_nothing_any_more(bench: Bench) -> None:
    bench.drives.close()
    bench.report_everything(1.0)
    assert not bench.drives.heard


def test_errors_are_cleared_on_all_drives(bench: Bench) -> None:
    bench.drives.clear_errors()
    assert bench.sent() == {
        "left": [Frame(0x018, b"\0"), Frame(0x038, b"\0")],
        "right": [Frame(0x078, b"\0"), Frame(0x058, b"\0")],
    }


def test_versions_are_requested_by_remote_frame_until_they_are_known(bench: Bench) -> None:
    bench.drives.request_settings(1.0)
    assert bench.sent() == {
        "left": [Frame(0x000, is_remote=True), Frame(0x020, is_remote=True)],
        "right": [Frame(0x060, is_remote=True), Frame(0x040, is_remote=True)],
    }
    for firmware, data in (("0.6.10", "02 04 04 3a 00 06 0a 00"), ("0.6.11", "02 04 04 3a 00 06 0b 00")):
        bench.far["left"].send(Frame(0x000, bytes.fromhex(data)))
        bench.drives.read(1.1)
        assert bench.health.firmware == firmware
    bench.drives.request_settings(1.0 + 0.99 * REPEAT_UNKNOWN_S)
    assert bench.silent()
    bench.drives.request_settings(1.01 + REPEAT_UNKNOWN_S)
    assert [frame.arbitration_id for frame in bench.sent()["left"]] == [0x006, 0x020]  # its number


def test_a_reset_forgets_everything(bench: Bench) -> None:
    bench.report_everything(1.0)
    bench.far["left"].send(MALFORMED[0])
    bench.drives.read(1.0)
    bench.drives.gate.open()
    bench.drives.reset()
    assert not bench.drives.heard and not bench.drives.gate.is_open
    assert bench.drives.malformed_frames == 0
    assert bench.axis.settings.version is None
    assert repr(bench.drives.read(2.0)) == repr(Bench().drives.read(2.0))
