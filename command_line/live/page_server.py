"""Serves one self-contained page with a live view of the robot, and a STOP that goes through the socket's rights.

The page receives server-sent events (HTML standard, section 9.2), ten a second, each with the newest tick and every
stride and event since the last one. Every viewer has a queue of its own; one that hangs loses its own messages alone.
Every request must come from this server's own page (own_page.py); a stop needs a header too that no other site's page
can send. The page asks over the same path whether a stop would reach the robot, and says so in red where it would not.
"""

import json
import queue
import threading
import time
from collections.abc import Collection, Sequence
from contextlib import closing, suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from command_line.live.own_page import own_page
from command_line.operation.confirmation import TORQUE_UNKNOWN, end_motion
from command_line.watch.orders import send_order
from control.geometry import FlipperGeometry
from control.modes import Mode
from control.records import TWO_FLIPPERS, Phase
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import parse_configuration
from firmware_host.log.rows import STRIDE, TICK
from firmware_host.operator.reports import known
from firmware_host.sockets.rpc import LONGEST_REQUEST
from operator_client.live_rows import LiveRow, LiveRows
from operator_client.status_client import CallRefusedError, NoDaemonError, NotPermittedError, StatusClient

PAGE = Path(__file__).with_name("page.html")
INTERVAL_S = 0.1  # between two messages
QUEUED = 20  # messages for one viewer: two seconds
RECENT_STRIDES = 60  # that a new viewer gets
LONGEST_TEXT = 1 << 20  # bytes that are read of a note
STOP_HEADER = "X-Mudskipper"
ANSWER_S = 2.0  # of the daemon, whether it would take a stop


class Viewer:
    """Owns the messages that one browser has not fetched."""

    def __init__(self) -> None:
        self._messages: queue.Queue[str] = queue.Queue(QUEUED)
        self.lost = 0

    def put(self, message: dict[str, Any]) -> None:
        try:
            self._messages.put_nowait(json.dumps(message | {"lost": message.get("lost", 0) + self.lost}))
        except queue.Full:
            self.lost += 1

    def get(self, timeout_s: float) -> str | None:
        try:
            return self._messages.get(timeout=timeout_s)
        except queue.Empty:
            return None


class Viewers:
    """Owns the viewers and what a new one has to know."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._viewers: list[Viewer] = []
        self._robot: dict[str, Any] = {}
        self._strides: list[dict[str, Any]] = []
        self._tick: dict[str, Any] | None = None

    def begin(self, robot: dict[str, Any]) -> None:
        with self._lock:
            self._robot, self._strides, self._tick = robot, [], None
            self._send({"robot": robot})

    def add(self) -> Viewer:
        viewer = Viewer()
        with self._lock:
            known_robot = {"robot": self._robot} if self._robot else {}
            viewer.put(known_robot | {"tick": self._tick, "strides": self._strides})
            self._viewers.append(viewer)
        return viewer

    def remove(self, viewer: Viewer) -> None:
        with self._lock:
            self._viewers.remove(viewer)

    def publish(self, message: dict[str, Any]) -> None:
        with self._lock:
            self._tick = message["tick"] or self._tick
            self._strides = [*self._strides, *message["strides"]][-RECENT_STRIDES:]
            self._send(message)

    def _send(self, message: dict[str, Any]) -> None:
        for viewer in self._viewers:
            viewer.put(message)


class PageServer:
    """Owns the HTTP server and the rows of the interval under way. Raises OSError if the port is in use."""

    def __init__(self, host: str, port: int, status_socket: Path, names: Collection[str] = ()) -> None:
        """`names` are those under which browsers may open the page, in addition to the address."""
        self._viewers = Viewers()
        self._server = _Server(host, port, self._viewers, status_socket, names)
        self.port = int(self._server.server_address[1])
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        self._reset()

    def _reset(self) -> None:
        self._tick: dict[str, Any] | None = None
        self._sent_s = 0.0
        self._strides: list[dict[str, Any]] = []
        self._events: list[dict[str, Any]] = []

    def begin(self, source: LiveRows) -> None:
        self._reset()
        self._viewers.begin(robot_facts(source.configuration_text))

    def take(self, rows: Sequence[LiveRow], lost: int) -> None:
        newest = None
        for row in rows:
            if row.kind.topic == TICK.topic:
                newest = row
            else:
                kept = self._strides if row.kind.topic == STRIDE.topic else self._events
                wall_s = row.stamp_s + time.time() - time.monotonic()  # this program runs on the robot's computer
                kept.append(finite(row.values | {"wall_s": wall_s}))
        if newest is not None:
            self._tick = finite(newest.values)
        if self._tick is not None and not 0.0 <= self._tick["stamp_s"] - self._sent_s < INTERVAL_S:
            self._sent_s = self._tick["stamp_s"]
            self._viewers.publish({"tick": self._tick, "strides": self._strides, "events": self._events, "lost": lost})
            self._strides, self._events = [], []

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


def robot_facts(configuration_text: str) -> dict[str, Any]:
    """Return what the page draws the robot with; the defaults where the configuration is of another version."""
    name, geometry, rig = "", FlipperGeometry(), TWO_FLIPPERS
    with suppress(ConfigurationError):
        configuration = parse_configuration(configuration_text)
        name, geometry, rig = configuration.robot.name, configuration.geometry, configuration.rig
    return {
        "name": name,
        "flippers": rig.flippers,
        "flipper_length_m": geometry.flipper_length_m,
        "drop_m": geometry.drop_m,
        "axis_height_m": geometry.axis_height_m,
        "modes": {int(mode): mode.name.lower() for mode in Mode},
        "phases": {int(phase): phase.name.lower() for phase in Phase},
    }


def finite(values: dict[str, Any]) -> dict[str, Any]:
    """Replace numbers that JSON does not have by None."""
    return {name: _finite(value) for name, value in values.items()}


def _finite(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_finite(each) for each in value]
    return known(value) if isinstance(value, float) else value


class _Server(ThreadingHTTPServer):
    """What the handlers of all requests share."""

    daemon_threads = True  # a browser that hangs must not keep this program

    def __init__(self, host: str, port: int, viewers: Viewers, status_socket: Path, names: Collection[str]) -> None:
        self.own_page, self.viewers, self.status_socket = own_page(host, names), viewers, status_socket
        super().__init__((host, port), _Handler)


class _Handler(BaseHTTPRequestHandler):
    """Answers one connection."""

    protocol_version = "HTTP/1.1"
    server: _Server

    def do_GET(self) -> None:
        if refused := self._refusal():
            self._answer(HTTPStatus.FORBIDDEN, refused.encode())
        elif self.path == "/":
            self._answer(HTTPStatus.OK, PAGE.read_bytes(), "text/html; charset=utf-8")
        elif self.path == "/rows":
            self._stream()
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"there is no such page")

    def do_POST(self) -> None:
        refused = self._refusal()
        if not refused and self.headers.get(STOP_HEADER) != "stop":
            refused = f"a request without {STOP_HEADER}: only the page of this server may stop the robot"
        if refused:
            self._answer(HTTPStatus.FORBIDDEN, f"{TORQUE_UNKNOWN}. stop refused: {refused}".encode())
        elif self.path == "/stop":
            self._answer(*stop_robot(self.server.status_socket))
        elif self.path == "/can_stop":
            self._answer(*can_stop(self.server.status_socket))
        elif self.path in ("/note", "/mark"):
            self._answer(
                HTTPStatus.OK, send_order(self.server.status_socket, self.path[1:], text=self._text()).encode()
            )
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"there is no such page")

    def _text(self) -> str:
        """Return the text that was sent; one that the daemon would refuse as too long is cut off."""
        length = self.headers.get("Content-Length", "")
        self.close_connection = True  # what is not read would be taken for the next request
        text = self.rfile.read(min(int(length), LONGEST_TEXT) if length.isdecimal() else 0)
        return text[:LONGEST_REQUEST].decode(errors="replace")

    def _refusal(self) -> str | None:
        """Return why this request is none of the own page; every route asks."""
        arrived_at = str(self.connection.getsockname()[0])
        return self.server.own_page.refusal(self.headers.get("Host", ""), self.headers.get("Origin"), arrived_at)

    def _stream(self) -> None:
        viewer = self.server.viewers.add()
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")
        self.end_headers()
        with suppress(OSError):  # the browser has gone
            while True:
                message = viewer.get(1.0)
                self.wfile.write(f"data: {message}\n\n".encode() if message else b": no rows\n\n")
        self.server.viewers.remove(viewer)

    def _answer(self, status: HTTPStatus, content: bytes, kind: str = "text/plain; charset=utf-8") -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Content-Security-Policy", "default-src 'self' 'unsafe-inline'; frame-ancestors 'none'")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not printed."""


def stop_robot(status_socket: Path) -> tuple[HTTPStatus, bytes]:
    """Wait until every drive has confirmed the stop, as `mudskipper stop` does."""
    answer = end_motion(status_socket, "stop")
    return HTTPStatus.OK if answer.confirmed else HTTPStatus.CONFLICT, answer.text.encode()


def can_stop(status_socket: Path) -> tuple[HTTPStatus, bytes]:
    """Answer whether the daemon would take a stop and show that the drives have confirmed it."""
    try:
        with closing(StatusClient(status_socket, ANSWER_S)) as client:
            client.call("status")
    except (CallRefusedError, NotPermittedError, NoDaemonError) as problem:
        return HTTPStatus.CONFLICT, str(problem).encode()
    return HTTPStatus.OK, b"ready"
