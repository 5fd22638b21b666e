"""The screen, driven by textual's own pilot: its keys, its panels, its first line, and a daemon that restarts."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path

from textual.pilot import Pilot

from command_line.operation.confirmation import send_order
from command_line.watch.feed import Feed
from command_line.watch.screen_app import Rows, WatchApp
from control.records import COEFFICIENTS, JOINTS
from tests.command_line.watch.served_robot import ServedRobot
from tests.waiting import LONGEST_S

PERIOD_S = 0.05
Sent = list[tuple[str, dict[str, str]]]


class DirectFeed(Feed):
    """Asks a robot in this process, at each redrawing, instead of a daemon in a thread of its own."""

    def __init__(self, robot: ServedRobot) -> None:
        super().__init__(Path("/none"), PERIOD_S)
        self.robot = robot

    def start(self) -> None:
        self.ask()

    def ask(self) -> None:
        self.history.add_status(self.robot.ask("status"), time.monotonic() + LONGEST_S)  # and it does not grow old
        self.history.add_strides(self.robot.ask("strides", since=self.history.next_stride))


def shown(app: WatchApp) -> str:
    return "\n".join("".join(segment.text for segment in strip) for strip in app.screen._compositor.render_strips())


async def until(app: WatchApp, pilot: Pilot[int], done: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + LONGEST_S
    while not done():
        assert time.monotonic() < deadline_s, f"never shown:\n{shown(app)}"
        if isinstance(app.feed, DirectFeed):
            app.feed.ask()
            app.redraw()
        await pilot.pause(None if isinstance(app.feed, DirectFeed) else PERIOD_S)


def drive(
    feed: Feed, script: Callable[[WatchApp, Pilot[int]], Awaitable[None]], send: Callable[..., str] = str
) -> None:
    """Run the app with a script that presses keys and reads the screen."""
    app = WatchApp(feed, ["left", "right"], 1e6 if isinstance(feed, DirectFeed) else PERIOD_S, send)

    async def run() -> None:
        async with app.run_test(size=(80, 24)) as pilot:
            await until(app, pilot, lambda: bool(app.query_one("#drives", Rows).row_count))
            await script(app, pilot)
        app.redraw()  # as a timer does that ends after the screen

    asyncio.run(run())


def test_it_shows_every_part_of_a_robot_that_walks_or_what_fits(walked: ServedRobot) -> None:
    parts = {"slip", "speed", "forward", "torque", "Hz", "log", "lease", "▲", "stop", *JOINTS, *COEFFICIENTS}

    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        for width, height in ((80, 24), (120, 46), (40, 10), (10, 3), (1, 1)):
            await pilot.resize_terminal(width, height)
            fits = "WALKING"[: width - 1]
            await until(app, pilot, lambda fits=fits: fits in shown(app).splitlines()[0])  # type: ignore[misc]
            if width >= 80:
                await until(app, pilot, lambda: all(part in shown(app) for part in parts))

    drive(DirectFeed(walked), script)


def test_stop_and_disarm_act_at_once_and_other_orders_ask_first(resting: ServedRobot) -> None:
    """A key is pressed next to an open question or the help; only the digit that answers a question is a note."""
    slipped: Sent = [("note", {"text": "slipped"})]
    table: list[tuple[str, Sent]] = [
        ("space", [("stop", {})]),
        ("question_mark space question_mark", [("stop", {})]),
        ("c d", [("disarm", {})]),
        ("m", [("mark", {})]),
        ("a x y", []),
        ("a y", [("arm", {})]),
        ("w y", [("walk", {})]),
        ("c y", [("clear", {})]),
        ("n y 2 2 n x 3", slipped),
    ]
    sent: Sent = []

    def send(method: str, **params: str) -> str:
        sent.append((method, params))
        return f"{method} done"

    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        for keys, orders in table:
            sent.clear()
            await pilot.press(*keys.split())
            await until(app, pilot, lambda orders=orders: sent == orders)  # type: ignore[misc]
            if orders:
                await until(app, pilot, lambda orders=orders: f"{orders[0][0]} done" in shown(app))  # type: ignore[misc]
        await pilot.press("a")
        await until(app, pilot, lambda: "Arm the robot?" in shown(app))

    drive(DirectFeed(resting), script, send)


def test_help_faults_and_joint_plots_take_the_place_of_the_rest_below_the_alarm(walked: ServedRobot) -> None:
    walked.robot.loop.events.notice = "stopped by a test"
    walked.robot.loop.events.notice_s = walked.robot.now_s
    plots = ("angle (", "current (", "torque command (")

    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        for key, text in (("question_mark", "emergency stop"), ("f", "stopped by a test"), *(("j", p) for p in plots)):
            await pilot.press(key)
            await until(app, pilot, lambda text=text: text in shown(app) and "k_p" not in shown(app))  # type: ignore[misc]
            assert "WALKING" in shown(app).splitlines()[0]
        await pilot.press("j")
        await until(app, pilot, lambda: "k_p" in shown(app))

    drive(DirectFeed(walked), script)


def test_it_survives_a_restart_of_the_daemon(walked: ServedRobot, resting: ServedRobot, short_folder: Path) -> None:
    path = short_folder / "s"
    serving = walked.served(path)
    serving.__enter__()

    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        await until(app, pilot, lambda: len(app.feed.history.strides) >= 2)
        serving.__exit__(None, None, None)
        await until(app, pilot, lambda: "NO ANSWER" in shown(app).splitlines()[0])
        assert "unknown" in shown(app) and "Nothing heard from the daemon since" in shown(app)
        assert " on" not in shown(app).split("left_sweep")[1].splitlines()[0]
        await pilot.press("d")
        await until(app, pilot, lambda: "cut motor power" in shown(app))
        with resting.served(path):
            await until(app, pilot, lambda: "NO ANSWER" not in shown(app))
            assert not app.feed.history.strides  # the strides of the previous daemon are gone

    drive(Feed(path, PERIOD_S), script, partial(send_order, path))
