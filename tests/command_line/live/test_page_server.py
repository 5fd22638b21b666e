"""The live page: rows reach every browser, however many there are, and no other page stops the robot."""

import json
import socket
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from http.client import HTTPConnection
from math import nan
from pathlib import Path
from typing import Any

import pytest

from command_line.live.page_server import KEPT, PageServer, robot_facts
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.rows import EVENT, STRIDE, TICK
from operator_client.live_rows import LiveRow
from tests.command_line.watch.served_robot import ServedRobot, resting_robot

ADDRESS = "127.0.0.1"


@pytest.fixture
def page(short_folder: Path) -> Iterator[PageServer]:
    with closing(PageServer(ADDRESS, 0, short_folder / "no daemon")) as server:
        yield server


def ticks(*stamps_s: float) -> list[LiveRow]:
    return [LiveRow(TICK, TICK.encode_named(stamp_s=stamp_s, body_x_m=nan)) for stamp_s in stamps_s]


def answer_of(page: PageServer, method: str, path: str, address: str = ADDRESS, **headers: str) -> tuple[int, str]:
    """Return the status and the text with which a request is answered."""
    with closing(HTTPConnection(address, page.port, timeout=60)) as connection:
        connection.request(method, path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        response = connection.getresponse()
        return response.status, response.read().decode()


def ask(page: PageServer, after: int = -1) -> dict[str, Any]:
    """Return what a page gets that has all up to a number."""
    return dict(json.loads(answer_of(page, "GET", f"/rows?after={after}")[1]))


def test_a_browser_gets_the_page_and_it_needs_nothing_else(page: PageServer) -> None:
    status, content = answer_of(page, "GET", "/")
    assert status == 200 and "STOP" in content
    assert "http://" not in content and "https://" not in content


def test_strides_and_events_reach_a_page_once_and_unknown_numbers_are_null(page: PageServer) -> None:
    stride = LiveRow(STRIDE, STRIDE.encode_named(stamp_s=1.0, index=3, k_s=5e5, k_s_valid=True))
    before = ask(page)
    page.take([*ticks(1.0), stride, LiveRow(EVENT, EVENT.encode(1.0, "walk"))], lost=7)
    first = ask(page, before["number"])
    page.take(ticks(2.0), lost=7)
    second = ask(page, first["number"])
    assert before["strides"] == [] and first["strides"][0]["index"] == 3 and first["strides"][0]["k_s"] == 5e5
    assert first["events"][0]["text"] == "walk" and first["ticks"][0]["body_x_m"] is None and first["lost"] == 7
    assert first["events"][0]["wall_s"] == pytest.approx(1.0 + time.time() - time.monotonic(), abs=1.0)
    assert (second["ticks"][0]["stamp_s"], second["strides"], second["events"]) == (2.0, [], [])


def test_ticks_are_ten_a_second_however_many_rows_come(page: PageServer) -> None:
    for number in range(381):
        page.take(ticks(1.0 + number / 380.0), lost=0)
    assert len(ask(page)["ticks"]) in (10, 11)


@pytest.mark.parametrize("after", [-1, 0, 10**17], ids=["new", "hung for long", "of another server"])
def test_a_page_that_is_behind_gets_the_robot_and_all_that_is_kept(page: PageServer, after: int) -> None:
    stride = LiveRow(STRIDE, STRIDE.encode_named(stamp_s=1.0, index=5))
    page.take([*ticks(1.0), stride], lost=0)
    for number in range(KEPT["ticks"] + 5):
        page.take(ticks(2.0 + number), lost=0)
    answer = ask(page, after)
    assert "robot" in answer and len(answer["ticks"]) == KEPT["ticks"] and answer["strides"][0]["index"] == 5
    assert "robot" not in ask(page, answer["number"])


def test_a_browser_that_vanished_keeps_no_connection(page: PageServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("command_line.live.page_server._Handler.timeout", 0.1)
    with socket.create_connection((ADDRESS, page.port), timeout=10) as connection:
        assert connection.recv(1) == b""


@pytest.mark.skipif(not socket.has_dualstack_ipv6(), reason="this computer has no IPv6")
def test_an_address_of_ipv6_serves_the_page_to_a_browser_that_opens_it(short_folder: Path) -> None:
    with closing(PageServer("::1", 0, short_folder / "no daemon")) as server:
        status, _ = answer_of(server, "GET", "/", "::1")  # its Host is [::1]:PORT
    assert status == 200


REACHES, REFUSED = 409, 403  # a stop without a daemon; one that does not reach it
HOSTS = {  # Host of a request to a server on 0.0.0.0, what Origin differs from it by, and whether it is the own page
    "address": ("127.0.0.1", None, True),
    "0.0.0.0": ("0.0.0.0", None, True),
    "localhost": ("localhost", None, True),
    "configured name": ("robot.local", None, True),
    "configured name in capitals": ("ROBOT.local", None, True),
    "foreign host": ("evil.example", None, False),
    "other address": ("192.0.2.1", None, False),
    "no host": ("", None, False),
    "malformed": ("[::1", None, False),
    "foreign origin": ("127.0.0.1", "http://evil.example", False),
    "origin null": ("127.0.0.1", "null", False),
    "other port of this computer": ("127.0.0.1", "http://127.0.0.1:1", False),
}


@pytest.fixture
def open_page(short_folder: Path) -> Iterator[PageServer]:
    with closing(PageServer("0.0.0.0", 0, short_folder / "no daemon", ["Robot.local"])) as server:
        yield server


@pytest.mark.parametrize(("host", "origin", "own"), HOSTS.values(), ids=HOSTS)
def test_every_route_serves_the_own_page_alone(open_page: PageServer, host: str, origin: str | None, own: bool) -> None:
    address = f"{host}:{open_page.port}" if host else ""
    headers = {"Host": address, "Origin": origin or f"http://{address}"}
    status, text = answer_of(open_page, "POST", "/stop", X_Mudskipper="stop", **headers)
    assert status == (REACHES if own else REFUSED) and "torque unknown: cut motor power" in text
    for path in ("/", "/rows?after=-1"):
        assert answer_of(open_page, "GET", path, **headers)[0] == (200 if own else REFUSED)


@pytest.mark.parametrize("length", ["Content-Length: {}", "Transfer-Encoding: chunked"])
def test_the_body_of_another_site_s_request_is_no_request(page: PageServer, length: str) -> None:
    hidden = f"POST /stop HTTP/1.1\r\nHost: {ADDRESS}\r\nX-Mudskipper: stop\r\nConnection: close\r\n\r\n"
    head = f"POST /stop HTTP/1.1\r\nHost: {ADDRESS}\r\nOrigin: http://evil.example\r\n{length.format(len(hidden))}\r\n"
    with socket.create_connection((ADDRESS, page.port), timeout=60) as connection:
        connection.sendall(f"{head}\r\n{hidden}".encode())
        answer = b""
        with suppress(ConnectionResetError):
            while piece := connection.recv(65536):
                answer += piece
    assert answer.count(b"HTTP/1.1") == 1 and f"HTTP/1.1 {REFUSED}".encode() in answer


def test_a_length_that_is_no_number_of_python_s_is_answered(page: PageServer) -> None:
    head = f"POST /note HTTP/1.1\r\nHost: {ADDRESS}:{page.port}\r\nX-Mudskipper: stop\r\n"
    with socket.create_connection((ADDRESS, page.port), timeout=60) as connection:
        connection.sendall(f"{head}Content-Length: {5000 * '9'}\r\n\r\nit rains".encode())
        connection.shutdown(socket.SHUT_WR)
        answer = connection.makefile("rb").read()
    assert answer.startswith(b"HTTP/1.1 409 ") and b"note: no daemon answers" in answer  # the page keeps the text


@pytest.mark.parametrize("headers", [{}, {"X_Mudskipper": "go"}], ids=str)
def test_a_stop_without_the_page_s_header_is_refused(page: PageServer, headers: dict[str, str]) -> None:
    status, text = answer_of(page, "POST", "/stop", **headers)
    assert status == REFUSED and "torque unknown: cut motor power" in text


def test_the_page_learns_whether_a_stop_would_reach_the_robot(
    page: PageServer, configuration: Configuration, short_folder: Path
) -> None:
    assert answer_of(page, "POST", "/can_stop", X_Mudskipper="stop")[0] == REACHES
    robot, socket_path = ServedRobot(resting_robot(configuration)), short_folder / "no daemon"
    asked = robot.calls_of("status")
    with robot.served(socket_path), closing(PageServer(ADDRESS, 0, socket_path)) as page_of_robot:
        answers = [answer_of(page_of_robot, "POST", "/can_stop", X_Mudskipper="stop") for _ in range(10)]
    assert {status for status, _ in answers} == {200}
    assert len(json.loads(answers[0][1])["drives"]) == 4
    assert len(asked) < len(answers)  # pages share the daemon's answer


def test_a_configuration_of_another_version_still_draws_a_robot() -> None:
    assert robot_facts("no TOML ][")["flipper_length_m"] > 0.0
