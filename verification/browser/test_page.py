"""The page of `mudskipper live --page` in a real browser, with a simulated robot: on a phone, a tablet and a desk."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator

import pytest

from verification.browser.chromium import DRIVER, Chromium
from verification.local_robot import LocalRobot, kill_session

pytestmark = pytest.mark.skipif(shutil.which(DRIVER) is None, reason="needs chromium-driver")
PAGES = 10  # a browser opens six connections to one server
LAYOUT = """
const box = element => element.getBoundingClientRect(), stop = box(document.getElementById("stop")), width = innerWidth;
window.scrollTo(0, 500);
const below = box(document.getElementById("stop"));
window.scrollTo(0, 0);
return {
  stop_is_whole: [stop, below].every(each => each.left >= 0 && each.right <= width && each.top >= 0),
  page_fits: document.documentElement.scrollWidth <= width,
  charts_fit: [...document.querySelectorAll("canvas")].every(each => box(each).width > 100 && box(each).right <= width),
  tables_fit: [...document.querySelectorAll("section")].every(each => each.scrollWidth <= each.clientWidth + 1),
};
"""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Chromium]:
    browser = Chromium()
    yield browser
    browser.close()


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LocalRobot]:
    """Yield a robot that walks."""
    robot = LocalRobot(tmp_path_factory.mktemp("robot"))
    robot.start_daemon()
    try:
        robot.require_walk()
        yield robot
    finally:
        robot.end()


@pytest.fixture(scope="module")
def address(robot: LocalRobot) -> Iterator[str]:
    command = [sys.executable, "-m", "command_line.main", "live", "--page", "--port", "0"]
    environment = os.environ | {"MUDSKIPPER_SOCKET": str(robot.socket)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, start_new_session=True)
    assert process.stdout is not None
    yield process.stdout.readline().decode().split()[2].rstrip(".")
    kill_session(process)


def word(text: str) -> str:
    return f'document.getElementById("mode").textContent === "{text}"'


@pytest.mark.parametrize("width", [390, 768, 1440])
def test_stop_charts_and_tables_fit(chromium: Chromium, address: str, width: int) -> None:
    chromium.open_tab(address)
    chromium.set_width(width)
    chromium.wait_for(f"{word('walking')} && document.querySelectorAll('#strides tr').length > 2")
    assert all(chromium.run(LAYOUT).values()), chromium.run(LAYOUT)


def test_a_note_and_a_marker_are_written_by_their_buttons(chromium: Chromium, address: str) -> None:
    chromium.open_tab(address)
    chromium.wait_for(word("walking"))
    field, written = "document.querySelector('#note input')", "document.getElementById('noted').textContent"
    chromium.run(f"{field}.value = 'a stone <b>'; document.querySelector('#note button').click()")
    chromium.wait_for(f"{written}.startsWith('note: ') && {field}.value === ''")
    chromium.wait_for("document.getElementById('events').textContent.includes('a stone <b>')")
    chromium.run(f"{field}.value = 'clap'; document.getElementById('mark').click()")
    chromium.wait_for(f"{written}.startsWith('mark: ')")
    chromium.wait_for("document.getElementById('events').textContent.includes('clap')")


def test_the_last_of_many_pages_stops_the_robot_and_sees_the_daemon_die(
    chromium: Chromium, robot: LocalRobot, address: str
) -> None:
    for _ in range(PAGES):
        chromium.open_tab(address)
        chromium.wait_for(word("walking"))
    chromium.run("document.getElementById('stop').click()")
    chromium.wait_for("document.getElementById('answer').textContent.includes('every drive has confirmed it')")
    assert robot.call("status")["mode"] == "hold"
    robot.end()
    chromium.wait_for(f"{word('no daemon')} && !document.getElementById('cannot').hidden")
