"""Frames that pass the gate to the wires and frames that do not, byte by byte; covers every branch and every mutant."""

import ast
import re
from math import isfinite
from pathlib import Path
from struct import pack, unpack

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from control.parameters.joint_limits import JointLimits
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockBus
from drivers.transmit_gate import TransmitGate
from tests.drivers.gate_bench import (
    CLOSED_LOOP,
    CONFIGURED,
    IDLE,
    LIMITS,
    TORQUE_MODE,
    ZERO,
    GateBench,
    odrive,
    of_moteus,
)
from tests.folders import ROOT

MOTOR, OTHER = 0x04E, 0x06E  # torque of nodes 2 and 3
DRIVES = [odrive(2), odrive(3)]
each_direction = pytest.mark.parametrize("sign", [1.0, -1.0])
HARMLESS_IDS = {frame.arbitration_id for drive in DRIVES for frame in drive.always}


class Bench(GateBench):
    """The gate with two ODrives."""

    def __init__(self, limits: JointLimits = LIMITS, is_open: bool = False) -> None:
        super().__init__([drive.table for drive in DRIVES], limits, is_open)

    def torque(self, torque_nm: float, identifier: int = MOTOR) -> float:
        """Send a torque and return the torque that leaves."""
        (frame,) = self.passed(Frame(identifier, pack("<f", torque_nm)))
        assert frame.arbitration_id == identifier
        sent_nm: float = unpack("<f", frame.data)[0]
        return sent_nm


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def armed() -> Bench:
    return Bench(is_open=True)


@pytest.mark.parametrize(
    ("frame", "text", "rule"),
    [
        (Frame(0x04C, b"\1\xab"), "Frame 0x04c 01 ab", "id"),
        (Frame(0x04F), "Frame 0x04f", "payload"),
        (Frame(0x047, CLOSED_LOOP), "Frame 0x047 08 00 00 00", "armed"),
        (Frame(0x18FEF100, b"\2", is_extended=True), "Frame 0x18fef100 extended 02", "kind"),
        (Frame(0x047, IDLE, is_error=True), "Frame 0x047 error 01 00 00 00", "kind"),
        (Frame(0x004, is_error=True, is_remote=True), "Frame 0x004 error remote", "requests"),
        (Frame(0x005, b"\3", is_fd=True, bit_rate_switch=True), "Frame 0x005 FD bit-rate-switch 03", "kind"),
    ],
)
def test_a_refusal_names_the_frame_and_the_rule_that_it_broke(bench: Bench, frame: Frame, text: str, rule: str) -> None:
    bench.passed(frame)
    bench.passed(frame)
    refused, _, reason = bench.gate.last_refusal.partition(" was not sent: ")
    assert refused == text and rule in reason
    assert bench.gate.refused == 2


def test_a_gate_is_closed_until_it_is_opened_and_lets_zero_pass_only(bench: Bench) -> None:
    assert not bench.gate.is_open
    assert bench.torque(0.1) == 0.0
    assert "0.1 N·m" in bench.gate.last_refusal and "armed" in bench.gate.last_refusal
    bench.gate.open()
    assert bench.gate.is_open
    assert bench.torque(0.1) == pytest.approx(0.1)
    bench.gate.close()
    assert not bench.gate.is_open
    assert bench.torque(0.1) == 0.0
    assert bench.torque(5e-324) == 0.0
    assert bench.torque(1.5e-45) == 0.0  # the smallest that binary32 holds
    assert bench.gate.refused == 3


@pytest.mark.parametrize("limit_nm", [0.3, 5.0])
@each_direction
def test_the_limit_itself_passes_in_both_directions_also_where_binary32_rounds_it_up(
    limit_nm: float, sign: float
) -> None:
    bench = Bench(JointLimits(torque_nm=limit_nm, torque_rate_nm_s=1e9), is_open=True)
    assert bench.torque(sign * limit_nm) == pytest.approx(sign * limit_nm)
    assert bench.torque(sign * (limit_nm + 4e-6)) == 0.0
    assert bench.gate.refused == 1


@each_direction
def test_a_larger_step_becomes_zero_from_where_the_next_step_counts(armed: Bench, sign: float) -> None:
    assert armed.torque(sign * 0.2) == pytest.approx(sign * 0.2)
    assert armed.torque(sign * 0.40001) == 0.0
    assert f"{sign * 0.4:.4g} N·m" in armed.gate.last_refusal and f"{sign * 0.2:.4g} N·m" in armed.gate.last_refusal
    assert armed.torque(sign * 0.3) == 0.0
    assert armed.gate.refused == 2
    assert armed.torque(sign * 0.2) == pytest.approx(sign * 0.2)


@each_direction
@pytest.mark.parametrize(("after_nm", "passes"), [(0.55, True), (0.01, True), (0.0, True), (-0.01, False)])
def test_towards_zero_is_always_allowed_and_no_further(
    armed: Bench, sign: float, after_nm: float, passes: bool
) -> None:
    for torque_nm in (0.2, 0.4, 0.6):
        armed.torque(sign * torque_nm)
    assert armed.torque(sign * after_nm) == pytest.approx(sign * after_nm if passes else 0.0)
    assert armed.gate.refused == (not passes)


@each_direction
def test_one_step_may_lead_through_zero(armed: Bench, sign: float) -> None:
    armed.torque(sign * 0.15)
    assert armed.torque(sign * -0.05) == pytest.approx(sign * -0.05)
    assert armed.torque(sign * 0.1500) == pytest.approx(sign * 0.15)
    assert armed.torque(sign * -0.0501) == 0.0


def test_the_step_is_as_long_as_the_time_that_has_passed(armed: Bench) -> None:
    armed.gate.allow_step(0.004)
    assert armed.torque(0.4) == pytest.approx(0.4)
    armed.gate.allow_step(0.001)
    assert armed.torque(0.5) == pytest.approx(0.5)
    assert armed.torque(0.601) == 0.0


def test_the_bounds_themselves_belong_to_what_may_pass() -> None:
    gate = TransmitGate(JointLimits(torque_nm=0.75, torque_rate_nm_s=128.0))
    gate.open()
    gate.allow_step(1.0 / 512.0)
    step_nm = 0.25 + 1e-6
    for sign in (1.0, -1.0):
        assert gate.torque_problem(sign * (0.5 + step_nm), sign * 0.5) == ""
        assert gate.torque_problem(sign * (0.5 + 1.001 * step_nm), sign * 0.5) != ""
        assert gate.torque_problem(sign * (0.75 + 1e-6), sign * 0.75) == ""
        assert gate.torque_problem(sign * (0.75 + 1.1e-6), sign * 0.75) != ""
        assert gate.torque_problem(sign * 0.0, sign * 0.75) == ""


def test_no_torque_passes_before_a_step_was_allowed() -> None:
    gate, bus = TransmitGate(LIMITS), MockBus()
    far, port = bus.open(), gate.outlet(bus.open(), [odrive().table])
    gate.open()
    port.send(Frame(MOTOR, pack("<f", 1e-7)))
    assert far.receive() == [Frame(MOTOR, ZERO)]


def test_every_drive_has_its_own_torque_before(armed: Bench) -> None:
    armed.torque(0.2, MOTOR)
    assert armed.torque(0.4, MOTOR) == pytest.approx(0.4)
    assert armed.torque(0.4, OTHER) == 0.0
    assert "node 3" in armed.gate.last_refusal


def test_the_first_torque_after_arming_counts_from_zero_on_every_bus(armed: Bench) -> None:
    bus = MockBus()
    far, second = bus.open(), armed.gate.outlet(bus.open(), [odrive().table])
    second.send(Frame(MOTOR, pack("<f", 0.4)))
    assert far.receive() == [Frame(MOTOR, ZERO)]
    for torque_nm in (0.2, 0.4):
        armed.torque(torque_nm)
        second.send(Frame(MOTOR, pack("<f", torque_nm)))
    armed.gate.close()
    armed.gate.open()
    far.receive()
    assert armed.torque(0.4) == 0.0
    second.send(Frame(MOTOR, pack("<f", 0.4)))
    assert far.receive() == [Frame(MOTOR, ZERO)]


def test_opening_an_open_gate_changes_nothing(armed: Bench) -> None:
    armed.torque(0.2)
    armed.gate.open()
    assert armed.torque(0.4) == pytest.approx(0.4)


@given(st.lists(st.tuples(st.sampled_from([MOTOR, OTHER]), st.floats(width=32)), max_size=30), st.booleans())
def test_every_torque_that_leaves_is_within_limit_and_slew(torques: list[tuple[int, float]], is_open: bool) -> None:
    bench = Bench(is_open=is_open)
    left_nm = {MOTOR: 0.0, OTHER: 0.0}
    for identifier, wanted_nm in torques:
        before_nm, sent_nm = left_nm[identifier], bench.torque(wanted_nm, identifier)
        assert isfinite(sent_nm)
        assert abs(sent_nm) <= (0.75 + 2e-6 if is_open else 0.0)
        assert abs(sent_nm) <= abs(before_nm) + 0.2 + 2e-6
        assert sent_nm * before_nm >= 0.0 or abs(sent_nm - before_nm) <= 0.2 + 2e-6
        left_nm[identifier] = sent_nm


ANY_FRAME = st.builds(
    Frame,
    st.integers(0, 0x7FF) | st.integers(0x040, 0x07F) | st.integers(0, 0x1FFFFFFF),
    st.binary(max_size=8) | st.sampled_from([ZERO, IDLE, CLOSED_LOOP, TORQUE_MODE, CONFIGURED]),
    st.booleans(),
    st.booleans(),
    st.booleans(),
)


@settings(max_examples=100)
@given(ANY_FRAME)
def test_no_frame_raises_and_none_passes_a_closed_gate_but_harmless_ones(frame: Frame) -> None:
    bench = Bench()
    passed = bench.passed(frame)
    for other in passed:
        assert other.arbitration_id in HARMLESS_IDS
        assert not other.is_extended and not other.is_error
        assert other.data != CLOSED_LOOP
        assert other.arbitration_id not in (MOTOR, OTHER) or other.data in (ZERO, bytes.fromhex("00000080"))
        assert other == frame or other.data == ZERO
    assert len(passed) <= 1


def test_an_outlet_takes_frames_of_one_kind() -> None:
    with pytest.raises(ValueError):
        TransmitGate(LIMITS).outlet(MockBus().open(), [of_moteus().table, odrive().table])


def modules_of(*packages: str) -> list[Path]:
    return [path for package in packages for path in sorted((ROOT / package).rglob("*.py"))]


def calls_of(path: Path, name: str) -> list[str]:
    """Return the text before `.name(` of every such call."""
    source = path.read_text(encoding="utf-8")
    if f".{name}(" not in source:
        return []
    tree = ast.parse(source)
    calls = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return [ast.unparse(call.value) for call in calls if isinstance(call, ast.Attribute) and call.attr == name]


def test_nothing_but_the_gate_sends_on_a_port() -> None:
    """In drivers every call of `.send(` is listed here; above them only sockets and the drives themselves send."""
    senders = {f"{path.parent.name}/{path.name}": set(calls_of(path, "send")) for path in modules_of("drivers")}
    allowed = {
        "drivers/transmit_gate.py": {"self._port"},
        "mit/axis.py": {"self._outlet"},
        "moteus/axis.py": {"self._outlet"},
        "odrive05/axis.py": {"self._outlet"},
        "odrive/cansimple_axis.py": {"self._outlet"},
        "bench/bench_port.py": {"self._port"},  # finds and sets up idle drives, with no gate
        "odrive/setup.py": {"self._port"},  # that bench port
        "can/can_port.py": {"self._bus"},  # python-can's
        "can/socketcan_port.py": {"self._socket"},  # the same bus's socket
        "can/reopening_port.py": {"port"},  # after the gate: its wire may vanish
        "fault_injection/failing_port.py": {"self._port"},  # after the gate: it injects failures into the wire
        "can/local_bus.py": {"self._link", "peer.connection"},
        "pose/natnet_bridge.py": {"link"},  # to the loop's process
    }
    assert {name: calls for name, calls in senders.items() if calls} == allowed
    for path in modules_of("control", "estimation", "firmware_host", "command_line"):
        for receiver in calls_of(path, "send"):
            assert "port" not in receiver.split(".")[-1].replace("reporter", "") and "bus" not in receiver, (
                f"{path.name}: {receiver}.send("
            )


def test_no_frame_is_repeated_by_the_kernel() -> None:
    """python-can's periodic tasks go on after this process has died, and feed the drives' watchdogs."""
    product = ("control", "estimation", "drivers", "firmware_host", "simulation", "experiments", "command_line")
    repeating = re.compile(r"send_periodic|CyclicSendTask|CyclicTask|CAN_BCM")
    assert not [path for path in modules_of(*product) if repeating.search(path.read_text(encoding="utf-8"))]
