"""Writes the keys, liveliness tokens and attachments of rmw_zenoh, the ROS 2 middleware on Zenoh.

The formats are those of its sources (liveliness_utils.cpp, attachment_helpers.cpp). A message or a call has the key
`<domain>/<topic>/<type>/<hash>`. A liveliness token, whose names have `%` for `/`, makes a node, a publisher or a
service visible to `ros2 topic list`. A key with another hash is another topic: a computer with another definition of
a message sees the topic and receives nothing. Humble knows no hashes and has a constant in their place.
"""

import struct
from typing import NamedTuple

NO_HASH = "TypeHashNotSupported"
TOKENS = "@ros2_lv/**"
QOS = "::,10:,:,:,,"  # reliable, volatile, the last 10 are kept; what is empty is rmw_zenoh's default
NODE, PUBLISHER, SUBSCRIBER, SERVICE, CLIENT = "NN", "MP", "MS", "SS", "SC"
PEERS = {PUBLISHER: SUBSCRIBER, SERVICE: CLIENT}
ATTACHMENT = struct.Struct("<qqB16s")  # sequence number, time in ns, length of the id, id of the sender
GID_BYTES = 16


class Endpoint(NamedTuple):
    """A publisher, subscriber, service or client of a node, or the node itself, whose kind is NODE."""

    domain: int
    node: str  # with its namespace, such as /mud1/mudskipper
    kind: str
    name: str = ""  # of the topic or service, with its namespace
    type_name: str = ""  # such as std_srvs/srv/Trigger
    type_hash: str = ""

    @property
    def key(self) -> str:
        return f"{self.domain}{self.name}/{_dds(self.type_name)}/{self.type_hash}"

    def token(self, session: str, number: int) -> str:
        """Return the token of the endpoint with this number in a Zenoh session."""
        namespace, _, node = self.node.rpartition("/")
        names = f"%/{_mangled(namespace or '/')}/{node}"
        token = f"@ros2_lv/{self.domain}/{session}/0/{number}/{self.kind}/{names}"
        if self.kind == NODE:
            return token
        return f"{token}/{_mangled(self.name)}/{_dds(self.type_name)}/{self.type_hash}/{QOS}"


def read_token(token: str) -> Endpoint | None:
    """Return the endpoint of a token, or None where it has another form."""
    parts = [part.replace("%", "/") for part in token.split("/")]
    if len(parts) not in (9, 13) or not parts[1].isdecimal():
        return None
    node = f"{parts[7].rstrip('/')}/{parts[8]}"
    if len(parts) == 9:
        return Endpoint(int(parts[1]), node, parts[5])
    type_name = parts[10].replace("::dds_", "").replace("::", "/").removesuffix("_")
    return Endpoint(int(parts[1]), node, parts[5], name=parts[9], type_name=type_name, type_hash=parts[11])


def _dds(type_name: str) -> str:
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def _mangled(name: str) -> str:
    return name.replace("/", "%")
