"""Frames to a moteus that pass the gate and frames that do not, where all share one arbitration id."""

from math import inf, nan
from random import Random

import pytest

from drivers.can.frames import Frame
from drivers.moteus import codec, registers
from drivers.moteus.gate_table import gate_table
from drivers.moteus.parameters import MoteusParameters
from drivers.moteus.settings import IDENTITY, POLL, QUESTIONS
from drivers.transmit_gate import FrameKind
from tests.drivers.gate_bench import GateBench

NODE = 5
STOP = codec.STOP_AND_QUERY
ALWAYS = [codec.QUERY_ALONE, STOP, IDENTITY, POLL, *QUESTIONS]


class Bench(GateBench):
    def __init__(self) -> None:
        super().__init__(gate_table(MoteusParameters("left", node)) for node in (NODE, 6))

    def send(self, data: bytes, node_id: int = NODE) -> list[bytes]:
        frames = self.passed(Frame(0x8000 | node_id, data, is_extended=True, is_fd=True, bit_rate_switch=True))
        for frame in frames:
            assert frame.arbitration_id == 0x8000 | node_id
            assert frame.is_extended and frame.is_fd and frame.bit_rate_switch
        return [frame.data for frame in frames]

    def torque(self, torque_nm: float) -> float:
        """Return the torque that leaves; NaN where another command left."""
        (data,) = self.send(codec.encode_torque(torque_nm))
        return codec.decode_torque(data)


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def armed() -> Bench:
    bench = Bench()
    bench.gate.open()
    return bench


def test_the_table_is_of_its_node_and_of_can_fd() -> None:
    table = gate_table(MoteusParameters("left", NODE))
    assert (table.node_id, table.torque_id, table.kind) == (NODE, 0x8005, FrameKind(True, True, True))
    assert codec.decode_torque(table.zero_torque) == 0.0
    assert table.while_open == {} and table.checks == {} and table.requests == frozenset()


@pytest.mark.parametrize("is_open", [False, True])
@pytest.mark.parametrize("data", ALWAYS)
def test_stops_and_questions_pass_open_or_closed(bench: Bench, data: bytes, is_open: bool) -> None:
    if is_open:
        bench.gate.open()
    assert bench.send(data) == [data]
    assert bench.gate.refused == 0


@pytest.mark.parametrize("torque_nm", [0.0, -0.0, 0.1, nan])
def test_a_closed_gate_replaces_any_torque_by_a_question(bench: Bench, torque_nm: float) -> None:
    """A torque of zero would let the drive follow torque."""
    assert bench.send(codec.encode_torque(torque_nm)) == [codec.QUERY_ALONE]
    assert bench.gate.refused == 1 and "armed" in bench.gate.last_refusal and "node 5" in bench.gate.last_refusal


def test_an_open_gate_passes_torque_within_limit_and_slew(armed: Bench) -> None:
    assert armed.torque(0.0) == 0.0
    for torque_nm in (0.2, 0.4, 0.6, 0.75):
        assert armed.torque(torque_nm) == pytest.approx(torque_nm)
    assert armed.gate.refused == 0
    assert armed.torque(0.76) == 0.0
    assert armed.torque(0.21) == 0.0
    assert armed.gate.refused == 2


@pytest.mark.parametrize("torque_nm", [nan, inf, -inf, 3e38])
def test_a_value_that_is_no_torque_becomes_zero_torque(armed: Bench, torque_nm: float) -> None:
    assert armed.torque(torque_nm) == 0.0
    assert armed.gate.refused == 1


def test_after_a_stop_torque_counts_from_zero(armed: Bench) -> None:
    for torque_nm in (0.2, 0.4):
        armed.torque(torque_nm)
    armed.send(STOP)
    assert armed.torque(0.4) == 0.0
    assert armed.torque(0.2) == pytest.approx(0.2)
    armed.send(codec.QUERY_ALONE, node_id=6)
    assert armed.torque(0.4) == pytest.approx(0.4)


REFUSED = [
    b"",
    codec.STOP,  # without asking
    bytes.fromhex("01000a"),  # position mode with the defaults: kp and kd
    bytes.fromhex("01000f"),
    registers.padded(registers.encode_console(registers.CONSOLE_INPUT, b"d stop\n")),
    registers.padded(registers.encode_console(registers.CONSOLE_INPUT, b"conf set servo.default_timeout_s nan\n")),
    registers.padded(registers.encode_console(registers.CONSOLE_INPUT, b"conf write\n")),
    codec.QUERY_ALONE + codec.QUERY_ALONE,
    codec.encode_torque(0.1) + bytes([registers.NOP]),
]


@pytest.mark.parametrize("data", REFUSED)
def test_any_other_payload_becomes_zero_torque_or_a_question(data: bytes) -> None:
    """All payloads share the id of the torque, so a refused one is treated as a malformed torque."""
    closed, armed = Bench(), Bench()
    armed.gate.open()
    assert closed.send(data) == [codec.QUERY_ALONE]
    assert armed.send(data) == [codec.encode_torque(0.0)]
    assert (closed.gate.refused, armed.gate.refused) == (1, 1)


def test_one_changed_byte_of_a_torque_command_leaves_as_zero_or_as_another_torque() -> None:
    random, good = Random(1), codec.encode_torque(0.1)
    for _ in range(2000):
        armed, data = Bench(), bytearray(good)
        armed.gate.open()
        position = random.randrange(len(data))
        data[position] ^= 1 << random.randrange(8)
        (left,) = armed.send(bytes(data))
        assert abs(codec.decode_torque(left)) <= 0.2 + 1e-6


@pytest.mark.parametrize("node_id", [0, 4, 7, 0x7F])
def test_nothing_leaves_for_another_node(armed: Bench, node_id: int) -> None:
    for data in (*ALWAYS, codec.encode_torque(0.0)):
        assert armed.send(data, node_id) == []
    assert armed.gate.refused == len(ALWAYS) + 1


@pytest.mark.parametrize("change", ["is_extended", "is_fd", "bit_rate_switch", "is_remote", "is_error"])
def test_no_frame_of_another_kind_leaves(armed: Bench, change: str) -> None:
    frame = Frame(0x8005, codec.QUERY_ALONE, is_extended=True, is_fd=True, bit_rate_switch=True)
    armed.port.send(Frame(**(frame._asdict() | {change: not getattr(frame, change)})))
    assert armed.far.receive() == [] and armed.gate.refused == 1
