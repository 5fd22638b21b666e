"""Plain Zenoh clients see the robot as rmw_zenoh shows one: rosbags decodes its messages, and its services answer."""

# ruff: noqa: E402 - without Zenoh there is nothing to import
import json
import socket
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from threading import Event
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

zenoh = pytest.importorskip("zenoh", reason="the extra 'ros2' is not installed")

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from command_line import exit_codes
from command_line.live.standard_messages import TOPICS
from command_line.ros2 import ros_node
from command_line.ros2.own_messages import LAPTOP_FILES
from command_line.ros2.rmw_names import ATTACHMENT, NO_HASH, PUBLISHER, SUBSCRIBER, Endpoint, read_token
from command_line.ros2.ros_audience import RosAudience
from command_line.ros2.ros_node import RosNode, connect
from firmware_host.log.rows import ROW_KINDS, STRIDE, TICK
from operator_client.live_rows import LiveRow, LiveRows
from tests.command_line.command_lines import failure
from tests.waiting import LONGEST_S, wait_until

OWN = {"/stride": "mudskipper_msgs/msg/Stride", "/mud_map": "mudskipper_msgs/msg/MudMap"}
MUD_MAP: list[dict[str, Any]] = [
    {"place_m": 0.025, "k_p": {"value": 1.5e6, "std_error": 4e4, "at_least": False}, "k_s": None, "k_e": None},
    {"place_m": 0.475, "k_p": None, "k_s": {"value": 3e5, "std_error": None, "at_least": True}, "k_e": None},
]
GID = bytes(range(16))


def types_of_ros() -> Any:
    """Return ROS 2 Jazzy's definitions, the response of a Trigger, and this project's messages as on a laptop."""
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg("bool success\nstring message\n", "std_srvs/msg/Trigger_Response"))
    for name in OWN.values():
        text = (LAPTOP_FILES / "msg" / f"{name.split('/')[-1]}.msg").read_text(encoding="utf-8")
        types.register(get_types_from_msg(text, name))
    return types


def free_address() -> str:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"tcp/127.0.0.1:{server.getsockname()[1]}"


@contextmanager
def router_on(address: str) -> Iterator[None]:
    configuration = zenoh.Config()
    configuration.insert_json5("mode", '"router"')
    configuration.insert_json5("scouting/multicast/enabled", "false")
    configuration.insert_json5("listen/endpoints", json.dumps([address]))
    with zenoh.open(configuration):
        yield


class Graph:
    """A router, the session of the robot's program, and that of another computer."""

    def __init__(self, own: Any, other: Any) -> None:
        self.own, self.other = own, other
        self.received: list[Any] = []
        self.tokens: list[str] = []
        self._subscriber = other.declare_subscriber("*/**", self.received.append)
        self._liveliness = other.liveliness().declare_subscriber(
            "@ros2_lv/**", lambda sample: self.tokens.append(str(sample.key_expr)), history=True
        )

    def endpoints(self) -> list[Endpoint]:
        return [endpoint for endpoint in map(read_token, self.tokens) if endpoint]

    def keys(self, services: int) -> dict[str, str]:
        """Wait for a node with so many services, and return their keys by name."""
        wait_until(lambda: len(self.endpoints()) == 1 + services)
        return {endpoint.name: endpoint.key for endpoint in self.endpoints() if endpoint.name}

    def ask(self, key: str, number: int, attachment: bytes | None = None) -> list[Any]:
        """Call a service as rmw_zenoh does."""
        attachment = ATTACHMENT.pack(number, 10**18, len(GID), GID) if attachment is None else attachment
        querier = self.other.declare_querier(
            key, target=zenoh.QueryTarget.ALL_COMPLETE, consolidation=zenoh.ConsolidationMode.NONE
        )
        return list(querier.get(payload=b"\x00\x01\x00\x00\x00", attachment=attachment))


@pytest.fixture
def graph() -> Iterator[Graph]:
    with ExitStack() as opened:
        address = free_address()
        opened.enter_context(router_on(address))
        own, other = (opened.enter_context(connect(address)) for _ in range(2))
        yield Graph(own, other)


def rows(number: int) -> list[LiveRow]:
    tick = TICK.encode_named(
        stamp_s=0.05 * number, tick=20 * number, angle_rad=(0.1, 0.2, 0.3, 0.4), force_z_n=(5.0, 6.0), body_x_m=0.7
    )
    stride = STRIDE.encode_named(stamp_s=0.05 * number, index=number, k_p=2e6)
    return [LiveRow(TICK, tick), LiveRow(STRIDE, stride)]


@pytest.mark.parametrize("hashed", [True, False], ids=["jazzy", "humble"])
def test_every_topic_is_seen_and_every_message_decoded_by_other_code(graph: Graph, hashed: bool) -> None:
    node = RosNode(graph.own, 7, "/mud1", hashed)
    audience = RosAudience(graph.own, node, lambda: MUD_MAP)
    audience.begin(cast(LiveRows, SimpleNamespace(kinds=list(ROW_KINDS), configuration_text="")))
    wanted = {f"/mud1{topic}": name for topic, name in (TOPICS | OWN).items()}
    number = 0
    while {str(sample.key_expr).split("/", 1)[1].rsplit("/", 2)[0] for sample in graph.received} != {
        name[1:] for name in wanted
    }:
        audience.take(rows(number), lost=0)
        number += 1
    types = types_of_ros()
    decoded = {}
    for sample in graph.received:
        topic = next(topic for topic in wanted if str(sample.key_expr).startswith(f"7{topic}/"))
        type_hash = types.hash_rihs01(wanted[topic]) if hashed else NO_HASH
        assert str(sample.key_expr) == Endpoint(7, "", PUBLISHER, topic, wanted[topic], type_hash).key
        decoded[topic] = types.deserialize_cdr(sample.payload.to_bytes(), wanted[topic])
        _, _, length, _ = ATTACHMENT.unpack(sample.attachment.to_bytes())
        assert length == len(GID)
    odometry = decoded["/mud1/odom"]
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    assert odometry.pose.pose.position.x == 0.7 and decoded["/mud1/stride"].k_p == 2e6
    assert np.array_equal(odometry.pose.covariance.reshape(6, 6), np.diag([0.0, *[1e6] * 5]))
    mud_map = decoded["/mud1/mud_map"]
    assert (mud_map.position_m.tolist(), mud_map.k_s_at_least.tolist()) == ([0.025, 0.475], [False, True])
    assert np.array_equal((mud_map.k_p, mud_map.k_s), [[1.5e6, np.nan], [np.nan, 3e5]], equal_nan=True)
    assert np.isnan([*mud_map.k_e, *mud_map.k_s_std_error]).all() and mud_map.k_p_std_error[0] == 4e4
    seen = {end.name: (end.node, end.type_name) for end in graph.endpoints() if end.kind == PUBLISHER}
    assert seen == {topic: ("/mud1/mudskipper", name) for topic, name in wanted.items()}


def test_the_messages_of_each_topic_are_numbered_from_one_for_their_subscribers(graph: Graph) -> None:
    publisher = RosNode(graph.own, 0, "", hashed=True).publisher("/joint_states", TOPICS["/joint_states"], "RIHS01_0")
    wait_until(lambda: publisher.is_wanted)
    for _ in range(3):
        publisher.publish(b"")
    wait_until(lambda: len(graph.received) == 3)
    attachments = [ATTACHMENT.unpack(sample.attachment.to_bytes()) for sample in graph.received]
    assert [number for number, *_ in attachments] == [1, 2, 3] and len({gid for *_, gid in attachments}) == 1


def test_a_service_answers_with_the_number_and_the_id_of_the_request(graph: Graph) -> None:
    node = RosNode(graph.own, 0, "", hashed=True)
    answers = {"stop": (True, "stopped"), "walk": (False, "the drives are idle")}
    for name, answer in answers.items():
        node.serve(name, lambda answer=answer: answer)  # type: ignore[misc]
    keys, types = graph.keys(2), types_of_ros()
    for number, (name, answer) in enumerate(answers.items()):
        (reply,) = graph.ask(keys[f"/mudskipper/{name}"], number)
        response = types.deserialize_cdr(reply.ok.payload.to_bytes(), "std_srvs/msg/Trigger_Response")
        assert (response.success, response.message) == answer
        own_number, _, _, gid = ATTACHMENT.unpack(reply.ok.attachment.to_bytes())
        assert (own_number, gid) == (number, GID)
    (reply,) = graph.ask(keys["/mudskipper/stop"], 1, attachment=b"too short")
    assert reply.ok is None and b"attachment" in reply.err.payload.to_bytes()


def test_a_service_that_takes_long_delays_no_other(graph: Graph) -> None:
    node, begun, ending = RosNode(graph.own, 0, "", hashed=True), Event(), Event()

    def stop() -> tuple[bool, str]:
        begun.set()
        return ending.wait(LONGEST_S), ""

    node.serve("stop", stop)
    node.serve("disarm", lambda: (True, ""))
    keys = graph.keys(2)
    with ThreadPoolExecutor() as calls:
        stopped = calls.submit(graph.ask, keys["/mudskipper/stop"], 1)
        assert begun.wait(LONGEST_S)
        assert graph.ask(keys["/mudskipper/disarm"], 2)[0].ok
        assert not stopped.done()
        ending.set()
        assert stopped.result()[0].ok


def test_nodes_that_do_not_meet_this_one_are_named_once(graph: Graph, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(ros_node, "complain", said.append)
    node = RosNode(graph.own, 0, "", hashed=True)
    node.publisher("/joint_states", TOPICS["/joint_states"], "RIHS01_1")
    viewer = Endpoint(0, "/rviz", SUBSCRIBER, "/joint_states", TOPICS["/joint_states"], "RIHS01_1")
    others = [
        viewer,
        viewer._replace(kind=PUBLISHER, type_hash="RIHS01_2", node="/other_robot"),
        viewer._replace(type_hash="RIHS01_2", node="/other_hash"),
        viewer._replace(type_name="std_msgs/msg/String", node="/other_type"),
        viewer._replace(domain=5, node="/other_domain"),
        viewer._replace(domain=5, node="/other_domain", name="/some"),
        viewer._replace(domain=6, node="/last"),
    ]
    tokens = []
    for number, each in enumerate(others):
        tokens.append(graph.other.liveliness().declare_token(each.token("abc", number)))
        if number == len(others) // 2:  # some are there before this node, others come later
            wait_until(lambda: len(graph.tokens) == 2 + len(tokens))
            node.watch_others()
    wait_until(lambda: any("/last" in problem for problem in said))
    assert sorted(problem.split()[0] for problem in said) == ["/last", "/other_domain", "/other_hash", "/other_type"]


def test_a_router_that_comes_later_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    address, said = free_address(), list[str]()
    monkeypatch.setattr(ros_node, "complain", said.append)
    with ExitStack() as opened:

        class Time:
            slept = 0

            def sleep(self, seconds: float) -> None:
                self.slept += 1
                if self.slept == 3:
                    opened.enter_context(router_on(address))

        monkeypatch.setattr(ros_node, "time", Time())
        with connect(address) as session:
            assert session.info.routers_zid()
    assert len(said) == 1 and address in said[0]


@pytest.mark.parametrize("address", ["nonsense", "tpc/localhost:7447", "tcp/localhost"])
def test_a_malformed_address_is_one_sentence(address: str) -> None:
    assert f"--router {address}" in failure("ros2", "--router", address, status=exit_codes.USAGE)
