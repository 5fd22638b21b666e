"""The gate's table of every protocol: the frames that leave and those that do not, by the same claims for all."""

from math import inf, isnan, nan
from random import Random

import pytest

from drivers.can.frames import Frame
from drivers.drive_types import DRIVE_TYPES
from drivers.mit import codec as mit
from drivers.mit.models import MODELS
from tests.drivers.gate_bench import NODE, OTHER_NODE, PROTOCOLS, GateBench, Protocol, damiao

FLAGS = ("is_extended", "is_fd", "bit_rate_switch", "is_remote", "is_error")
each_state = pytest.mark.parametrize("is_open", [False, True])


@pytest.fixture(params=PROTOCOLS)
def protocol(request: pytest.FixtureRequest) -> Protocol:
    return PROTOCOLS[request.param](NODE)


def make_bench(protocol: Protocol, is_open: bool) -> GateBench:
    """Make a gate for the node and, of the same protocol, another one."""
    other = next(make(OTHER_NODE) for make in PROTOCOLS.values() if is_alike(make(NODE), protocol))
    return GateBench([protocol.table, other.table], is_open=is_open)


def is_alike(one: Protocol, other: Protocol) -> bool:
    return one.always == other.always and one.torque(0.1) == other.torque(0.1)


def torque_that_leaves(bench: GateBench, protocol: Protocol, torque_nm: float) -> float:
    """Return the torque that leaves; NaN where another command left."""
    (frame,) = bench.passed(protocol.torque_frame(protocol.torque(torque_nm)))
    assert frame == protocol.torque_frame(frame.data)
    return protocol.table.decode_torque(frame.data)


def test_every_type_of_drive_is_examined() -> None:
    assert {*PROTOCOLS} - {"damiao", "cubemars", "robstride"} | {"mit"} == {*DRIVE_TYPES}


@each_state
def test_listed_frames_of_every_node_pass_unchanged_open_or_closed(protocol: Protocol, is_open: bool) -> None:
    bench = make_bench(protocol, is_open)
    for frame in protocol.always:
        assert bench.passed(frame) == [frame]
    assert (bench.gate.refused, bench.gate.last_refusal) == (0, "")
    assert protocol.table.node_id == NODE and protocol.table.decode_torque(protocol.table.zero_torque) == 0.0


def test_what_lets_a_drive_follow_torque_leaves_only_while_open(protocol: Protocol) -> None:
    bench = make_bench(protocol, is_open=False)
    for frame in protocol.while_open:
        shares_the_torque_s_id = frame.arbitration_id == protocol.table.torque_id
        assert bench.passed(frame) == ([protocol.torque_frame(protocol.idle)] if shares_the_torque_s_id else [])
        bench.gate.open()
        assert bench.passed(frame) == [frame]
    assert bench.gate.refused == len(protocol.while_open)


@each_state
def test_no_other_frame_leaves(protocol: Protocol, is_open: bool) -> None:
    bench = make_bench(protocol, is_open)
    assert [frame for frame in protocol.never if bench.passed(frame)] == []
    assert bench.gate.refused == len(protocol.never)


@each_state
def test_another_payload_under_the_torque_s_id_is_replaced(protocol: Protocol, is_open: bool) -> None:
    bench = make_bench(protocol, is_open)
    replacement = protocol.table.zero_torque if is_open or not protocol.idle else protocol.idle
    for data in protocol.no_torque:
        assert bench.passed(protocol.torque_frame(data)) == [protocol.torque_frame(replacement)]
    assert bench.gate.refused == len(protocol.no_torque)
    assert "neither a listed frame nor a torque" in bench.gate.last_refusal
    assert f"{data.hex(' ')} to node 2" in bench.gate.last_refusal  # and no torque between them
    assert ("replaced by zero torque" in bench.gate.last_refusal) is (replacement == protocol.table.zero_torque)


@pytest.mark.parametrize("change", FLAGS)
def test_no_frame_of_another_kind_leaves(protocol: Protocol, change: str) -> None:
    bench = make_bench(protocol, is_open=True)
    for frame in (*protocol.always, protocol.torque_frame(protocol.torque(0.1))):
        assert bench.passed(Frame(**(frame._asdict() | {change: not getattr(frame, change)}))) == []


@pytest.mark.parametrize("node", [1, 4, 9, 15])
def test_nothing_leaves_for_another_node(protocol: Protocol, node: int) -> None:
    bench = make_bench(protocol, is_open=True)
    other = next(make(node) for make in PROTOCOLS.values() if is_alike(make(NODE), protocol))
    for frame in (*other.always, *other.while_open, other.torque_frame(other.torque(0.0))):
        assert bench.passed(frame) == []


@pytest.mark.parametrize("torque_nm", [0.0, -0.0, 0.1, nan])
def test_a_closed_gate_replaces_torque_and_zero_torque_too_where_it_ends_idleness(
    protocol: Protocol, torque_nm: float
) -> None:
    bench = make_bench(protocol, is_open=False)
    (left,) = bench.passed(protocol.torque_frame(protocol.torque(torque_nm)))
    if protocol.idle:
        assert left.data == protocol.idle
    else:
        assert protocol.table.decode_torque(left.data) == 0.0
    refused = bool(protocol.idle or torque_nm)
    assert bench.gate.refused == refused
    assert not refused or torque_nm != torque_nm or "armed" in bench.gate.last_refusal


def test_an_open_gate_passes_torque_within_limit_and_slew(protocol: Protocol) -> None:
    bench, code_nm = make_bench(protocol, is_open=True), protocol.table.torque_step_nm
    for torque_nm in (0.0, 0.2, 0.4, 0.6, 0.75):
        assert torque_that_leaves(bench, protocol, torque_nm) == pytest.approx(torque_nm, abs=0.5001 * code_nm + 1e-6)
    assert bench.gate.refused == 0
    assert torque_that_leaves(bench, protocol, 0.751 + 1.01 * code_nm) == 0.0
    assert torque_that_leaves(bench, protocol, 0.2005 + 2.0 * code_nm) == 0.0
    assert bench.gate.refused == 2


@pytest.mark.parametrize("torque_nm", [nan, inf, -inf, 3e38, 10.0])
def test_a_value_that_is_no_torque_or_too_large_becomes_zero_torque(protocol: Protocol, torque_nm: float) -> None:
    bench = make_bench(protocol, is_open=True)
    assert torque_that_leaves(bench, protocol, torque_nm) == 0.0
    assert bench.gate.refused == 1


def test_after_another_command_of_its_id_torque_counts_from_zero(protocol: Protocol) -> None:
    listed = [frame for frame in (*protocol.always, *protocol.while_open) if frame.data not in protocol.table.questions]
    shared = [frame for frame in listed if frame == protocol.torque_frame(frame.data)]
    for frame in shared:
        bench = make_bench(protocol, is_open=True)
        for torque_nm in (0.2, 0.4):
            torque_that_leaves(bench, protocol, torque_nm)
        bench.passed(frame)
        assert torque_that_leaves(bench, protocol, 0.4) == 0.0
        assert torque_that_leaves(bench, protocol, 0.2) == pytest.approx(0.2, abs=1e-6 + protocol.table.torque_step_nm)


def test_after_a_question_of_its_id_torque_goes_on(protocol: Protocol) -> None:
    for question in protocol.table.questions:
        bench = make_bench(protocol, is_open=True)
        for torque_nm in (0.2, 0.4):
            torque_that_leaves(bench, protocol, torque_nm)
        bench.passed(protocol.torque_frame(question))
        assert torque_that_leaves(bench, protocol, 0.5) == pytest.approx(0.5, abs=1e-6 + protocol.table.torque_step_nm)


def test_one_changed_bit_of_a_torque_command_leaves_as_zero_or_as_another_torque(protocol: Protocol) -> None:
    good, most_nm = protocol.torque(0.1), 0.2 + 1.5 * protocol.table.torque_step_nm + 1e-6
    for bit in range(8 * len(good)):
        data = (int.from_bytes(good, "big") ^ 1 << bit).to_bytes(len(good), "big")
        (left,) = make_bench(protocol, is_open=True).passed(protocol.torque_frame(data))
        assert abs(protocol.table.decode_torque(left.data)) <= most_nm


@pytest.mark.parametrize("model", MODELS)
def test_no_torque_that_keeps_limit_and_slew_is_refused_for_its_rounding(model: str) -> None:
    drive = damiao(model=model)
    random, bench, torque_nm = Random(4), GateBench([drive.table], is_open=True), 0.0
    assert drive.table.torque_step_nm == MODELS[model].torque_step_nm
    for _ in range(1000):
        torque_nm = min(max(torque_nm + random.choice([-0.2, 0.2, random.uniform(-0.2, 0.2)]), -0.75), 0.75)
        left_nm = torque_that_leaves(bench, drive, torque_nm)
        assert left_nm == pytest.approx(torque_nm, abs=1.0001 * drive.table.torque_step_nm)
    assert bench.gate.refused == 0


@pytest.mark.parametrize("code", [mit.ZERO_CODE - 1, mit.ZERO_CODE])
def test_both_codes_next_to_zero_pass_and_only_the_upper_one_is_zero(code: int) -> None:
    drive, data = damiao(), bytes.fromhex("800080000000") + code.to_bytes(2, "big")
    bench = GateBench([drive.table], is_open=True)
    assert bench.passed(Frame(NODE, data)) == [Frame(NODE, data)]
    assert (drive.table.decode_torque(data) == 0.0) is (code == mit.ZERO_CODE)
    assert isnan(drive.table.decode_torque(bytes.fromhex("8000800000001000")))  # a thirteenth bit
