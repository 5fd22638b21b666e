"""Frames to a drive in MIT mode that pass the gate and frames that do not."""

from math import inf, isnan, nan
from random import Random

import pytest

from drivers.can.frames import Frame
from drivers.mit import codec
from drivers.mit.gate_table import gate_table
from drivers.mit.models import MODELS
from drivers.mit.parameters import MitParameters
from drivers.mit.settings import REGISTERS, TMAX
from drivers.transmit_gate import FrameKind
from tests.drivers.gate_bench import GateBench

NODE = 5
CODE_NM = MODELS["DM4310"].torque_step_nm
QUESTIONS = [codec.encode_read(NODE, register) for register in REGISTERS]


def drive(model: str, node_id: int = NODE) -> MitParameters:
    return MitParameters("left", node_id, model=model)


class Bench(GateBench):
    def __init__(self, model: str = "DM4310") -> None:
        super().__init__(gate_table(drive(model, node)) for node in (NODE, 6))
        self.range_nm = MODELS[model].torque_nm

    def send(self, data: bytes, identifier: int = NODE) -> list[bytes]:
        frames = self.passed(Frame(identifier, data))
        assert all(frame.arbitration_id == identifier for frame in frames)
        return [frame.data for frame in frames]

    def torque(self, torque_nm: float) -> float:
        """Return the torque that leaves; NaN where another command left."""
        (data,) = self.send(codec.encode_torque(torque_nm, self.range_nm))
        return codec.decode_torque(data, self.range_nm)


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def armed() -> Bench:
    bench = Bench()
    bench.gate.open()
    return bench


@pytest.mark.parametrize("model", MODELS)
def test_the_table_is_of_its_node_and_its_model(model: str) -> None:
    table = gate_table(drive(model))
    assert (table.node_id, table.torque_id, table.kind) == (NODE, NODE, FrameKind())
    assert table.decode_torque(table.zero_torque) == 0.0
    assert table.torque_step_nm == MODELS[model].torque_step_nm
    assert table.while_open == {NODE: frozenset({codec.ENTER})}
    assert table.checks == {} and table.requests == frozenset()
    assert (codec.REGISTER_ID in table.always) is MODELS[model].has_registers


@pytest.mark.parametrize("is_open", [False, True])
def test_leaving_clearing_and_questions_pass_open_or_closed(bench: Bench, is_open: bool) -> None:
    if is_open:
        bench.gate.open()
    for data in (codec.LEAVE, codec.CLEAR):
        assert bench.send(data) == [data]
    for data in QUESTIONS:
        assert bench.send(data, codec.REGISTER_ID) == [data]
    assert bench.gate.refused == 0


def test_the_questions_of_all_drives_of_a_bus_pass_under_their_common_id(bench: Bench) -> None:
    for node in (NODE, 6):
        data = codec.encode_read(node, TMAX)
        assert bench.send(data, codec.REGISTER_ID) == [data]
    assert bench.send(codec.encode_read(7, TMAX), codec.REGISTER_ID) == []


def test_entering_passes_only_while_open(bench: Bench) -> None:
    assert bench.send(codec.ENTER) == [codec.LEAVE] and bench.gate.refused == 1
    bench.gate.open()
    assert bench.send(codec.ENTER) == [codec.ENTER] and bench.gate.refused == 1


@pytest.mark.parametrize("torque_nm", [0.0, -0.0, 0.1])
def test_a_closed_gate_replaces_any_torque_by_the_command_to_leave(bench: Bench, torque_nm: float) -> None:
    """The nearest code to zero torque is half a step of torque."""
    assert bench.send(codec.encode_torque(torque_nm, 10.0)) == [codec.LEAVE]
    assert bench.gate.refused == 1 and "armed" in bench.gate.last_refusal and "node 5" in bench.gate.last_refusal


def test_an_open_gate_passes_torque_within_limit_and_slew(armed: Bench) -> None:
    for torque_nm in (0.0, 0.2, 0.4, 0.6, 0.75):
        assert armed.torque(torque_nm) == pytest.approx(torque_nm, abs=0.5001 * CODE_NM)
    assert armed.gate.refused == 0
    assert armed.torque(0.75 + 1.01 * CODE_NM) == 0.0
    assert armed.torque(0.2 + 3.0 * CODE_NM) == 0.0
    assert armed.gate.refused == 2


@pytest.mark.parametrize("model", MODELS)
def test_no_torque_that_keeps_limit_and_slew_is_refused_for_its_rounding(model: str) -> None:
    random, bench, torque_nm = Random(4), Bench(model), 0.0
    bench.gate.open()
    for _ in range(3000):
        torque_nm = min(max(torque_nm + random.choice([-0.2, 0.2, random.uniform(-0.2, 0.2)]), -0.75), 0.75)
        assert bench.torque(torque_nm) == pytest.approx(torque_nm, abs=1.0001 * MODELS[model].torque_step_nm)
    assert bench.gate.refused == 0


@pytest.mark.parametrize("code", [codec.ZERO_CODE - 1, codec.ZERO_CODE])
def test_both_codes_next_to_zero_pass_and_only_the_upper_one_is_zero(armed: Bench, code: int) -> None:
    data = bytes.fromhex("800080000000") + code.to_bytes(2, "big")
    assert armed.send(data) == [data]
    assert (codec.decode_torque(data, 10.0) == 0.0) is (code == codec.ZERO_CODE)


@pytest.mark.parametrize("torque_nm", [nan, inf, -inf, 3e38, 10.0])
def test_a_value_that_is_no_torque_or_too_large_becomes_zero_torque(armed: Bench, torque_nm: float) -> None:
    assert armed.torque(torque_nm) == 0.0
    assert armed.gate.refused == 1


def test_after_leaving_or_entering_torque_counts_from_zero(armed: Bench) -> None:
    for torque_nm in (0.2, 0.4):
        armed.torque(torque_nm)
    armed.send(codec.LEAVE)
    assert armed.torque(0.4) == 0.0
    assert armed.torque(0.2) == pytest.approx(0.2, abs=CODE_NM)
    armed.send(codec.ENTER)
    assert armed.torque(0.4) == 0.0


REFUSED = [
    b"",
    codec.SET_ZERO,
    bytes.fromhex("fffffffffffffff8"),
    bytes.fromhex("8000800000100800"),  # kd
    bytes.fromhex("8000800100000800"),  # kp
    bytes.fromhex("8000800000001800"),  # kd's lowest bit
    bytes.fromhex("8001800000000800"),  # another position
    bytes.fromhex("8000801000000800"),  # another velocity
    bytes.fromhex("80008000000008"),
    bytes.fromhex("800080000000080000"),
]


@pytest.mark.parametrize("data", REFUSED)
def test_any_other_payload_becomes_zero_torque_or_the_command_to_leave(data: bytes) -> None:
    closed, armed = Bench(), Bench()
    armed.gate.open()
    assert closed.send(data) == [codec.LEAVE]
    assert armed.send(data) == [codec.encode_torque(0.0, 10.0)]
    assert (closed.gate.refused, armed.gate.refused) == (1, 1)


def test_a_torque_has_twelve_bits_and_none_of_those_of_kd() -> None:
    assert codec.decode_torque(bytes.fromhex("8000800000000fff"), 10.0) == pytest.approx(10.0)
    assert isnan(codec.decode_torque(bytes.fromhex("8000800000001000"), 10.0))


@pytest.mark.parametrize("kind", [codec.WRITE, codec.STORE])
def test_no_register_is_written(armed: Bench, kind: int) -> None:
    for register in REGISTERS:
        assert armed.send(codec.encode_register(NODE, kind, register, bytes(4)), codec.REGISTER_ID) == []
    assert armed.gate.refused == len(REGISTERS)


def test_a_cubemars_is_sent_no_command_that_only_a_damiao_knows() -> None:
    bench = Bench("AK80-9")
    assert bench.send(codec.CLEAR) == [codec.LEAVE]
    assert bench.send(QUESTIONS[0], codec.REGISTER_ID) == []


def test_one_changed_bit_of_a_torque_command_leaves_as_zero_or_as_another_torque() -> None:
    good = codec.encode_torque(0.1, 10.0)
    for bit in range(64):
        armed = Bench()
        armed.gate.open()
        (left,) = armed.send((int.from_bytes(good, "big") ^ 1 << bit).to_bytes(8, "big"))
        assert abs(codec.decode_torque(left, 10.0)) <= 0.2 + 1.5 * CODE_NM + 1e-6


@pytest.mark.parametrize("node_id", [0, 4, 7, 15, 21])
def test_nothing_leaves_for_another_node(armed: Bench, node_id: int) -> None:
    for data in (codec.LEAVE, codec.ENTER, codec.encode_torque(0.0, 10.0)):
        assert armed.send(data, node_id) == []
    assert armed.gate.refused == 3


@pytest.mark.parametrize("change", ["is_extended", "is_fd", "bit_rate_switch", "is_remote", "is_error"])
def test_no_frame_of_another_kind_leaves(armed: Bench, change: str) -> None:
    frame = Frame(NODE, codec.LEAVE)
    armed.port.send(Frame(**(frame._asdict() | {change: not getattr(frame, change)})))
    assert armed.far.receive() == [] and armed.gate.refused == 1
