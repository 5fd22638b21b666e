"""The 16 bytes of a frame, against bytes written down by hand and python-can's own SocketCAN code."""

import can
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame
from hypothesis import given
from hypothesis import strategies as st

from drivers.can.frames import Frame, decode_frame, encode_frame

GOLDEN = [
    (Frame(0x123, b"\x11\x22"), "23010000 02 000000 1122000000000000"),
    (Frame(0x7FF, bytes(range(8))), "ff070000 08 000000 0001020304050607"),
    (Frame(0x18FEF100, b"\xff", is_extended=True), "00f1fe98 01 000000 ff00000000000000"),
    (Frame(0x009, is_remote=True), "09000040 00 000000 0000000000000000"),
    (Frame(0x040, bytes(8), is_error=True), "40000020 08 000000 0000000000000000"),
    (Frame(0x123, b"\x11\x22", is_fd=True), "23010000 02 04 0000 1122" + 62 * "00"),
    (
        Frame(0x18FEF100, bytes(range(64)), is_extended=True, is_fd=True, bit_rate_switch=True),
        "00f1fe98 40 05 0000" + bytes(range(64)).hex(),
    ),
]


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    is_remote, is_error, is_extended = draw(st.booleans()), draw(st.booleans()), draw(st.booleans())
    identifier = draw(st.integers(0, 0x1FFFFFFF if is_extended or is_error else 0x7FF))
    data = b"" if is_remote else draw(st.binary(max_size=8))
    if draw(st.booleans()):
        fd_data = bytes(draw(st.sampled_from([*range(9), 12, 16, 20, 24, 32, 48, 64])))
        identifier = draw(st.integers(0, 0x1FFFFFFF if is_extended else 0x7FF))
        return Frame(identifier, fd_data, is_extended=is_extended, is_fd=True, bit_rate_switch=draw(st.booleans()))
    return Frame(identifier, data, is_remote, is_error, is_extended)


@pytest.mark.parametrize(("frame", "golden"), GOLDEN)
def test_frames_have_the_bytes_of_linux(frame: Frame, golden: str) -> None:
    assert encode_frame(frame) == bytes.fromhex(golden)
    assert decode_frame(bytes.fromhex(golden)) == frame


@given(frames())
def test_python_can_builds_the_same_bytes_and_they_return_the_frame(frame: Frame) -> None:
    message = can.Message(
        arbitration_id=frame.arbitration_id,
        data=frame.data,
        is_remote_frame=frame.is_remote,
        is_error_frame=frame.is_error,
        is_extended_id=frame.is_extended,
        is_fd=frame.is_fd,
        bitrate_switch=frame.bit_rate_switch,
    )
    theirs = bytearray(build_can_frame(message))
    theirs[7] = 0  # python-can sets len8_dlc, which matters only for frames with 8 bytes
    theirs[5] |= 4 * frame.is_fd  # python-can leaves out CANFD_FDF, which the kernel sets
    assert encode_frame(frame) == theirs
    assert decode_frame(bytes(theirs)) == frame


def test_a_remote_frame_that_asks_for_eight_bytes_carries_none() -> None:
    assert decode_frame(bytes.fromhex("09000040 08 000000 0000000000000000")) == Frame(0x009, is_remote=True)


@pytest.mark.parametrize(
    ("frame", "named"),
    [
        (Frame(0x800), "0x800"),
        (Frame(-1), "-0x1"),
        (Frame(0x20000000, is_extended=True), "0x20000000"),
        (Frame(1, bytes(9)), "not 9"),
        (Frame(1, b"\xab", is_remote=True), "ab"),
        (Frame(1, bytes(9), is_fd=True), "9 bytes"),
        (Frame(1, bytes(65), is_fd=True), "65 bytes"),
        (Frame(1, is_remote=True, is_fd=True), "remote"),
        (Frame(1, is_error=True, is_fd=True), "error"),
        (Frame(1, bit_rate_switch=True), "bit rate"),
    ],
)
def test_a_frame_that_does_not_exist_on_can_is_refused_by_value(frame: Frame, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        encode_frame(frame)


@pytest.mark.parametrize("size", [0, 15, 17, 71, 73])
def test_a_wrong_number_of_bytes_is_refused(size: int) -> None:
    with pytest.raises(ValueError, match=rf"not {size}\."):
        decode_frame(bytes(size))
