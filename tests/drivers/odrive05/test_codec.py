"""The bytes of firmware 0.5, against bytes written down by hand, ODrive's published DBC, and its firmware's source."""

from pathlib import Path
from random import Random
from struct import pack, unpack
from typing import Any

import cantools
import odrive_can
import pytest

from drivers.can.frames import MalformedMessageError
from drivers.odrive import codec
from drivers.odrive.codec import AxisState, Message, arbitration_id
from drivers.odrive05 import codec as codec05

DBC: Any = cantools.database.load_file(Path(odrive_can.__file__).parent / "dbc" / "odrive-cansimple-0.5.6.dbc")
OWN = {name: value for name, value in vars(codec05).items() if isinstance(value, Message)}
SHARED = {  # of both firmwares, and used with firmware 0.5
    name: getattr(codec, name)
    for name in (
        *("SET_AXIS_STATE", "GET_ENCODER_ESTIMATES", "SET_CONTROLLER_MODE", "SET_INPUT_TORQUE"),
        *("SET_LIMITS", "GET_IQ", "GET_BUS_VOLTAGE_CURRENT", "SET_VEL_GAINS"),
    )
}
MESSAGES = OWN | SHARED
RANDOM_MESSAGES = 100_000
GOLDEN: list[tuple[str, tuple[float, ...], int, str]] = [  # of node 3
    ("HEARTBEAT", (0x01020304, 8, 1, 0, 0x81), 0x061, "04 03 02 01 08 01 00 81"),
    ("GET_MOTOR_ERROR", (0x0800000008,), 0x063, "08 00 00 00 08 00 00 00"),
    ("GET_ENCODER_ERROR", (0x200,), 0x064, "00 02 00 00 00 00 00 00"),
    ("GET_ENCODER_COUNT", (-2, 8190), 0x06A, "fe ff ff ff fe 1f 00 00"),
    ("CLEAR_ERRORS", (), 0x078, ""),
    ("GET_CONTROLLER_ERROR", (1,), 0x07D, "01 00 00 00 00 00 00 00"),
]


def in_dbc(name: str, node_id: int = 0) -> Any:
    return DBC.get_message_by_name(f"Axis{node_id}_{name.title()}")


def random_value(signal: Any, random: Random) -> float:
    if signal.is_float:
        value: float = unpack("<f", pack("<f", random.uniform(-1.0, 1.0) * 10.0 ** random.randint(-30, 30)))[0]
        return value
    return random.getrandbits(int(signal.length))


def values_of(name: str, theirs: dict[str, Any]) -> tuple[Any, ...]:
    """Returns our values of a message from the DBC's, which has single bits of a heartbeat, and unsigned counts."""
    if name == "HEARTBEAT":
        flags = [theirs[f"{part}_Error_Flag"] for part in ("Motor", "Encoder", "Controller")]
        done = codec05.TRAJECTORY_DONE * theirs["Trajectory_Done_Flag"]
        return theirs["Axis_Error"], theirs["Axis_State"], flags[0], flags[1], flags[2] | done
    if name == "GET_ENCODER_COUNT":
        return unpack("<ii", pack("<II", theirs["Shadow_Count"], theirs["Count_in_CPR"]))
    return tuple(theirs[signal.name] for signal in in_dbc(name).signals)


def test_every_message_has_golden_bytes() -> None:
    assert [name for name, *_ in GOLDEN] == list(OWN)


@pytest.mark.parametrize(("name", "values", "identifier", "golden"), GOLDEN)
def test_messages_have_these_bytes(name: str, values: tuple[float, ...], identifier: int, golden: str) -> None:
    assert arbitration_id(3, OWN[name]) == identifier
    assert OWN[name].encode(*values) == bytes.fromhex(golden)
    assert OWN[name].decode(bytes.fromhex(golden)) == values


def test_the_dbc_encodes_and_decodes_every_random_message_as_we_do() -> None:
    random, names = Random(5), list(MESSAGES)
    for _ in range(RANDOM_MESSAGES):
        name = random.choice(names)
        theirs, ours = in_dbc(name), MESSAGES[name]
        signals = {signal.name: random_value(signal, random) for signal in theirs.signals}
        values = values_of(name, signals)
        encoded = theirs.encode(signals)
        data = ours.encode(*values)
        assert data.ljust(theirs.length, b"\0") == encoded  # the DBC pads every short command; drives take both
        assert ours.decode(encoded[: len(data)]) == values
        assert theirs.decode(data.ljust(theirs.length, b"\0"), decode_choices=False) == signals


@pytest.mark.parametrize("name", MESSAGES)
def test_the_dbc_gives_every_node_the_same_ids(name: str) -> None:
    assert [in_dbc(name, node).frame_id for node in range(8)] == [
        arbitration_id(node, MESSAGES[name]) for node in range(8)
    ]


def test_the_commands_are_the_messages_that_only_a_master_sends() -> None:
    to_drive = {theirs.frame_id for theirs in DBC.messages if theirs.senders == ["Master"] and theirs.frame_id < 32}
    assert to_drive | {codec.ESTOP.command} == codec05.COMMANDS  # the DBC lacks the emergency stop, not the firmware


@pytest.mark.parametrize(
    ("message", "signal", "names"),
    [
        ("HEARTBEAT", "Axis_Error", codec05.AXIS_ERRORS),
        ("GET_MOTOR_ERROR", "Motor_Error", codec05.MOTOR_ERRORS),
        ("GET_ENCODER_ERROR", "Encoder_Error", codec05.ENCODER_ERRORS),
        ("GET_CONTROLLER_ERROR", "Controller_Error", codec05.CONTROLLER_ERRORS),
    ],
)
def test_the_dbc_knows_the_same_error_flags(message: str, signal: str, names: dict[int, str]) -> None:
    assert set(in_dbc(message).get_signal_by_name(signal).choices) - {0} == set(names)


def test_the_dbc_knows_the_same_axis_states() -> None:
    states = in_dbc("HEARTBEAT").get_signal_by_name("Axis_State").choices
    assert {state: str(states[state]).removesuffix("_CONTROL") for state in AxisState} == {
        state: state.name for state in AxisState
    }


@pytest.mark.parametrize("name", OWN)
def test_bytes_of_another_length_are_malformed(name: str) -> None:
    golden = next(bytes.fromhex(golden) for own, _, _, golden in GOLDEN if own == name)
    for size in {*range(10)} - {len(golden)}:
        with pytest.raises(MalformedMessageError, match=f"with {size} bytes"):
            OWN[name].decode(bytes(size))


@pytest.mark.parametrize(
    ("parts", "flags"),
    [
        ((0x800, 0, 0, 0), 0x800),
        ((0, 1, 0, 0), 0x40),
        ((0, 0, 1, 0), 0x100),
        ((0, 0, 0, 1), 0x200),
        ((0x1, 1, 1, 0x81), 0x341),
        ((0, 0, 0, 0x80), 0),  # a trajectory is done
        ((0, 0xFE, 0xFE, 0x7E), 0),  # bits without a meaning
    ],
)
def test_an_error_of_a_part_is_one_of_the_axis_even_where_the_axis_reports_none(
    parts: tuple[int, int, int, int], flags: int
) -> None:
    assert codec05.axis_flags(*parts) == flags


def test_errors_name_the_part_and_its_errors() -> None:
    assert codec05.errors_text(0, 8, 4, 1) == ""  # of before: the axis says that nothing has failed
    assert codec05.errors_text(0x840, 0, 0, 0) == "motor failed, watchdog expired"
    named = codec05.errors_text(0x340, 0x800000008, 0x40, 0x1)
    assert named == (
        "motor failed, encoder failed, controller failed; motor: gate driver fault, unbalanced phases;"
        " encoder: SPI time-out; controller: overspeed"
    )
    assert "unknown flag 0x2" in codec05.errors_text(0x2, 0, 0, 0)
