"""The screen, driven by textual's own pilot: its keys, its first line, and a daemon that restarts."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path

import pytest
from textual.pilot import Pilot

from command_line import exit_codes
from command_line.operation import confirmation
from command_line.operation.confirmation import send_order
from command_line.watch.feed import Feed
from command_line.watch.screen_app import Rows, WatchApp
from control.modes import ENERGISED, Mode
from control.records import COEFFICIENTS, JOINTS
from tests.command_line.watch.served_robot import ServedRobot
from tests.waiting import LONGEST_S

PERIOD_S = 0.05


def shown(app: WatchApp) -> str:
    return "\n".join("".join(segment.text for segment in strip) for strip in app.screen._compositor.render_strips())


async def until(app: WatchApp, pilot: Pilot[int], done: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + LONGEST_S
    while not done():
        assert time.monotonic() < deadline_s, f"never shown:\n{shown(app)}"
        await pilot.pause(PERIOD_S)


def drive(
    path: Path,
    script: Callable[[WatchApp, Pilot[int]], Awaitable[None]],
    width: int = 80,
    height: int = 24,
    send: Callable[[str], str] | None = None,
) -> WatchApp:
    """Run the app with a script that presses keys and reads the screen."""
    app = WatchApp(Feed(path, PERIOD_S), ["left", "right"], PERIOD_S, send or partial(send_order, path))

    async def run() -> None:
        async with app.run_test(size=(width, height)) as pilot:
            await until(app, pilot, lambda: bool(app.query_one("#drives", Rows).row_count))
            await script(app, pilot)
        app.redraw()  # as a timer does that ends after the screen

    asyncio.run(run())
    return app


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 46)])
def test_it_shows_every_part_of_a_robot_that_walks(
    walked: ServedRobot, short_folder: Path, width: int, height: int
) -> None:
    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        parts = {"slip", "speed", "forward", "torque", "Hz", "log", "lease", "▲", "stop", *JOINTS, *COEFFICIENTS}
        await until(app, pilot, lambda: all(part in shown(app) for part in parts))
        await until(app, pilot, lambda: "WALKING" in shown(app).splitlines()[0])

    with walked.served(short_folder / "s"):
        drive(short_folder / "s", script, width, height)


@pytest.mark.parametrize(("width", "height"), [(40, 10), (10, 3), (1, 1)])
def test_a_small_terminal_shows_what_fits(walked: ServedRobot, short_folder: Path, width: int, height: int) -> None:
    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        fits = "WALKING"[: max(width - 1, 0)]
        await until(app, pilot, lambda: fits in shown(app).splitlines()[0])

    with walked.served(short_folder / "s"):
        drive(short_folder / "s", script, width, height)


@pytest.mark.parametrize(
    ("before", "key", "modes"),
    [
        ((), "space", {Mode.STOPPING, Mode.HOLD}),
        (("c",), "d", {Mode.IDLE}),
        (("question_mark",), "space", {Mode.STOPPING, Mode.HOLD}),
    ],
    ids=["alone", "asked", "help"],
)
def test_stop_and_disarm_act_at_once(
    walked: ServedRobot,
    short_folder: Path,
    before: tuple[str, ...],
    key: str,
    modes: set[Mode],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They act also while a question is open or the help is shown."""
    monkeypatch.setattr(confirmation, "CONFIRMING_S", LONGEST_S)  # this robot is as slow as the machine
    monkeypatch.setattr(confirmation, "LONGEST_S", dict.fromkeys(confirmation.LONGEST_S, LONGEST_S))

    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        await pilot.press(*before, key)
        await until(app, pilot, lambda: walked.mode in modes)
        await until(app, pilot, lambda: "every drive has confirmed it" in shown(app))

    with walked.served(short_folder / "s"):
        drive(short_folder / "s", script)


def test_a_disarm_that_a_drive_cannot_confirm_leaves_the_torque_unknown(
    walked: ServedRobot, short_folder: Path
) -> None:
    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        walked.robot.fail("left_sweep", "off", 60.0)
        await until(app, pilot, lambda: "unknown" in shown(app))
        await pilot.press("d")
        await until(app, pilot, lambda: "cut motor power" in shown(app))

    with walked.served(short_folder / "s"):
        drive(short_folder / "s", script)


def test_an_answer_that_comes_at_once_is_shown(resting: ServedRobot, short_folder: Path) -> None:
    """A question hides the answers, and has not given their place back by then."""

    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        await pilot.press("c", "y")
        await until(app, pilot, lambda: "clear refused" in shown(app))

    with resting.served(short_folder / "s"):
        drive(short_folder / "s", script, send=lambda method: f"{method} refused")


def test_arming_walking_and_clearing_ask_first(resting: ServedRobot, short_folder: Path) -> None:
    resting.robot.run_until(lambda: resting.mode is Mode.IDLE and not resting.robot.loop.faults.present, 3.0)

    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        await pilot.press("a")
        await until(app, pilot, lambda: "Arm the robot?" in shown(app))
        await pilot.press("x", "y")  # no question is open at the second key
        await pilot.pause(4 * PERIOD_S)
        assert resting.mode is Mode.IDLE and "Arm the robot?" not in shown(app)
        await pilot.press("a", "y")
        await until(app, pilot, lambda: resting.mode is Mode.HOLD)
        await until(app, pilot, lambda: " HOLD " in shown(app))
        await pilot.press("w", "y")
        await until(app, pilot, lambda: resting.mode is Mode.WALKING)
        await pilot.press("c", "y")
        await until(app, pilot, lambda: "clear refused" in shown(app))
        assert resting.mode in ENERGISED

    with resting.served(short_folder / "s"):
        drive(short_folder / "s", script)


def test_a_digit_is_a_note_and_a_key_marks_the_moment(resting: ServedRobot, short_folder: Path) -> None:
    sent: list[tuple[str, dict[str, str]]] = []

    def send(method: str, **params: str) -> str:
        sent.append((method, params))
        return f"{method} done"

    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        await pilot.press("n")
        await until(app, pilot, lambda: "2 slipped" in shown(app))
        await pilot.press("y", "2", "2", "n", "x", "3")  # only the first 2 answers a question
        await until(app, pilot, lambda: "note done" in shown(app))
        await pilot.press("m")
        await until(app, pilot, lambda: "mark done" in shown(app))

    with resting.served(short_folder / "s"):
        drive(short_folder / "s", script, send=send)
    assert sent == [("note", {"text": "slipped"}), ("mark", {})]


def test_help_explains_every_key_and_keeps_the_alarm(walked: ServedRobot, short_folder: Path) -> None:
    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        await pilot.press("question_mark")
        await until(app, pilot, lambda: "emergency stop" in shown(app))
        assert "WALKING" in shown(app).splitlines()[0]
        await pilot.press("question_mark")
        await until(app, pilot, lambda: "emergency stop" not in shown(app))

    with walked.served(short_folder / "s"):
        drive(short_folder / "s", script)


def test_faults_and_joint_plots_take_the_place_of_the_rest(walked: ServedRobot, short_folder: Path) -> None:
    walked.robot.loop.events.notice = "stopped by a test"
    walked.robot.loop.events.notice_s = walked.robot.now_s

    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        await pilot.press("f")
        await until(app, pilot, lambda: "stopped by a test" in shown(app) and "k_p" not in shown(app))
        for title in ("angle", "current", "torque command"):
            await pilot.press("j")
            await until(app, pilot, lambda title=title: f"{title} (" in shown(app))  # type: ignore[misc]
        await pilot.press("j")
        await until(app, pilot, lambda: "k_p" in shown(app))

    with walked.served(short_folder / "s"):
        drive(short_folder / "s", script)


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

    drive(path, script)


@pytest.mark.parametrize(("key", "status"), [("q", exit_codes.OK), ("ctrl+c", exit_codes.INTERRUPTED)])
def test_leaving_does_not_stop_the_robot(walked: ServedRobot, short_folder: Path, key: str, status: int) -> None:
    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        await pilot.press(key)

    with walked.served(short_folder / "s"):
        assert drive(short_folder / "s", script).return_value == status
        assert walked.mode is Mode.WALKING
