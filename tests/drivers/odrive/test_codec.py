"""The bytes of ODrive's messages, against bytes written down by hand and ODrive's published DBC for firmware 0.6."""

from pathlib import Path
from typing import Any

import cantools
import odrive_can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.can.frames import MalformedMessageError
from drivers.odrive import codec as odrive_codec
from drivers.odrive.codec import ERROR_NAMES, AxisState, Message, arbitration_id, error_text

DBC: Any = cantools.database.load_file(Path(odrive_can.__file__).parent / "dbc" / "odrive-cansimple-0.6.10.dbc")
MESSAGES = {name: value for name, value in vars(odrive_codec).items() if isinstance(value, Message)}
WHOLE = [name for name in MESSAGES if name not in ("RX_SDO", "TX_SDO", "ADDRESS")]  # more bytes may follow in those
GOLDEN: list[tuple[str, tuple[float, ...], int, str]] = [  # of node 3
    ("GET_VERSION", (2, 4, 4, 58, 0, 6, 11, 0), 0x060, "02 04 04 3a 00 06 0b 00"),
    ("HEARTBEAT", (0x01020304, 8, 5, 1), 0x061, "04 03 02 01 08 05 01 00"),
    ("ESTOP", (), 0x062, ""),
    ("GET_ERROR", (0x01000000, 0x02000000), 0x063, "00 00 00 01 00 00 00 02"),
    ("RX_SDO", (0, 0x01F4, 0), 0x064, "00 f4 01 00"),
    ("TX_SDO", (0, 0x01F4, 0), 0x065, "00 f4 01 00"),
    ("ADDRESS", (3, 0x33333539, 0x3841), 0x066, "03 39 35 33 33 41 38"),
    ("SET_AXIS_STATE", (8,), 0x067, "08 00 00 00"),
    ("GET_ENCODER_ESTIMATES", (1.5, -2.0), 0x069, "00 00 c0 3f 00 00 00 c0"),
    ("SET_CONTROLLER_MODE", (1, 7), 0x06B, "01 00 00 00 07 00 00 00"),
    ("SET_INPUT_TORQUE", (0.25,), 0x06E, "00 00 80 3e"),
    ("SET_LIMITS", (10.0, 12.0), 0x06F, "00 00 20 41 00 00 40 41"),
    ("GET_IQ", (-0.5, 0.75), 0x074, "00 00 00 bf 00 00 40 3f"),
    ("GET_TEMPERATURE", (30.0, 45.5), 0x075, "00 00 f0 41 00 00 36 42"),
    ("REBOOT", (1,), 0x076, "01"),
    ("GET_BUS_VOLTAGE_CURRENT", (24.0, 1.25), 0x077, "00 00 c0 41 00 00 a0 3f"),
    ("SET_VEL_GAINS", (0.5, -2.0), 0x07B, "00 00 00 3f 00 00 00 c0"),
    ("CLEAR_ERRORS", (1,), 0x078, "01"),
]


def in_dbc(name: str, node_id: int = 0) -> Any:
    return DBC.get_message_by_name(f"Axis{node_id}_{name.title()}")


def any_value(signal: Any) -> st.SearchStrategy[float]:
    if signal.is_float:
        return st.floats(width=32, allow_nan=False, allow_infinity=False)
    return st.integers(0, 2**signal.length - 1)


def test_every_message_has_golden_bytes() -> None:
    assert [name for name, *_ in GOLDEN] == list(MESSAGES)


@pytest.mark.parametrize(("name", "values", "identifier", "golden"), GOLDEN)
def test_messages_have_these_bytes(name: str, values: tuple[float, ...], identifier: int, golden: str) -> None:
    message = MESSAGES[name]
    assert arbitration_id(3, message) == identifier
    assert message.encode(*values) == bytes.fromhex(golden)
    assert message.decode(bytes.fromhex(golden)) == values


@pytest.mark.parametrize("name", WHOLE)
@given(data=st.data())
def test_the_dbc_decodes_what_we_encode_and_back(name: str, data: st.DataObject) -> None:
    theirs = in_dbc(name)
    values = tuple(data.draw(any_value(signal)) for signal in theirs.signals)
    ours = MESSAGES[name].encode(*values)
    padded = ours.ljust(theirs.length, b"\0")  # the DBC pads every short message to 8 bytes; drives take both
    decoded = theirs.decode(padded, decode_choices=False)
    assert tuple(decoded[signal.name] for signal in theirs.signals) == values
    encoded = theirs.encode({signal.name: value for signal, value in zip(theirs.signals, values, strict=True)})
    assert encoded == padded
    assert MESSAGES[name].decode(encoded[: len(ours)]) == values


@pytest.mark.parametrize("name", ["RxSdo", "TxSdo"])
def test_the_dbc_finds_the_number_of_a_parameter_where_we_put_it(name: str) -> None:
    theirs = DBC.get_message_by_name(f"Axis0_{name}")
    ours = odrive_codec.RX_SDO.encode(odrive_codec.SDO_READ, 0x1234, 0) + odrive_codec.SDO_FLOAT.pack(0.1)
    decoded = theirs.decode(ours, decode_choices=False)
    assert (decoded["Endpoint_ID"], decoded["Value"]) == (0x1234, 0x3DCCCCCD)
    assert theirs.frame_id == (odrive_codec.RX_SDO if name == "RxSdo" else odrive_codec.TX_SDO).command
    assert odrive_codec.decode_sdo(ours) == (0x1234, bytes.fromhex("cd cc cc 3d"))


@pytest.mark.parametrize("node_id", [0, 3, 0x3F])
@given(serial=st.integers(0, 2**48 - 1))
def test_the_dbc_and_we_decode_the_same_serial_number(node_id: int, serial: int) -> None:
    encoded = in_dbc("ADDRESS").encode({"Node_ID": node_id, "Serial_Number": serial})
    assert odrive_codec.decode_serial_number(encoded) == f"{serial:012x}"  # with the connection id of 0.6.11
    assert odrive_codec.decode_serial_number(encoded[:7]) == f"{serial:012x}"


@given(data=st.binary(max_size=16))
def test_only_seven_or_eight_bytes_are_a_serial_number(data: bytes) -> None:
    if len(data) not in (7, 8):
        with pytest.raises(MalformedMessageError):
            odrive_codec.decode_serial_number(data)


def test_the_commands_are_the_messages_that_only_a_master_sends() -> None:
    to_drive = {theirs.frame_id for theirs in DBC.messages if theirs.senders == ["Master"] and theirs.frame_id < 32}
    assert to_drive - {odrive_codec.RX_SDO.command} == odrive_codec.COMMANDS


@pytest.mark.parametrize("name", WHOLE)
def test_the_dbc_gives_every_node_the_same_ids(name: str) -> None:
    assert [in_dbc(name, node).frame_id for node in range(8)] == [
        arbitration_id(node, MESSAGES[name]) for node in range(8)
    ]


def test_the_dbc_knows_the_same_error_flags_and_axis_states() -> None:
    in_0_6_11_only = {0x20000}  # requested current too high; the DBC is of 0.6.10
    flags = set(in_dbc("GET_ERROR").get_signal_by_name("Active_Errors").choices)
    assert set(ERROR_NAMES) - in_0_6_11_only == flags - {0}
    states = in_dbc("HEARTBEAT").get_signal_by_name("Axis_State").choices
    assert {state: str(states[state]).removesuffix("_CONTROL") for state in AxisState} == {
        state: state.name for state in AxisState
    }


@pytest.mark.parametrize("name", WHOLE)
@given(data=st.binary(max_size=64))
def test_any_bytes_of_another_length_are_malformed(name: str, data: bytes) -> None:
    golden = next(bytes.fromhex(golden) for golden_name, _, _, golden in GOLDEN if golden_name == name)
    if len(data) == len(golden):
        assert len(MESSAGES[name].decode(data)) == len(in_dbc(name).signals)
    else:
        with pytest.raises(MalformedMessageError, match=f"with {len(data)} bytes"):
            MESSAGES[name].decode(data)


@pytest.mark.parametrize("size", [0, 1, 4, 9])
def test_an_answer_without_the_value_of_a_parameter_is_malformed(size: int) -> None:
    with pytest.raises(MalformedMessageError, match=f"with {size} bytes"):
        odrive_codec.decode_sdo(bytes(size))


def test_a_parameter_s_value_is_a_flag_or_a_number_and_may_be_padded() -> None:
    assert [odrive_codec.decode_sdo_flag(bytes([flag, 0, 0, 9])) for flag in (0, 1)] == [False, True]
    assert odrive_codec.decode_sdo_float(bytes.fromhex("00 00 00 3f")) == 0.5
    for value in (b"\2", b"\xff"):
        with pytest.raises(MalformedMessageError):
            odrive_codec.decode_sdo_flag(value)
    with pytest.raises(MalformedMessageError):
        odrive_codec.decode_sdo_float(bytes(3))


def test_errors_are_named_and_unknown_flags_appear_as_numbers() -> None:
    assert error_text(0) == ""
    assert error_text(0x1000000) == "watchdog expired"
    assert error_text(0x200 | 0x80 | 0x20000000) == "bus under-voltage, unknown flag 0x20000080"
