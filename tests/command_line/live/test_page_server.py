"""The live page: rows reach every browser, a hanging browser loses only its own, and no other page stops the robot."""

import json
from collections.abc import Iterator
from http.client import HTTPConnection, HTTPResponse
from math import nan
from pathlib import Path
from typing import Any

import pytest

from command_line.live.page_server import PageServer, Viewer, Viewers, robot_facts
from firmware_host.log.rows import EVENT, STRIDE, TICK
from operator_client.live_rows import LiveRow

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


def post(page: PageServer, **headers: str) -> tuple[int, str]:
    connection = HTTPConnection(ADDRESS, page.port, timeout=60)
    connection.request("POST", "/stop", headers={name.replace("_", "-"): value for name, value in headers.items()})
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


@pytest.mark.parametrize(
    "headers", [{}, {"X_Mudskipper": "go"}, {"X_Mudskipper": "stop", "Host": "evil.example:80"}], ids=str
)
def test_a_page_of_another_site_cannot_stop_the_robot(page: PageServer, headers: dict[str, str]) -> None:
    status, text = post(page, **headers)
    assert status == 403 and "only the page" in text


def test_a_stop_without_a_daemon_says_to_cut_the_power(page: PageServer) -> None:
    status, text = post(page, X_Mudskipper="stop")
    assert status == 409 and "cut motor power" in text


def test_a_configuration_of_another_version_still_draws_a_robot() -> None:
    assert robot_facts("no TOML ][")["flipper_length_m"] > 0.0
