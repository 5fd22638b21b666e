"""Frames to an ODrive with firmware 0.5 that pass the gate and frames that do not, byte by byte."""

from math import inf, nan

import pytest

from drivers.can.frames import Frame
from drivers.odrive05.gate_table import gate_table
from drivers.odrive05.parameters import Odrive05Parameters
from drivers.transmit_gate import FrameKind
from tests.drivers.gate_bench import OdriveGateBench

TORQUE = 0x04E  # of node 2
IDLE, CLOSED_LOOP = b"\1\0\0\0", b"\x08\0\0\0"
HARMLESS = [
    Frame(0x047, IDLE),
    Frame(0x04B, bytes.fromhex("01000000 01000000")),  # torque mode
    Frame(0x04F, bytes.fromhex("00000041 0000c040")),  # 8 turns/s, 6 A
    Frame(0x05B, bytes.fromhex("0000003f 00000000")),  # 0.5 N·m per turn/s, no integrator
    Frame(0x058),  # clear errors
    Frame(0x04E, bytes(4)),
    Frame(0x04E, bytes.fromhex("00000080")),  # minus zero
    Frame(0x040, is_remote=True),  # the version, which it does not have
    Frame(0x04A, is_remote=True),  # counts
    Frame(0x06A, is_remote=True),
]
REFUSED = [
    Frame(0x058, b"\0"),  # as firmware 0.6 is asked
    Frame(0x046, is_remote=True),  # 0.6 is asked for its serial number so; 0.5 would take it for a new node id
    Frame(0x046, bytes.fromhex("03000000")),
    Frame(0x044, bytes.fromhex("00 c8 01 00")),  # 0.6 is asked for a parameter so
    Frame(0x042),  # emergency stop: not used
    Frame(0x056),  # reboot
    Frame(0x056, is_remote=True),  # reboots as well
    Frame(0x047, is_remote=True),
    Frame(0x04E, is_remote=True),
    Frame(0x04A),  # a request as well, but not of this program's form
    Frame(0x043, is_remote=True),
    Frame(0x08A, is_remote=True),  # of another node
    Frame(0x047, b"\3\0\0\0"),  # calibration
    Frame(0x04B, bytes.fromhex("03000000 01000000")),  # position control
    Frame(0x04F, bytes.fromhex("01000041 0000c040")),
    Frame(0x05B, bytes.fromhex("0000003f 0000803f")),  # an integrator
    Frame(0x04C, bytes(8)),
    Frame(0x04D, bytes(8)),
    Frame(0x050),  # calibration of cogging
    Frame(0x059, bytes(4)),  # a new angle
]


class Bench(OdriveGateBench):
    def __init__(self) -> None:
        drives = [Odrive05Parameters("left", node, velocity_limit_turn_s=8.0, current_limit_a=6.0) for node in (2, 3)]
        super().__init__(map(gate_table, drives))

    def torque(self, torque_nm: float, identifier: int = TORQUE) -> float:
        return super().torque(torque_nm, identifier)


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def armed() -> Bench:
    bench = Bench()
    bench.gate.open()
    return bench


def test_the_table_is_of_its_node_and_checks_no_payload() -> None:
    table = gate_table(Odrive05Parameters("left", 2))
    assert (table.node_id, table.torque_id, table.kind) == (2, TORQUE, FrameKind())
    assert table.decode_torque(table.zero_torque) == 0.0
    assert table.checks == {} and table.idle == b"" and table.torque_step_nm == 0.0


@pytest.mark.parametrize("is_open", [False, True])
@pytest.mark.parametrize("frame", HARMLESS)
def test_the_frames_in_use_pass_unchanged_open_or_closed(bench: Bench, frame: Frame, is_open: bool) -> None:
    if is_open:
        bench.gate.open()
    assert bench.send(frame) == [frame]
    assert bench.gate.refused == 0


@pytest.mark.parametrize("frame", REFUSED)
def test_no_other_frame_passes_even_while_open(armed: Bench, frame: Frame) -> None:
    assert armed.send(frame) == []
    assert armed.gate.refused == 1


@pytest.mark.parametrize("change", ["is_extended", "is_fd", "bit_rate_switch", "is_error"])
@pytest.mark.parametrize("frame", HARMLESS)
def test_no_frame_of_another_kind_passes(armed: Bench, frame: Frame, change: str) -> None:
    assert armed.send(Frame(**(frame._asdict() | {change: True}))) == []
    assert armed.gate.refused == 1


def test_closed_loop_passes_only_while_open(bench: Bench) -> None:
    frame = Frame(0x047, CLOSED_LOOP)
    assert bench.send(frame) == [] and bench.gate.refused == 1
    bench.gate.open()
    assert bench.send(frame) == [frame] and bench.gate.refused == 1


def test_torque_passes_only_while_open_and_within_limit_and_slew(bench: Bench) -> None:
    assert bench.torque(0.1) == 0.0 and bench.gate.refused == 1
    bench.gate.open()
    for torque_nm in (0.2, 0.4, 0.6, 0.75):
        assert bench.torque(torque_nm) == pytest.approx(torque_nm)
    assert bench.gate.refused == 1
    assert bench.torque(0.76) == 0.0
    assert bench.torque(0.21) == 0.0
    assert bench.gate.refused == 3


@pytest.mark.parametrize("torque_nm", [nan, inf, -inf, 3e38])
def test_a_value_that_is_no_torque_becomes_zero_torque(armed: Bench, torque_nm: float) -> None:
    assert armed.torque(torque_nm) == 0.0
    assert armed.gate.refused == 1


@pytest.mark.parametrize("size", [0, 3, 5, 8])
def test_a_torque_of_another_length_becomes_zero_torque(armed: Bench, size: int) -> None:
    assert armed.send(Frame(TORQUE, bytes(size))) == [Frame(TORQUE, bytes(4))]
    assert armed.gate.refused == 1
