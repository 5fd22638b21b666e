"""The page continues after the daemon, `mudskipper live` or both were stopped and started again, as processes."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection
from typing import Any

from tests.command_line.command_lines import start_process
from tests.running_bench import Bench
from tests.waiting import LONGEST_S

ADDRESS = "127.0.0.1"
RETRY_S = 0.05


class Page:
    """Asks for what is new, and for everything after a question that was not answered, as the page does."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._number = -1

    def wait_for(self, name: str) -> Any:
        """Return the first answer's values of this name that are not empty."""
        deadline_s = time.monotonic() + LONGEST_S
        while time.monotonic() < deadline_s:
            if found := self.ask().get(name):
                return found
            time.sleep(RETRY_S)
        raise AssertionError(f"no answer with {name}")

    def ask(self) -> dict[str, Any]:
        """Return an answer; nothing where there is no server."""
        connection = HTTPConnection(ADDRESS, self._port, timeout=LONGEST_S)
        try:
            connection.request("GET", f"/rows?after={self._number}")
            answer = dict(json.loads(connection.getresponse().read()))
        except OSError:
            answer = {"number": -1}
        connection.close()
        self._number = answer["number"]
        return answer


@contextmanager
def serving(bench: Bench, port: int = 0) -> Iterator[int]:
    """Run `mudskipper live --page`, and yield its port."""
    with start_process("live", "--page", "--port", str(port), MUDSKIPPER_SOCKET=str(bench.socket)) as process:
        assert process.stdout is not None
        address = process.stdout.readline()  # "Serving on http://127.0.0.1:8080/. Ctrl-C ends."
        try:
            yield int(address.split(f"{ADDRESS}:")[1].split("/")[0])
        finally:
            process.terminate()


def test_a_page_continues_after_the_daemon_and_after_both_were_stopped_and_started_again(own_bench: Bench) -> None:
    """Until a daemon answers, the program knows no robot, and the page keeps the one that it draws."""
    with serving(own_bench) as port:
        page = Page(port)
        before = page.wait_for("ticks")[-1]
        own_bench.stop_daemon()
        own_bench.restart_daemon()
        assert page.wait_for("robot")["flippers"] == ["left", "right"]
        between = page.wait_for("ticks")[-1]
        own_bench.stop_daemon()
    assert page.ask() == {"number": -1}
    with serving(own_bench, port):
        first = page.ask()
        assert (first["robot"], first["ticks"]) == ({}, [])
        own_bench.restart_daemon()
        assert page.wait_for("robot")["name"]
        assert page.wait_for("ticks")[-1]["stamp_s"] > between["stamp_s"] > before["stamp_s"]
