"""Another client of rmw_zenoh writes the same keys, tokens and attachments."""

# ruff: noqa: E402 - without the oracle there is nothing to import
import pytest
from hypothesis import given
from hypothesis.strategies import text

pytest.importorskip("zenoh_ros2_sdk", reason="an oracle of the extra 'test'")

from zenoh_ros2_sdk.attachment import Attachment
from zenoh_ros2_sdk.entity import EndpointEntity, EntityKind, NodeEntity
from zenoh_ros2_sdk.keyexpr import endpoint_liveliness_keyexpr, node_liveliness_keyexpr, topic_keyexpr
from zenoh_ros2_sdk.qos import QosProfile
from zenoh_ros2_sdk.utils import compute_service_type_hash, ros2_to_dds_type

from command_line.ros2.rmw_names import (
    ATTACHMENT,
    CLIENT,
    GID_BYTES,
    NO_HASH,
    NODE,
    PUBLISHER,
    QOS,
    SERVICE,
    SUBSCRIBER,
    Endpoint,
    read_token,
)
from command_line.ros2.ros_node import TRIGGER, TRIGGER_HASH

SESSION = "139d81acf91167d985ce34ff1cbe435a"
HASHES = ("RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e", NO_HASH)
TYPES = {PUBLISHER: "sensor_msgs/msg/JointState", SERVICE: "std_srvs/srv/Trigger"}


@pytest.mark.parametrize("type_hash", HASHES)
@pytest.mark.parametrize("namespace", ["", "/mud1", "/lab/mud1"])
@pytest.mark.parametrize("kind", [NODE, PUBLISHER, SUBSCRIBER, SERVICE, CLIENT])
def test_another_client_writes_the_same_keys_and_tokens(kind: str, namespace: str, type_hash: str) -> None:
    own = Endpoint(7, f"{namespace}/mudskipper", kind)
    node = NodeEntity(7, SESSION, 0, "mudskipper", namespace or "/")
    if kind == NODE:
        assert own.token(SESSION, 0) == node_liveliness_keyexpr(node)
    else:
        name, type_name = f"{namespace}/some/name", TYPES[PUBLISHER if kind in (PUBLISHER, SUBSCRIBER) else SERVICE]
        own = own._replace(name=name, type_name=type_name, type_hash=type_hash)
        dds = ros2_to_dds_type(type_name)
        other = EndpointEntity(node, 3, EntityKind(kind), name, dds, type_hash, QosProfile().encode())
        assert own.key == topic_keyexpr(7, name, dds, type_hash)
        assert own.token(SESSION, 3) == endpoint_liveliness_keyexpr(other)
    assert read_token(own.token(SESSION, 3)) == own


def test_another_client_reads_the_quality_of_service_as_reliable_and_volatile() -> None:
    assert QosProfile.decode(QOS) == QosProfile()


def test_another_client_reads_and_writes_the_same_attachment() -> None:
    gid = bytes(range(GID_BYTES))
    assert ATTACHMENT.pack(5, 10**18, GID_BYTES, gid) == Attachment(5, 10**18, gid).to_bytes()


def test_another_client_computes_the_same_hash_of_the_service() -> None:
    response = "bool success\nstring message\n"
    assert compute_service_type_hash(TRIGGER, "# empty", response_definition=response) == TRIGGER_HASH


@given(text("@ros2_lv/%0S: "))
def test_a_malformed_token_is_no_error(token: str) -> None:
    read_token(token)
    assert read_token("@ros2_lv/0/zid/0/0/NN/%/%") is None
