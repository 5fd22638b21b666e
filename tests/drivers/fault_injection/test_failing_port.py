"""A failing port next to a sound one on the same traffic: only the injected failure makes a difference."""

import math
from collections import defaultdict
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import pytest

from control.records import JOINTS
from drivers.can.frames import Frame, MalformedMessageError
from drivers.can.mock_bus import MockBus, MockPort
from drivers.can.port_health import BusState
from drivers.drive import DriveParameters
from drivers.fault_injection.failing_port import FailingPort
from drivers.fault_injection.failures import Failures
from drivers.mit import codec as mit
from drivers.mit.drive_type import Mit
from drivers.mit.parameters import MitParameters
from drivers.mit.settings import FLOAT, SUPPLY_V
from drivers.odrive import codec
from drivers.odrive.codec import AxisState, arbitration_id
from drivers.odrive.parameters import OdriveParameters

DRIVES = {joint: OdriveParameters("left" if node < 2 else "right", node) for node, joint in enumerate(JOINTS)}
NODES = {joint: drive.node_id for joint, drive in DRIVES.items()}
PERIOD_S = 0.0025
BEGIN_S, END_S, STOP_S = 0.1, 0.5, 0.55
LEFT_JOINTS = JOINTS[:2]
REPORTED = (
    codec.GET_ENCODER_ESTIMATES,
    codec.GET_IQ,
    codec.HEARTBEAT,
    codec.GET_ERROR,
    codec.GET_TEMPERATURE,
    codec.GET_BUS_VOLTAGE_CURRENT,
)
PARTS = {
    "position": {codec.GET_ENCODER_ESTIMATES},
    "current": {codec.GET_IQ},
    "heartbeat": {codec.HEARTBEAT},
    "temperature": {codec.GET_TEMPERATURE},
    "voltage": {codec.GET_BUS_VOLTAGE_CURRENT},
    "error": {codec.HEARTBEAT, codec.GET_ERROR},
    "command": set(),
}
BY_CHANCE = ("garbage", "slow", "intermittent")
ON_THE_LEFT = [
    (component, kind)
    for component, kind, _ in Failures(("left", "right")).table()
    if component.startswith(("left_", "bus.left"))
]


class Traffic(NamedTuple):
    """The frames that passed a port, as (tick, payload) by arbitration id, the commands before it, and its counters."""

    received: dict[int, list[tuple[int, bytes]]]
    sent: dict[int, list[tuple[int, bytes]]]
    wanted: dict[int, list[tuple[int, bytes]]]
    worst_state: BusState
    failed_sends: int
    error_frames: int
    last_send_error: str
    stamps_s: list[tuple[float, float]]


def reported_payload(message: codec.Message, tick: int) -> bytes:
    """Return a drive's message with another payload in each tick."""
    if message is codec.HEARTBEAT:
        return message.encode(0, AxisState.CLOSED_LOOP, tick % 256, 0)
    if message is codec.GET_ERROR:
        return message.encode(0, 0)
    return message.encode(0.001 * tick, 0.002 * tick)


def run(component: str = "", kind: str = "") -> Traffic:
    failures = Failures(("left", "right"))
    bus = MockBus()
    robot, inner = bus.open(), bus.open()
    port = FailingPort("left", inner, DRIVES, failures)
    received, sent, wanted = defaultdict(list), defaultdict(list), defaultdict(list)
    worst, stamps_s = BusState.ACTIVE, []
    for tick in range(round(STOP_S / PERIOD_S)):
        now_s = tick * PERIOD_S
        failures.update(now_s)
        if component and tick == round(BEGIN_S / PERIOD_S):
            assert failures.begin(component, kind, now_s, END_S - BEGIN_S) is None
        for joint in LEFT_JOINTS:
            for message in REPORTED:
                identifier = arbitration_id(NODES[joint], message)
                robot.send(Frame(identifier, reported_payload(message, tick), stamp_s=now_s))
        for frame in port.receive():
            received[frame.arbitration_id].append((tick, frame.data))
            stamps_s.append((now_s, frame.stamp_s))
        worst = max(worst, port.state)
        for joint in LEFT_JOINTS:
            frame = Frame(arbitration_id(NODES[joint], codec.SET_INPUT_TORQUE), codec.SET_INPUT_TORQUE.encode(tick))
            wanted[frame.arbitration_id].append((tick, frame.data))
            port.send(frame)
        for frame in robot.receive():
            sent[frame.arbitration_id].append((tick, frame.data))
    return Traffic(received, sent, wanted, worst, port.failed_sends, port.error_frames, port.last_send_error, stamps_s)


SOUND, seen_in = run(), cache(run)


def opened(
    component: str, kind: str, drives: Mapping[str, DriveParameters] = DRIVES, inner: MockPort | None = None
) -> tuple[MockPort, FailingPort, Failures]:
    """Return the robot's end of a bus, and the port of the loop with a failure that has begun."""
    failures, bus = Failures(("left",)), MockBus()
    robot = bus.open()
    port = FailingPort("left", inner or bus.open(), drives, failures)
    failures.update(0.0)
    assert failures.begin(component, kind, 0.0) is None
    return robot, port, failures


def differing(one: dict[int, Any], other: dict[int, Any]) -> set[int]:
    return {identifier for identifier in one.keys() | other.keys() if one.get(identifier) != other.get(identifier)}


def ids_of(component: str) -> set[int]:
    """Return the arbitration ids from the drives that a failure of `component` may touch."""
    name, _, part = component.partition(".")
    if name == "bus":
        return set(range(0x800))
    return {arbitration_id(NODES[name], message) for message in (PARTS[part] if part else REPORTED)}


def commands_of(component: str, kind: str) -> set[int]:
    name, _, part = component.partition(".")
    if name == "bus":
        return {arbitration_id(NODES[joint], codec.SET_INPUT_TORQUE) for joint in JOINTS}
    reaches = part == "command" or not part and kind not in ("stuck", "garbage")
    return {arbitration_id(NODES[name], codec.SET_INPUT_TORQUE)} if reaches else set()


def test_without_a_failure_everything_passes_as_it_is() -> None:
    assert SOUND.sent == SOUND.wanted and len(SOUND.sent) == 2
    assert [len(reported) for reported in SOUND.received.values()] == [round(STOP_S / PERIOD_S)] * 2 * len(REPORTED)
    assert (SOUND.worst_state, SOUND.failed_sends, SOUND.error_frames) == (BusState.ACTIVE, 0, 0)


@pytest.mark.parametrize(("component", "kind"), ON_THE_LEFT)
def test_each_failure_changes_only_its_component_and_time_and_is_reproducible(component: str, kind: str) -> None:
    seen = seen_in(component, kind)
    assert kind not in BY_CHANCE or seen == run(component, kind)
    check_component(seen, component, kind)
    check_time(seen)
    check_commands(seen)


def check_component(seen: Traffic, component: str, kind: str) -> None:
    touched, commanded = differing(seen.received, SOUND.received), differing(seen.sent, SOUND.sent)
    assert touched <= ids_of(component)
    assert commanded <= commands_of(component, kind)
    state_only = kind in ("warning", "passive")
    assert bool(touched or commanded) is not state_only
    assert (seen.worst_state is not BusState.ACTIVE) is (kind in ("warning", "passive", "bus-off"))


def check_time(seen: Traffic) -> None:
    begin, end = round(BEGIN_S / PERIOD_S), round(END_S / PERIOD_S)
    for mine, sound in ((seen.received, SOUND.received), (seen.sent, SOUND.sent)):
        for identifier, frames in sound.items():
            assert [f for f in mine[identifier] if f[0] < begin] == [f for f in frames if f[0] < begin]
            assert [f for f in mine[identifier] if f[0] > end] == [f for f in frames if f[0] > end]


def check_commands(seen: Traffic) -> None:
    """Assert that every frame that leaves was sent before, and that frames leave in their order."""
    for identifier, frames in seen.sent.items():
        wanted = iter(seen.wanted[identifier])
        assert all(any(payload == command for _, command in wanted) for _, payload in frames)  # a subsequence
        when = {payload: tick for tick, payload in seen.wanted[identifier]}
        assert all(when[payload] <= tick for tick, payload in frames)


@pytest.mark.parametrize("component", [*JOINTS[2:], "bus.right"])
def test_a_failure_of_another_bus_is_not_seen(component: str) -> None:
    assert run(component, "off") == SOUND


def during(frames: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
    return [frame for frame in frames if BEGIN_S <= frame[0] * PERIOD_S < END_S]


def position(seen: Traffic) -> list[tuple[int, bytes]]:
    return during(seen.received[arbitration_id(0, codec.GET_ENCODER_ESTIMATES)])


TICKS = round((END_S - BEGIN_S) / PERIOD_S)


@pytest.mark.parametrize("component", ["left_sweep", "left_sweep.position"])
def test_a_stuck_signal_stands_still_while_messages_keep_coming(component: str) -> None:
    frames = position(seen_in(component, "stuck"))
    assert len(frames) == TICKS and len({data for _, data in frames}) == 1


@pytest.mark.parametrize("component", ["left_sweep", "left_sweep.position", "bus.left"])
def test_a_signal_is_off_loses_about_half_or_is_whole_in_order_late_and_stamped_when_it_came(component: str) -> None:
    assert position(seen_in(component, "off")) == []
    assert 0.35 * TICKS < len(position(seen_in(component, "intermittent"))) < 0.65 * TICKS
    seen = seen_in(component, "slow")
    frames, sound = (each.received[arbitration_id(0, codec.GET_ENCODER_ESTIMATES)] for each in (seen, SOUND))
    assert [data for _, data in frames] == [data for _, data in sound]
    delays = [late - tick for (late, _), (tick, _) in zip(frames, sound, strict=True)]
    assert max(delays) * PERIOD_S <= 0.02 + PERIOD_S and sum(delays) > 3 * TICKS
    assert all(stamp_s == now_s for now_s, stamp_s in seen.stamps_s)


@pytest.mark.parametrize("kind", ["off", "stuck", "garbage", "slow", "intermittent"])
def test_a_failing_voltage_of_a_damiao_leaves_its_answers_under_the_same_id_alone(kind: str) -> None:
    robot, port, failures = opened("left_sweep.voltage", kind, {"left_sweep": MitParameters("left", 1)})
    answer = Mit().announces(1)
    voltage = answer._replace(data=mit.encode_register(1, mit.READ, SUPPLY_V, FLOAT.pack(24.0)))
    values: list[bytes] = []
    for tick in range(100):
        failures.update(tick * PERIOD_S)
        robot.send(voltage)
        robot.send(answer)
        received = [frame.data for frame in port.receive()]
        received.remove(answer.data)
        values += received
    assert {data[:4] for data in values} <= {voltage.data[:4]}
    assert (len(values) < 100) is (kind in ("off", "slow", "intermittent"))
    assert (set(values) <= {voltage.data}) is (kind != "garbage")


def test_garbage_is_of_every_sort() -> None:
    payloads = [data for _, data in position(seen_in("left_sweep.position", "garbage"))]
    assert {len(data) for data in payloads} >= {0, 1, 4, 7, 8}
    turns = [codec.GET_ENCODER_ESTIMATES.decode(data)[0] for data in payloads if len(data) == 8]
    assert any(math.isnan(value) for value in turns) and any(math.isinf(value) for value in turns)
    assert any(1e30 < abs(value) < math.inf for value in turns) and any(0.0 < abs(value) < 2.0 for value in turns)


def error_reports(kind: str, message: codec.Message) -> set[tuple[int, int]]:
    """Return the first two values of each message: error flags, and the axis state or the reason of the disarming."""
    frames = during(seen_in("left_sweep.error", kind).received[arbitration_id(0, message)])
    return {message.decode(data)[:2] for _, data in frames}


@pytest.mark.parametrize(
    ("kind", "message", "reported"),
    [
        ("off", codec.HEARTBEAT, {(0, AxisState.IDLE)}),
        ("off", codec.GET_ERROR, {(0, 0)}),
        ("stuck", codec.HEARTBEAT, {(0x20, AxisState.IDLE)}),  # a gate driver fault
        ("stuck", codec.GET_ERROR, {(0x20, 0x20)}),
        ("intermittent", codec.HEARTBEAT, {(0, AxisState.CLOSED_LOOP), (0x20, AxisState.IDLE)}),
    ],
)
def test_a_drive_can_report_an_error_or_leave_closed_loop(
    kind: str, message: codec.Message, reported: set[tuple[int, int]]
) -> None:
    assert error_reports(kind, message) == reported


def test_random_errors_are_never_none_and_leave_the_state_unchanged() -> None:
    flags, states = zip(*error_reports("garbage", codec.HEARTBEAT), strict=True)
    assert len(set(flags)) > 10 and all(flags)
    assert set(states) == {AxisState.CLOSED_LOOP}


def test_a_malformed_heartbeat_of_a_drive_with_an_error_stays_malformed() -> None:
    robot, port, _ = opened("left_sweep.error", "stuck")
    robot.send(Frame(arbitration_id(0, codec.HEARTBEAT), b"\1"))
    (frame,) = port.receive()
    with pytest.raises(MalformedMessageError):
        codec.HEARTBEAT.decode(frame.data)


@pytest.mark.parametrize(
    ("kind", "refused", "state", "error_frames"),
    [
        ("off", "Network is down", BusState.ACTIVE, 0),
        ("stuck", "No buffer space", BusState.ACTIVE, 0),
        ("bus-off", "Network is down", BusState.OFF, TICKS),
        ("warning", "", BusState.WARNING, TICKS),
        ("passive", "", BusState.PASSIVE, TICKS),
    ],
)
def test_a_failing_bus_counts_refused_frames_and_shows_its_state(
    kind: str, refused: str, state: BusState, error_frames: int
) -> None:
    seen = seen_in("bus.left", kind)
    assert seen.failed_sends == (2 * TICKS if refused else 0)
    assert refused in seen.last_send_error and ("on purpose" in seen.last_send_error) == bool(refused)
    assert (seen.worst_state, seen.error_frames) == (state, error_frames)
    assert kind != "stuck" or seen.received == SOUND.received  # a full transmit queue still receives


def test_a_bus_full_of_garbage_adds_random_frames_and_leaves_commands_unchanged() -> None:
    seen = seen_in("bus.left", "garbage")
    assert len(seen.received) > 50 and seen.sent == SOUND.sent


def test_frames_of_unknown_ids_and_other_formats_suffer_only_from_failures_of_the_bus() -> None:
    foreign = [
        Frame(arbitration_id(9, codec.GET_IQ), b"\0" * 8),
        Frame(arbitration_id(0, codec.GET_IQ), b"\0" * 8, is_extended=True),
    ]
    for component, passed in (("left_sweep", foreign), ("bus.left", [])):
        robot, port, _ = opened(component, "off")
        for frame in foreign:
            robot.send(frame)
        assert list(port.receive()) == passed


def test_the_trouble_of_the_wrapped_port_shows_through() -> None:
    inner = MockPort(MockBus())
    inner.full, inner.error_frames, inner.state = True, 4, BusState.PASSIVE
    _, port, failures = opened("pose", "off", inner=inner)
    failures.end_all()
    port.send(Frame(1))
    assert (port.failed_sends, port.error_frames, port.state) == (1, 4, BusState.PASSIVE)
    assert port.last_send_error == inner.last_send_error != ""
    failures.begin("bus.left", "warning", 0.0)
    port.receive()
    assert (port.error_frames, port.state) == (5, BusState.PASSIVE)  # the worse of both


def test_late_commands_arrive_at_once_and_in_order_when_all_failures_are_ended() -> None:
    """A disarm that follows them is not delayed."""
    robot, port, failures = opened("left_sweep.command", "slow")
    frames = [Frame(arbitration_id(0, codec.SET_INPUT_TORQUE), bytes([number] * 4)) for number in range(3)]
    for frame in frames[:2]:
        port.send(frame)
    assert robot.receive() == []
    failures.end_all()
    port.send(frames[2])
    assert robot.receive() == frames
