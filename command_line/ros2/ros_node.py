"""Makes this program a node of ROS 2 for computers with rmw_zenoh, through a Zenoh router: it publishes and serves.

The session is a client of the router. Zenoh drops messages that a slow router or viewer does not take, and connects
again by itself. Each service has a thread of its own, so that none waits for another. What other nodes see wrongly is
noticed by their tokens: another domain, or another definition of a message.
"""

import json
import re
import time
from collections.abc import Callable
from hashlib import blake2b
from itertools import count
from typing import Any

import zenoh

from command_line.errors import usage_error
from command_line.ros2.rmw_names import (
    ATTACHMENT,
    GID_BYTES,
    NO_HASH,
    NODE,
    PEERS,
    PUBLISHER,
    SERVICE,
    TOKENS,
    Endpoint,
    read_token,
)
from command_line.screen import complain
from firmware_host.log.schema import TEXT, Field, RowKind

TRIGGER = "std_srvs/srv/Trigger"
TRIGGER_HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"  # of ROS 2 Jazzy's std_srvs
RESPONSE = RowKind("", f"{TRIGGER}_Response", (Field("success", "bool"), Field("message", TEXT)))
ADDRESS = re.compile(r"(tcp|udp|tls|quic|ws)/.+:\d+([?#].*)?|(serial|unixsock-stream|unixpipe|vsock)/.+")  # Zenoh's
RETRY_S = 1.0  # between two attempts to reach the router
Act = Callable[[], tuple[bool, str]]  # returns whether it succeeded, and a message


def connect(router: str) -> zenoh.Session:
    """Return a session with the router, once it answers. Raises CommandError for a malformed address."""
    configuration = zenoh.Config()
    try:
        configuration.insert_json5("connect/endpoints", json.dumps([router]))
        is_address = bool(ADDRESS.fullmatch(router))
    except zenoh.ZError:
        is_address = False
    if not is_address:
        raise usage_error(f"--router {router}: must be such as tcp/192.168.1.5:7447")
    configuration.insert_json5("mode", '"client"')
    configuration.insert_json5("scouting/multicast/enabled", "false")
    complained = False
    while True:
        try:
            return zenoh.open(configuration)
        except zenoh.ZError:
            if not complained:
                complain(
                    f"no Zenoh router answers on {router}; 'ros2 run rmw_zenoh_cpp rmw_zenohd' is one; waiting for it"
                )
            complained = True
            time.sleep(RETRY_S)


class RosPublisher:
    """Owns a publisher of Zenoh, and numbers its messages."""

    def __init__(self, publisher: zenoh.Publisher, token: str) -> None:
        self._publisher = publisher
        self._gid = blake2b(token.encode(), digest_size=GID_BYTES).digest()  # any one does that is unique
        self._numbers = count(1)

    @property
    def is_wanted(self) -> bool:
        """Return whether there is a subscriber."""
        status: Any = self._publisher.matching_status  # its stub says bool
        return bool(status.matching)

    def publish(self, content: bytes) -> None:
        attachment = ATTACHMENT.pack(next(self._numbers), time.time_ns(), GID_BYTES, self._gid)
        self._publisher.put(content, attachment=attachment)


class RosNode:
    """Owns what the node has in a session: its publishers, services and tokens."""

    def __init__(self, session: zenoh.Session, domain: int, namespace: str, hashed: bool) -> None:
        self._session, self._hashed = session, hashed
        self._node = Endpoint(domain, f"{namespace}/mudskipper", NODE)
        self._namespace = namespace
        self._numbers = count()
        self._own: dict[str, Endpoint] = {}
        self._said: set[str] = set()
        self._alive: list[Any] = []  # tokens and services, which end when nothing refers to them
        self._declare_token(self._node)

    def watch_others(self) -> None:
        """Say what keeps other nodes from this one; call it after all is declared, as some are there already."""
        self._alive.append(self._session.liveliness().declare_subscriber(TOKENS, self._check_other, history=True))

    def publisher(self, topic: str, type_name: str, type_hash: str) -> RosPublisher:
        endpoint = self._endpoint(PUBLISHER, self._namespace + topic, type_name, type_hash)
        publisher = self._session.declare_publisher(endpoint.key, congestion_control=zenoh.CongestionControl.DROP)
        return RosPublisher(publisher, self._declare_token(endpoint))

    def serve(self, name: str, act: Act) -> None:
        """Serve a std_srvs/Trigger as a service of the node's own name."""
        endpoint = self._endpoint(SERVICE, f"{self._node.node}/{name}", TRIGGER, TRIGGER_HASH)

        def answer(query: zenoh.Query) -> None:
            with query:
                request = query.attachment.to_bytes() if query.attachment else b""
                if len(request) != ATTACHMENT.size:
                    query.reply_err(f"{name}: the request has no attachment of rmw_zenoh")
                    return
                number, _, _, gid = ATTACHMENT.unpack(request)
                response = RESPONSE.encode(*act())
                attachment = ATTACHMENT.pack(number, time.time_ns(), GID_BYTES, gid)
                query.reply(endpoint.key, response, attachment=attachment)

        self._alive.append(self._session.declare_queryable(endpoint.key, answer, complete=True))
        self._declare_token(endpoint)

    def _endpoint(self, kind: str, name: str, type_name: str, type_hash: str) -> Endpoint:
        hashed = type_hash if self._hashed else NO_HASH
        endpoint = self._node._replace(kind=kind, name=name, type_name=type_name, type_hash=hashed)
        self._own[name] = endpoint
        return endpoint

    def _declare_token(self, endpoint: Endpoint) -> str:
        token = endpoint.token(str(self._session.info.zid()), next(self._numbers))
        self._alive.append(self._session.liveliness().declare_token(token))
        return token

    def _check_other(self, sample: zenoh.Sample) -> None:
        other = read_token(str(sample.key_expr))
        if other is None or sample.kind != zenoh.SampleKind.PUT:
            return
        problem = _why_not_met(self._own.get(other.name, self._node), other)
        if problem and problem not in self._said:
            self._said.add(problem)
            complain(problem)


def _why_not_met(own: Endpoint, other: Endpoint) -> str:
    if other.domain != own.domain:
        return (
            f"{other.node} is in domain {other.domain}, this program in {own.domain}, so they do not meet:"
            f" use --domain {other.domain}, or ROS_DOMAIN_ID={own.domain} there"
        )
    if other.kind == PEERS.get(own.kind) and other[-2:] != own[-2:]:
        return (
            f"{other.node} uses {own.name} as {other.type_name} {other.type_hash}, this program as {own.type_name}"
            f" {own.type_hash}, so they do not meet: see --distribution, or install this version's mudskipper_msgs"
        )
    return ""
