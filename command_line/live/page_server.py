"""Serves one self-contained page with a live view of the robot, and a STOP that goes through the socket's rights.

The page asks several times a second for what is new since it asked last: ticks, ten a second, strides and events. It
holds no connection open, because a browser opens six to one server: with a stream for each page, the seventh page would
show nothing and stop nothing. Every request must come from this server's own page (own_page.py); a stop needs a header
too that no other site's page can send. The page asks for the daemon's status over the same path as a stop, and says in
red where a stop would not reach the robot.
"""

import json
import re
import sys
import threading
import time
from collections import deque
from collections.abc import Collection, Sequence
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socket import AF_INET, AF_INET6
from typing import Any

from command_line import exit_codes
from command_line.live.own_page import own_page
from command_line.operation.confirmation import TORQUE_UNKNOWN, end_motion, send_call
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
INTERVAL_S = 0.1  # between two ticks
KEPT = {"ticks": 200, "strides": 60, "events": 200}  # that a new page gets: ticks of 20 s
LONGEST_TEXT = 1 << 20  # bytes that are read of a note
STOP_HEADER = "X-Mudskipper"
ANSWER_S = 2.0  # of the daemon, whether it would take a stop
ROWS = re.compile(r"/rows\?after=(-?\d{1,18})")
STATUS_S = 0.8  # for which a status serves all pages
IDLE_S = 30.0  # of a connection, which ends then: a phone that is out of reach closes none

Values = dict[str, Any]


class RecentRows:
    """Owns what pages may still ask for. A row has the number of its interval, which a page names when it asks."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._robot: Values = {}
        self._rows: dict[str, deque[tuple[int, Values]]] = {name: deque(maxlen=most) for name, most in KEPT.items()}
        self._newest = self._first = self._lost = 0

    def begin(self, robot: Values) -> None:
        """Forget the rows of an earlier daemon."""
        with self._lock:
            self._robot = robot
            self._first = self._newest = self._newest + 1
            for kept in self._rows.values():
                kept.clear()

    def add(self, tick: Values, strides: list[Values], events: list[Values], lost: int) -> None:
        with self._lock:
            self._newest += 1
            self._lost = lost
            for kept, rows in zip(self._rows.values(), ([tick], strides, events), strict=True):
                kept += [(self._newest, row) for row in rows]

    def after(self, number: int) -> Values:
        """Return what came after a page's last answer; all there is and the robot if that is too long ago."""
        with self._lock:
            goes_on = max(self._first, self._newest - KEPT["ticks"]) <= number <= self._newest
            since = number if goes_on else -1
            rows = {name: [row for each, row in kept if each > since] for name, kept in self._rows.items()}
            robot = {} if goes_on else {"robot": self._robot}
            clock_s = time.time() - time.monotonic()
            return {"number": self._newest, "wall_minus_monotonic_s": clock_s, "lost": self._lost, **rows, **robot}


class SharedStatus:
    """Owns the daemon's last status as JSON, so that many pages cost the loop one answer."""

    def __init__(self, socket: Path) -> None:
        self._socket = socket
        self._asking = threading.Lock()
        self._asked_s = float("-inf")
        self._answer = HTTPStatus.CONFLICT, b""

    def answer(self) -> tuple[HTTPStatus, bytes]:
        """Return the status, or why a stop would not reach the robot; while another page asks, the one before."""
        if self._asking.acquire(blocking=not self._answer[1]):
            try:
                if time.monotonic() - self._asked_s > STATUS_S:
                    self._answer = ask_status(self._socket)
                    self._asked_s = time.monotonic()
            finally:
                self._asking.release()
        return self._answer


class PageServer:
    """Owns the HTTP server and the rows of the interval under way. Raises OSError if the port is in use."""

    def __init__(self, host: str, port: int, status_socket: Path, names: Collection[str] = ()) -> None:
        """`names` are those under which browsers may open the page, in addition to the address."""
        self._recent = RecentRows()
        self._server = _Server(host, port, self._recent, status_socket, names)
        self.port = int(self._server.server_address[1])
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        self._reset()

    def _reset(self) -> None:
        self._tick: Values | None = None
        self._sent_s = 0.0
        self._strides: list[Values] = []
        self._events: list[Values] = []

    def begin(self, source: LiveRows) -> None:
        self._reset()
        self._recent.begin(robot_facts(source.configuration_text))

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
            self._recent.add(self._tick, self._strides, self._events, lost)
            self._strides, self._events = [], []

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


def robot_facts(configuration_text: str) -> Values:
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


def finite(values: Values) -> Values:
    """Replace numbers that JSON does not have by None."""
    return {name: _finite(value) for name, value in values.items()}


def _finite(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_finite(each) for each in value]
    return known(value) if isinstance(value, float) else value


class _Server(ThreadingHTTPServer):
    """What the handlers of all requests share."""

    daemon_threads = True  # a browser that hangs must not keep this program

    request_queue_size = 50  # connections of pages that are opened at once

    def __init__(self, host: str, port: int, recent: RecentRows, status_socket: Path, names: Collection[str]) -> None:
        self.own_page, self.recent, self.status_socket = own_page(host, names), recent, status_socket
        self.status = SharedStatus(status_socket)
        self.address_family = AF_INET6 if ":" in host else AF_INET
        super().__init__((host, port), _Handler)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report a defect, but not a browser that has gone."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers one connection."""

    protocol_version, timeout = "HTTP/1.1", IDLE_S
    server: _Server

    def do_GET(self) -> None:
        if refused := self._refusal():
            self._answer(HTTPStatus.FORBIDDEN, refused.encode())
        elif self.path == "/":
            self._answer(HTTPStatus.OK, PAGE.read_bytes(), "text/html; charset=utf-8")
        elif number := ROWS.fullmatch(self.path):
            rows = self.server.recent.after(int(number[1]))
            self._answer(HTTPStatus.OK, json.dumps(rows).encode(), "application/json")
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"there is no such page")

    def do_POST(self) -> None:
        refused = self._refusal()
        if not refused and self.headers.get(STOP_HEADER) != "stop":
            refused = f"a request without {STOP_HEADER}: only the page of this server may stop the robot"
        if refused:
            self._answer(HTTPStatus.FORBIDDEN, f"{TORQUE_UNKNOWN}. stop refused: {refused}".encode())
        elif self.path == "/stop":
            ended = end_motion(self.server.status_socket, "stop")
            status = HTTPStatus.OK if ended.status == exit_codes.OK else HTTPStatus.CONFLICT
            self._answer(status, ended.answer.encode())
        elif self.path == "/can_stop":
            self._answer(*self.server.status.answer())
        elif self.path in ("/note", "/mark"):
            accepted, answer = send_call(self.server.status_socket, self.path[1:], text=self._text())
            self._answer(HTTPStatus.OK if accepted else HTTPStatus.CONFLICT, answer.encode())
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"there is no such page")

    def _text(self) -> str:
        """Return the text that was sent; one that the daemon would refuse as too long is cut off."""
        length = self.headers.get("Content-Length", "")
        text = self.rfile.read(min(int(length[:9]), LONGEST_TEXT) if length.isdecimal() else 0)
        return text[:LONGEST_REQUEST].decode(errors="replace")

    def _refusal(self) -> str | None:
        """Return why this request is none of the own page; every route asks."""
        if self.headers.get("Content-Length", "0") != "0" or "Transfer-Encoding" in self.headers:
            self.close_connection = True  # what another site sends as a body would be taken for the next request
        arrived_at = str(self.connection.getsockname()[0])
        return self.server.own_page.refusal(self.headers.get("Host", ""), self.headers.get("Origin"), arrived_at)

    def _answer(self, status: HTTPStatus, content: bytes, kind: str = "text/plain; charset=utf-8") -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Content-Security-Policy", "default-src 'self' 'unsafe-inline'; frame-ancestors 'none'")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not printed."""


def ask_status(status_socket: Path) -> tuple[HTTPStatus, bytes]:
    """Return the daemon's status as JSON, or why it would not take a stop and show that the drives confirm it."""
    try:
        with StatusClient(status_socket, ANSWER_S) as client:
            return HTTPStatus.OK, json.dumps(client.call("status")).encode()
    except (CallRefusedError, NotPermittedError, NoDaemonError) as problem:
        return HTTPStatus.CONFLICT, str(problem).encode()
