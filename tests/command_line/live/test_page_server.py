"""The live page: rows reach every browser, a hanging browser loses only its own, and no other page stops the robot."""

import json
import time
from collections.abc import Iterator
from http.client import HTTPConnection, HTTPResponse
from math import nan
from pathlib import Path
from typing import Any

import pytest

from command_line.live.page_server import PageServer, Viewer, Viewers, robot_facts
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.rows import EVENT, STRIDE, TICK
from operator_client.live_rows import LiveRow
from tests.command_line.watch.served_robot import ServedRobot, resting_robot

ADDRESS = "127.0.0.1"
MESSAGE: dict[str, Any] = {"tick": {"stamp_s": 1.0}, "strides": [], "events": []}


@pytest.fixture
def page(short_folder: Path) -> Iterator[PageServer]:
    server = PageServer(ADDRESS, 0, short_folder / "no daemon")
    yield server
    server.close()


def ticks(*stamps_s: float) -> list[LiveRow]:
    return [LiveRow(TICK, TICK.encode_named(stamp_s=stamp_s, body_x_m=nan)) for stamp_s in stamps_s]


def subscribe(page: PageServer) -> HTTPResponse:
    connection = HTTPConnection(ADDRESS, page.port, timeout=60)
    connection.request("GET", "/rows")
    return connection.getresponse()


def next_message(response: HTTPResponse) -> dict[str, Any]:
    while True:
        line = response.readline().decode()
        if line.startswith("data: "):
            return dict(json.loads(line.removeprefix("data: ")))


def post(page: PageServer, path: str = "/stop", body: str = "", **headers: str) -> tuple[int, str]:
    connection = HTTPConnection(ADDRESS, page.port, timeout=60)
    connection.request(
        "POST", path, body.encode(), headers={name.replace("_", "-"): value for name, value in headers.items()}
    )
    response = connection.getresponse()
    return response.status, response.read().decode()


def test_a_browser_gets_the_page_and_it_needs_nothing_else(page: PageServer) -> None:
    connection = HTTPConnection(ADDRESS, page.port, timeout=60)
    connection.request("GET", "/")
    response = connection.getresponse()
    content = response.read().decode()
    assert response.status == 200 and "STOP" in content
    assert "http://" not in content and "https://" not in content


def test_strides_and_events_reach_a_browser_once_and_unknown_numbers_are_null(page: PageServer) -> None:
    browser = subscribe(page)
    assert next_message(browser)["strides"] == []
    stride = LiveRow(STRIDE, STRIDE.encode_named(stamp_s=1.0, index=3, k_s=5e5, k_s_valid=True))
    page.take([*ticks(1.0), stride, LiveRow(EVENT, EVENT.encode(1.0, "walk"))], lost=7)
    page.take(ticks(2.0), lost=7)
    first, second = next_message(browser), next_message(browser)
    assert first["strides"][0]["index"] == 3 and first["strides"][0]["k_s"] == 5e5
    assert first["events"][0]["text"] == "walk"
    assert first["events"][0]["wall_s"] == pytest.approx(1.0 + time.time() - time.monotonic(), abs=1.0)
    assert first["tick"]["body_x_m"] is None
    assert first["lost"] == 7
    assert (second["strides"], second["events"]) == ([], [])


def test_messages_are_ten_a_second_however_many_rows_come(page: PageServer) -> None:
    browser = subscribe(page)
    next_message(browser)
    for number in range(381):
        page.take(ticks(1.0 + number / 380.0), lost=0)
    page.take(ticks(9.0), lost=0)
    stamps_s = [0.0]
    while stamps_s[-1] < 9.0:
        stamps_s.append(next_message(browser)["tick"]["stamp_s"])
    assert len(stamps_s) - 2 in (10, 11)


def test_a_viewer_that_hangs_loses_its_own_messages_and_learns_how_many() -> None:
    viewers = Viewers()
    reading, hanging = viewers.add(), viewers.add()
    for _ in range(100):
        viewers.publish(MESSAGE)
        assert reading.get(0.0) is not None
    assert (reading.lost, hanging.lost) == (0, 81)  # its queue holds 20 messages, one of them the initial one

    def newest(viewer: Viewer) -> dict[str, Any]:
        found = [message for message in iter(lambda: viewer.get(0.0), None)]
        return dict(json.loads(found[-1]))

    newest(hanging)
    viewers.publish(MESSAGE)
    assert newest(hanging)["lost"] == 81


def test_a_new_viewer_gets_the_strides_before_it() -> None:
    viewers = Viewers()
    viewers.publish(MESSAGE | {"strides": [{"index": 5}]})
    message = viewers.add().get(0.0)
    assert message and json.loads(message)["strides"] == [{"index": 5}]


@pytest.fixture
def open_page(short_folder: Path) -> Iterator[PageServer]:
    server = PageServer("0.0.0.0", 0, short_folder / "no daemon", ["Robot.local"])
    yield server
    server.close()


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


@pytest.mark.parametrize(("host", "origin", "own"), HOSTS.values(), ids=HOSTS)
def test_every_route_serves_the_own_page_alone(open_page: PageServer, host: str, origin: str | None, own: bool) -> None:
    address = f"{host}:{open_page.port}" if host else ""
    headers = {"Host": address, "Origin": origin or f"http://{address}"}
    status, text = post(open_page, X_Mudskipper="stop", **headers)
    assert status == (REACHES if own else REFUSED) and "torque unknown: cut motor power" in text
    for path in ("/", "/rows"):
        connection = HTTPConnection(ADDRESS, open_page.port, timeout=60)
        connection.request("GET", path, headers=headers)
        response = connection.getresponse()
        assert (response.status == 200) == own and response.status in (200, REFUSED)
        connection.close()


@pytest.mark.parametrize("headers", [{}, {"X_Mudskipper": "go"}], ids=str)
def test_a_stop_without_the_page_s_header_is_refused(page: PageServer, headers: dict[str, str]) -> None:
    status, text = post(page, **headers)
    assert status == REFUSED and "torque unknown: cut motor power" in text


def test_the_page_learns_whether_a_stop_would_reach_the_robot(
    page: PageServer, configuration: Configuration, short_folder: Path
) -> None:
    assert post(page, path="/can_stop", X_Mudskipper="stop")[0] == REACHES
    with ServedRobot(resting_robot(configuration)).served(short_folder / "no daemon"):
        assert post(page, path="/can_stop", X_Mudskipper="stop") == (200, "ready")
        for path, body, answer in (
            ("/note", "it slips", "note: 20"),
            ("/mark", "", "mark: 20"),
            ("/note", "", "note: 20"),
        ):
            assert post(page, path, body, X_Mudskipper="stop")[1].startswith(answer)
        for body in ("a\nb", "x" * 1_000_000, "\0"):
            assert "note refused: text = " in post(page, "/note", body, X_Mudskipper="stop")[1]
    assert post(page, "/note", "it slips")[0] == REFUSED


def test_a_stop_without_a_daemon_says_to_cut_the_power(page: PageServer) -> None:
    status, text = post(page, X_Mudskipper="stop")
    assert status == 409 and "cut motor power" in text


def test_a_configuration_of_another_version_still_draws_a_robot() -> None:
    assert robot_facts("no TOML ][")["flipper_length_m"] > 0.0
