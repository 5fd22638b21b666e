"""Operates a headless Chromium by its driver, with the W3C's WebDriver protocol: Debian's chromium-driver has both."""

import json
import subprocess
import time
import urllib.request
from contextlib import suppress
from typing import Any
from urllib.error import URLError

DRIVER, PORT = "chromedriver", 9515
ARGUMENTS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run")
LONGEST_S = 60.0


class Chromium:
    """Owns the driver and its session."""

    def __init__(self) -> None:
        self._driver = subprocess.Popen([DRIVER, f"--port={PORT}"], stdout=subprocess.DEVNULL)
        options = {"goog:chromeOptions": {"args": ARGUMENTS}}
        self._session = ""
        deadline_s = time.monotonic() + LONGEST_S
        while not self._session and time.monotonic() < deadline_s:
            with suppress(URLError):  # the driver is not ready yet
                self._session = self._call("/session", {"capabilities": {"alwaysMatch": options}})["sessionId"]

    def _call(self, path: str, content: dict[str, Any], method: str = "POST") -> Any:
        url, head = f"http://127.0.0.1:{PORT}{path}", {"Content-Type": "application/json"}
        request = urllib.request.Request(url, json.dumps(content).encode(), head, method=method)
        with urllib.request.urlopen(request, timeout=LONGEST_S) as answer:
            return json.load(answer)["value"]

    def command(self, name: str, **content: Any) -> Any:
        return self._call(f"/session/{self._session}/{name}", content)

    def set_width(self, width: int) -> None:
        """Make the page as wide as on a device with so many pixels."""
        size = {"width": width, "height": 844, "deviceScaleFactor": 1, "mobile": width < 500}
        self.command("goog/cdp/execute", cmd="Emulation.setDeviceMetricsOverride", params=size)

    def run(self, script: str) -> Any:
        """Return what a script returns in the present page."""
        return self.command("execute/sync", script=script, args=[])

    def open_tab(self, url: str) -> None:
        """Open a page in a tab of its own, which is then the present one."""
        self.command("window", handle=self.command("window/new", type="tab")["handle"])
        self.command("url", url=url)

    def wait_for(self, condition: str) -> None:
        """Wait until an expression is true in the present page. Raises TimeoutError with what the page says."""
        deadline_s = time.monotonic() + LONGEST_S
        while not self.run(f"return Boolean({condition})"):
            if time.monotonic() > deadline_s:
                raise TimeoutError(f"{condition}: {self.run('return document.body.innerText')}")
            time.sleep(0.2)

    def close(self) -> None:
        self._call(f"/session/{self._session}", {}, method="DELETE")  # ends the browser
        self._driver.terminate()
        self._driver.wait()
