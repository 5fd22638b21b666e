"""Motion capture over UDP on the loopback; the tests pass the time, so nothing waits."""

import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from errno import EAFNOSUPPORT
from math import isfinite
from typing import Any

import pytest

from control.records import BodyPose
from drivers.pose.natnet_client import NatNetClient
from drivers.pose.natnet_codec import NatNetVersion
from drivers.pose.natnet_port import NatNetPort
from drivers.pose.natnet_sockets import Direction, NatNetParameters
from drivers.pose.pose_port import STALE_S, PoseSourceError
from simulation.devices.natnet_server import (
    LOOPBACK,
    FrameTimes,
    NatNetServer,
    RecordedPose,
    encode_frame,
)

FRAME_S, TICK_S = 1.0 / 120.0, 1.0 / 380.0
ALONG_X = (1.0, 0.0, 0.0)
SPEED_M_S = 0.1
GROUP = "239.255.42.99"
NOTHING: Mapping[str, Any] = {}
NOT_SEEN = "motion capture does not see the body."


def moving(duration_s: float, start_s: float = 0.0) -> list[RecordedPose]:
    """Return the poses of a body that moves along x at SPEED_M_S."""
    return [
        RecordedPose(start_s + frame * FRAME_S, (SPEED_M_S * (start_s + frame * FRAME_S), 0.2, 1.0))
        for frame in range(round(duration_s / FRAME_S))
    ]


class Laboratory:
    """A server and a port that are stepped once in a tick of the loop."""

    def __init__(self, server: NatNetServer, client: NatNetClient, origin_m: float) -> None:
        self.server, self.client, self.port = server, client, NatNetPort(client, origin_m)
        self.now_s = -0.5

    def run(self, until_s: float) -> list[tuple[float, BodyPose]]:
        seen = []
        while self.now_s < until_s:
            self.server.step(self.now_s)
            seen.append((self.now_s, self.port.read(self.now_s)))
            self.now_s += TICK_S
        return seen


Open = Callable[..., Laboratory]


@pytest.fixture
def open_laboratory() -> Iterator[Open]:
    with ExitStack() as stack:

        def opened(
            poses: Sequence[RecordedPose] = (),
            listening: Mapping[str, Any] = NOTHING,
            direction: Direction = ALONG_X,
            origin_m: float = 0.0,
            **serving: Any,
        ) -> Laboratory:
            """Open a laboratory; `listening` changes the port's parameters, `serving` the server's."""
            server = NatNetServer(poses, **serving)
            stack.callback(server.close)
            parameters = NatNetParameters(server=LOOPBACK, group="", command_port=server.address[1])
            client = NatNetClient(replace(parameters, **listening), direction)
            stack.callback(client.close)
            return Laboratory(server, client, origin_m)

        yield opened


def known(seen: Sequence[tuple[float, BodyPose]]) -> list[tuple[float, BodyPose]]:
    return [(now_s, body) for now_s, body in seen if isfinite(body.x_m)]


@pytest.mark.parametrize("version", [(2, 7), (3, 0), (4, 0), (4, 1)])
def test_the_present_position_is_stamped_with_the_time_of_exposure(
    open_laboratory: Open, version: tuple[int, int]
) -> None:
    """From 3.0 on a frame contains its own age; before, the age has to be configured."""
    configured = {"latency_s": 0.012} if version < (3, 0) else NOTHING
    lab = open_laboratory(moving(2.0), configured, version=NatNetVersion(*version), latency_s=0.012, crowded=True)
    reported = known(lab.run(2.0))[40:]
    assert len(reported) > 600
    for now_s, body in reported:
        assert body.x_m == pytest.approx(SPEED_M_S * now_s, abs=3e-4)
        assert 0.0119 < now_s - body.stamp_s < 0.012 + FRAME_S + TICK_S
    assert lab.port.report()[1:] == (lab.port.poses, 0, 1, "", "")


def test_x_goes_along_a_direction_from_an_origin(open_laboratory: Open) -> None:
    poses = [RecordedPose(frame * FRAME_S, (9.0 + 1e-5 * frame, -1.0, 1.0)) for frame in range(20)]
    lab = open_laboratory(poses, direction=(0.0, -0.6, 0.8), origin_m=0.5)
    assert lab.run(0.15)[-1][1].x_m == pytest.approx(1.4 - 0.5)


@pytest.mark.parametrize("selection", [{"body": "mudskipper"}, {"body_id": 7}, {}])
def test_a_body_is_found_by_name_or_by_id(open_laboratory: Open, selection: dict[str, Any]) -> None:
    assert known(open_laboratory(moving(0.3), selection, identity=7).run(0.3))


@pytest.mark.parametrize(
    ("listening", "serving", "trouble"),
    [
        ({"body": "other_body"}, {}, "there is no rigid body named 'other_body'."),
        ({"body_id": 6}, {}, NOT_SEEN),
        ({}, {"version": NatNetVersion(2, 5)}, "Motive speaks NatNet 2.5; 2.6 to 4 are supported."),
        ({"version": "3.0"}, {"version": NatNetVersion(4, 1), "crowded": True}, "all NatNet frames are malformed."),
    ],
)
def test_the_reason_why_no_pose_arrives_is_reported(
    open_laboratory: Open, listening: dict[str, Any], serving: dict[str, Any], trouble: str
) -> None:
    lab = open_laboratory(moving(0.5), listening, identity=7, **serving)
    assert not known(lab.run(0.4))
    assert lab.port.report().trouble == trouble


@pytest.mark.parametrize("announced", [True, False])
def test_a_body_that_is_defined_again_is_found_by_its_name(open_laboratory: Open, announced: bool) -> None:
    """The frame that announces it may be lost, as where motion capture was restarted with other bodies."""
    lab = open_laboratory(moving(5.0), {"body": "mudskipper"}, identity=7)
    assert known(lab.run(1.0))
    if announced:
        lab.server.change_model(8)
    lab.server.identity = 8
    assert not known(lab.run(1.2)[30:])
    assert known(lab.run(2.9 if announced else 4.9))


def open_multicast(
    open_laboratory: Open,
    poses: Sequence[RecordedPose],
    version: str,
    listening: Mapping[str, Any] = NOTHING,
    **serving: Any,
) -> Laboratory:
    """Open a laboratory whose server sends to a group from the start, and answers requests as well."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind((LOOPBACK, 0))
        number = free.getsockname()[1]
    common = {"group": GROUP, "port": number, "interface": "lo", "version": version}
    return open_laboratory(poses, {**common, **listening}, target=(GROUP, number), **serving)


@pytest.mark.parametrize("interface", ["lo", LOOPBACK])
def test_multicast_frames_are_heard_on_an_interface_without_a_server_to_ask(
    open_laboratory: Open, interface: str
) -> None:
    lab = open_multicast(open_laboratory, moving(0.5), "4.1", {"server": "", "interface": interface})
    assert len(known(lab.run(0.5))) > 100


def test_a_multicast_server_that_restarts_with_another_version_is_understood(open_laboratory: Open) -> None:
    """Its frames are heard before it can be asked, and cannot be decoded."""
    lab = open_multicast(open_laboratory, [*moving(1.0), *moving(4.0, 4.0)], "", crowded=True)
    assert known(lab.run(1.0))
    lab.server.answers = False
    lab.run(4.0)
    lab.server.answers, lab.server.version = True, NatNetVersion(3, 0)
    assert known(lab.run(7.0))
    assert lab.port.report().source.startswith("NatNet 3.0")


def test_a_server_that_starts_later_is_asked_for_its_clock_though_the_version_is_configured(
    open_laboratory: Open,
) -> None:
    lab = open_multicast(open_laboratory, moving(5.0, 2.0), "4.1", latency_s=0.03)
    lab.server.answers = False
    lab.run(2.02)
    lab.server.answers = True
    now_s, body = known(lab.run(6.0))[-1]
    assert body.x_m == pytest.approx(SPEED_M_S * now_s, abs=3e-4)
    assert now_s - body.stamp_s >= 0.03


def test_frames_wait_until_their_version_is_known(open_laboratory: Open) -> None:
    unanswered = open_laboratory(moving(4.0))
    unanswered.server.answers = False
    unanswered.run(0.0)
    assert "no NatNet frame arrives from 127.0.0.1" in unanswered.port.report().trouble
    unanswered.server.answers = True  # asked again a second later
    assert known(unanswered.run(2.0))


def test_a_body_that_is_not_tracked_is_none_and_is_counted(open_laboratory: Open) -> None:
    poses = [pose._replace(tracked=pose.time_s < 0.5) for pose in moving(1.0)]
    lab = open_laboratory(poses)
    assert known(lab.run(0.5 + STALE_S))
    assert not known(lab.run(0.99)[5:])
    assert lab.port.report().trouble == NOT_SEEN
    assert lab.port.report().lost == pytest.approx(59, abs=2)


def test_the_same_digits_again_and_again_are_no_pose(open_laboratory: Open) -> None:
    """Some bridges repeat them while the capture is lost."""
    poses = [pose if pose.time_s < 0.5 else pose._replace(position_m=(0.05, 0.2, 1.0)) for pose in moving(1.0)]
    lab = open_laboratory(poses)
    lab.run(0.5 + 2.0 * STALE_S)
    assert not known(lab.run(0.99))
    assert "frozen" in lab.port.report().trouble


def test_a_pose_after_a_gap_or_a_jump_is_accepted_when_a_second_one_follows(open_laboratory: Open) -> None:
    lab = open_laboratory([*moving(0.5), RecordedPose(0.75, (0.3, 0.2, 1.0)), *moving(0.5, 1.5)])
    lab.run(0.74)
    assert not known(lab.run(1.5))  # the pose of 0.75 s had jumped
    reported = known(lab.run(1.9))
    assert reported and all(body.x_m == pytest.approx(SPEED_M_S * now_s, abs=1e-3) for now_s, body in reported)
    assert reported[0][0] >= 1.5 + FRAME_S


def test_a_jump_leaves_a_read_without_a_pose_though_the_next_position_arrives_with_it(open_laboratory: Open) -> None:
    lab = open_laboratory([pose._replace(position_m=(0.1, 0.2, 1.0 + pose.time_s)) for pose in moving(0.5)])
    lab.run(0.6)
    for time_s, x_m in ((0.6, 0.1), (0.61, 0.1), (0.62, 0.5), (0.621, 0.5), (0.63, 0.5)):
        lab.server.add(RecordedPose(time_s, (x_m, 0.2, 2.0 + time_s)))
    seen = [lab.port.read(now_s) for now_s in (0.611, 0.622, 0.631) if lab.server.step(now_s)]
    assert [round(body.x_m, 6) for body in seen if isfinite(body.x_m)] == [0.1, 0.5]
    assert not isfinite(seen[1].x_m)


def test_malformed_packets_are_counted_and_cost_nothing_else(open_laboratory: Open) -> None:
    lab = open_laboratory(moving(0.5))
    assert known(lab.run(0.4))
    frame = encode_frame(lab.server.version, 1, [], FrameTimes(0.0, 0, 0, 0))
    for packet in (b"", b"\x07", frame[:-30], b"\x07\x00\xff\xff" + bytes(20)):
        lab.server.send_packet(packet)
    seen = lab.run(0.41)
    assert known(seen) == seen and lab.client.malformed == 4


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"interface": "nothing0"}, "NatNet cannot be received from 127.0.0.1 on nothing0: No such device"),
        ({"interface": "192.0.2.1"}, "on 192.0.2.1: Cannot assign requested address"),
        ({"group": GROUP, "interface": "nothing0"}, f"in group {GROUP}, port 1511 on nothing0: No such device"),
    ],
)
def test_a_missing_interface_is_reported(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(PoseSourceError, match=message):
        NatNetClient(replace(NatNetParameters(server=LOOPBACK, group=""), **changes), ALONG_X)


def test_a_service_without_network_access_is_reported_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(family: int, kind: int) -> None:
        raise OSError(EAFNOSUPPORT, "Address family not supported by protocol")

    monkeypatch.setattr(socket, "socket", refused)
    with pytest.raises(PoseSourceError, match="add AF_INET to RestrictAddressFamilies="):
        NatNetClient(NatNetParameters(server=LOOPBACK), ALONG_X)


def test_frames_of_another_computer_than_the_server_are_reported(open_laboratory: Open) -> None:
    laboratory = open_laboratory(moving(1.0))
    laboratory.run(0.3)
    laboratory.client.parameters = replace(laboratory.client.parameters, server="127.0.0.9")
    laboratory.run(0.3 + 2.0 * STALE_S)
    report = laboratory.port.report()
    assert report.malformed > 0
    assert report.trouble == f"packets arrive from {LOOPBACK}, and none from 127.0.0.9."
    assert "pose.natnet.server" in report.what_to_do
