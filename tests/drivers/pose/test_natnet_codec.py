"""NatNet packets: bytes written down by hand, ours as read by an independent decoder, and garbage."""

import math
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from natnet import DataFrame
from natnet.packet_buffer import PacketBuffer
from natnet.server_info import ServerInfo as NatnetServerInfo
from natnet.version import Version

from drivers.pose.natnet_codec import (
    CONNECT,
    FRAME,
    KEEP_ALIVE,
    FrameLayout,
    MalformedPacketError,
    MotionFrame,
    NatNetVersion,
    decode_bodies,
    decode_server_info,
    encode_request,
    message_of,
)
from simulation.devices.natnet_server import (
    TICKS_PER_S,
    FrameTimes,
    RecordedPose,
    encode_frame,
    encode_message,
    encode_models,
    encode_rigid_body,
    encode_server_info,
)

VERSIONS = [NatNetVersion(*v) for v in ((2, 6), (2, 7), (2, 9), (2, 11), (3, 0), (3, 1), (4, 0), (4, 1), (4, 2))]
each_version = pytest.mark.parametrize("version", VERSIONS, ids=str)
TIMES = FrameTimes(12.5, 125_000_000, 125_000_100, 125_080_000)

GOLDEN_2_10 = """
    0700 a600
    2a000000                                            frame 42
    01000000 616c6c00 01000000 0000803f 0000803f 0000803f   one marker set, all, of one marker
    01000000 00000040 00000040 00000040                 one other marker
    01000000                                            one rigid body
    03000000 0000803f 00000040 0000c0bf                 id 3 at 1, 2, -1.5
    00000000 00000000 00000000 0000803f                 upright
    01000000 00000000 00000000 00000000 09000000 0000003f   one marker, at 0, 0, 0, id 9, size 0.5
    0ad7a33b 0100                                       mean error 5 mm, tracked
    00000000                                            no skeleton
    01000000 07000000 00000000 00000000 00000000 0000003f 0000   one labelled marker
    00000000                                            no force plate
    00000000 00000000 0000000000002940 0000             time code, 12.5 s, flags
    00000000
"""
GOLDEN_3_0 = """
    0700 9a00
    2a000000
    00000000
    00000000
    02000000                                            two rigid bodies
    03000000 0000803f 00000040 0000c0bf 00000000 00000000 00000000 0000803f 0ad7a33b 0100
    04000000 00000000 00000000 00000000 00000000 00000000 00000000 0000803f 00000000 0000
    00000000                                            no skeleton
    00000000                                            no labelled marker
    00000000                                            no force plate
    00000000                                            no device
    00000000 00000000 0000000000002940
    4059730700000000 a459730700000000 c091740700000000    125000000, 125000100, 125080000 ticks
    0200 00000000                                       the models have changed
"""
GOLDEN_4_1 = """
    0700 b400
    2a000000
    01000000 08000000 616c6c00 00000000                 one marker set of 8 bytes
    01000000 0c000000 00000040 00000040 00000040        one other marker of 12 bytes
    01000000 26000000                                   one rigid body of 38 bytes
    03000000 0000803f 00000040 0000c0bf 00000000 00000000 00000000 0000803f 0ad7a33b 0000
    00000000 00000000                                   no skeleton
    00000000 00000000                                   no asset
    00000000 00000000                                   no labelled marker
    00000000 00000000                                   no force plate
    00000000 00000000                                   no device
    00000000 00000000 0000000000002940
    4059730700000000 a459730700000000 c091740700000000
    00000000 00000000                                   precision time
    0000 00000000
"""


def written(text: str) -> bytes:
    """Return the bytes of hexadecimal lines, each of which has its meaning after three blanks."""
    return bytes.fromhex("".join(line.strip().split("   ")[0] for line in text.strip().splitlines()))


def frame_of(version: tuple[int, int], packet: bytes, identity: int = 0) -> MotionFrame:
    return FrameLayout(NatNetVersion(*version)).decode_frame(packet, identity)


def packet_of(version: NatNetVersion, crowded: bool = True) -> bytes:
    bodies = [encode_rigid_body(version, 8, RecordedPose(0.0, (8.0, 8.0, 8.0)))]
    bodies.append(encode_rigid_body(version, 5, RecordedPose(0.0, (0.1, -0.2, 0.3), (0.5, -0.5, 0.5, 0.5))))
    return encode_frame(version, 77, bodies, TIMES, crowded)


@pytest.mark.parametrize(("version", "text"), [((2, 10), GOLDEN_2_10), ((3, 0), GOLDEN_3_0), ((4, 1), GOLDEN_4_1)])
def test_frames_have_these_bytes(version: tuple[int, int], text: str) -> None:
    packet = written(text)
    assert message_of(packet) == FRAME
    frame = frame_of(version, packet)
    assert frame.body is not None
    assert frame.software_s == 12.5
    assert (frame.body.identity, frame.body.position_m) == (3, (1.0, 2.0, -1.5))
    assert frame.body.quaternion == (0.0, 0.0, 0.0, 1.0)
    assert frame.body.tracked == (version < (4, 0))
    assert (frame.exposed_ticks, frame.sent_ticks) == ((0, 0) if version < (3, 0) else (125_000_000, 125_080_000))
    assert frame.models_changed == (version == (3, 0))


def test_a_server_s_information_has_these_bytes() -> None:
    payload = b"Motive".ljust(256, b"\0") + bytes.fromhex("03010200 04010000 8096980000000000 e705 01 efff2a63")
    reported = decode_server_info(b"\x01\x00" + len(payload).to_bytes(2, "little") + payload)
    assert reported == ("Motive", (4, 1), 10_000_000)
    old = b"Arena".ljust(256, b"\0") + bytes.fromhex("01000000 02070000")
    assert decode_server_info(encode_message(1, old)) == ("Arena", (2, 7), 0)


def test_requests_have_these_bytes() -> None:
    assert encode_request(CONNECT) == bytes.fromhex("0000 0500 50696e6700")
    assert encode_request(KEEP_ALIVE) == bytes.fromhex("0a00 0000")


@each_version
def test_the_body_that_was_asked_for_is_found_in_any_crowd(version: NatNetVersion) -> None:
    for crowded in (False, True):
        packet = packet_of(version, crowded)
        first, fifth, none = (frame_of(version, packet, identity).body for identity in (0, 5, 6))
        assert first is not None and first.identity == 8
        assert fifth is not None and fifth.position_m == pytest.approx((0.1, -0.2, 0.3), rel=1e-6)
        assert fifth.tracked and none is None


@each_version
def test_an_independent_decoder_reads_the_same(version: NatNetVersion) -> None:
    """The package natnet has another author. It leaves the precision time of 4.1 unread, at the very end."""
    packet = packet_of(version)
    read: Any = DataFrame.read_from_buffer(PacketBuffer(packet[4:]), Version(*version))
    ours = frame_of(version, packet, 5)
    assert ours.body is not None
    theirs = read.rigid_bodies[1]
    assert (theirs.id_num, theirs.pos, theirs.rot) == ours.body[:3]
    assert (theirs.tracking_valid, read.suffix.timestamp) == (ours.body.tracked, ours.software_s)
    assert (read.suffix.stamp_camera_mid_exposure or 0) == ours.exposed_ticks
    assert (read.suffix.stamp_transmit or 0) == ours.sent_ticks
    assert len(read.labeled_markers) == 4 and len(read.skeletons) == 1


@each_version
def test_an_independent_decoder_reads_the_same_of_a_server(version: NatNetVersion) -> None:
    packet = encode_server_info(version)
    theirs: Any = NatnetServerInfo.read_from_buffer(PacketBuffer(packet[4:]), Version(*version))
    ours = decode_server_info(packet)
    assert (theirs.application_name, theirs.nat_net_protocol_version) == (ours.name, Version(*ours.version, 0, 0))
    assert ours.ticks_per_s == (TICKS_PER_S if version >= (3, 0) else 0)


@each_version
def test_bodies_are_found_by_name(version: NatNetVersion) -> None:
    packet = encode_models(version, [("arm", 9), ("mudskipper", 3)])
    assert decode_bodies(packet, version) == {"arm": 9, "mudskipper": 3}
    with pytest.raises(MalformedPacketError):
        decode_bodies(packet[: packet.index(b"mudskipper") + 3], version)


@each_version
def test_a_packet_that_is_cut_off_anywhere_is_malformed(version: NatNetVersion) -> None:
    """The header shows it, and so does the content where the header was made to fit, unless only the final zero is
    missing.
    """
    whole = packet_of(version)
    layout = FrameLayout(version)
    for length in range(len(whole)):
        with pytest.raises(MalformedPacketError):
            message_of(whole[:length])
    for length in range(4, len(whole) - 4):
        with pytest.raises(MalformedPacketError):
            layout.decode_frame(whole[:length], 5)


@given(st.binary(max_size=400), st.sampled_from(VERSIONS))
@example(b"\x07\x00\x04\x00" + bytes(4) + b"\xff\xff\xff\x7f" * 60, NatNetVersion(3, 0))
@example(b"\x07\x00\x04\x00" + bytes(12) + b"\xff\xff\xff\x7f" + bytes(60), NatNetVersion(4, 0))
@example(b"\x07\x00\x04\x00" + b"\xff" * 300, NatNetVersion(4, 1))
def test_garbage_raises_only_the_error_for_malformed_packets(data: bytes, version: NatNetVersion) -> None:
    for decode in (
        message_of,
        decode_server_info,
        lambda packet: FrameLayout(version).decode_frame(packet, 0),
        lambda packet: decode_bodies(packet, version),
    ):
        try:
            decode(data)
        except MalformedPacketError:
            continue


def test_a_body_whose_position_is_not_finite_is_not_tracked() -> None:
    version = NatNetVersion(3, 0)
    body = encode_rigid_body(version, 1, RecordedPose(0.0, (0.0, math.nan, 0.0)))
    frame = frame_of(version, encode_frame(version, 1, [body], TIMES))
    assert frame.body is not None and not frame.body.tracked
