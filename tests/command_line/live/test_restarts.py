"""The page continues after the daemon, `mudskipper live` or both were stopped and started again, as processes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection, HTTPResponse
from typing import Any

from tests.running_bench import Bench
from tests.waiting import LONGEST_S

ADDRESS = "127.0.0.1"
RETRY_S = 0.05  # a browser waits for three seconds or so


class Browser:
    """Owns a connection, and opens it again when it ends, as the EventSource of a browser does."""

    def __init__(self, port: int) -> None:
        self.connections = 0
        self._port = port
        self._response: HTTPResponse | None = None

    def wait_for(self, *names: str) -> dict[str, Any]:
        """Return the next message in which all of these are known."""
        deadline_s = time.monotonic() + LONGEST_S
        while time.monotonic() < deadline_s:
            message = self.next_message()
            if message is not None and all(message.get(name) for name in names):
                return message
        raise AssertionError(f"no message with {' and '.join(names)}")

    def next_message(self) -> dict[str, Any] | None:
        """Return None for an empty line, and where there is no connection."""
        try:
            line = self._connected().readline().decode()
        except OSError:
            line = ""
        if not line:
            self._response = None
            time.sleep(RETRY_S)
        return dict(json.loads(line.removeprefix("data: "))) if line.startswith("data: ") else None

    def _connected(self) -> HTTPResponse:
        if self._response is None:
            connection = HTTPConnection(ADDRESS, self._port, timeout=LONGEST_S)
            connection.request("GET", "/rows")
            self._response = connection.getresponse()
            self.connections += 1
        return self._response


@contextmanager
def serving(bench: Bench, port: int = 0) -> Iterator[int]:
    """Run `mudskipper live --page`, and yield its port."""
    command = [sys.executable, "-m", "command_line.main", "live", "--page", "--port", str(port)]
    environment = os.environ | {"MUDSKIPPER_SOCKET": str(bench.socket)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None and process.stderr is not None
    try:
        address = process.stdout.readline()  # "Serving on http://127.0.0.1:8080/. Ctrl-C ends."
        yield int(address.split(f"{ADDRESS}:")[1].split("/")[0])
    finally:
        process.terminate()
        process.communicate(timeout=LONGEST_S)


def test_a_page_that_stays_open_shows_the_daemon_that_was_started_again(own_bench: Bench) -> None:
    with serving(own_bench) as port:
        browser = Browser(port)
        before = browser.wait_for("tick")["tick"]
        own_bench.stop_daemon()
        own_bench.restart_daemon()
        assert browser.wait_for("robot")["robot"]["flippers"] == ["left", "right"]
        after = browser.wait_for("tick")["tick"]
        assert (browser.connections, after["stamp_s"] > before["stamp_s"]) == (1, True)


def test_a_page_reconnects_to_the_program_that_was_started_again(own_bench: Bench) -> None:
    with serving(own_bench) as port:
        browser = Browser(port)
        before = browser.wait_for("tick")["tick"]
    with serving(own_bench, port):
        after = browser.wait_for("tick")["tick"]
        assert (browser.connections, after["tick"] > before["tick"]) == (2, True)


def test_a_page_continues_after_both_were_stopped_and_the_program_started_first(own_bench: Bench) -> None:
    """Until a daemon answers, the program knows no robot, and the page keeps the one that it draws."""
    with serving(own_bench) as port:
        browser = Browser(port)
        before = browser.wait_for("tick")["tick"]
        own_bench.stop_daemon()
    with serving(own_bench, port):
        while (first := browser.next_message()) is None or browser.connections == 1:
            continue
        assert ("robot" in first, first["tick"]) == (False, None)
        own_bench.restart_daemon()
        assert browser.wait_for("robot")["robot"]["name"]
        assert browser.wait_for("tick")["tick"]["stamp_s"] > before["stamp_s"]
