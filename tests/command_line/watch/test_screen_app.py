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
from command_line.watch.feed import Feed
from command_line.watch.lines import plain_text
from command_line.watch.orders import send_order
from command_line.watch.screen_app import WatchApp
from control.modes import ENERGISED, Mode
from tests.command_line.watch.served_robot import ServedRobot
from tests.waiting import LONGEST_S

PERIOD_S = 0.05


def shown(app: WatchApp) -> str:
    return plain_text(app.panels.lines)


async def until(app: WatchApp, pilot: Pilot[int], done: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + LONGEST_S
    while not done():
        assert time.monotonic() < deadline_s, f"never shown:\n{shown(app)}"
        await pilot.pause(PERIOD_S)


def drive(
    path: Path, script: Callable[[WatchApp, Pilot[int]], Awaitable[None]], width: int = 80, height: int = 24
) -> WatchApp:
    """Run the app with a script that presses keys and reads the screen."""
    app = WatchApp(Feed(path, PERIOD_S), PERIOD_S, partial(send_order, path))

    async def run() -> None:
        async with app.run_test(size=(width, height)) as pilot:
            await until(app, pilot, lambda: bool(app.feed.history.status) and "drive" in shown(app))
            await script(app, pilot)

    asyncio.run(run())
    return app


def test_it_shows_a_robot_that_walks(walked: ServedRobot, short_folder: Path) -> None:
    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        await until(app, pilot, lambda: len(app.feed.history.strides) >= 4 and "0.35 m" not in shown(app))
        first = shown(app).splitlines()[0]
        assert "WALKING" in first
        for text in ("k_p", "k_s", "k_e", "±", "left_adduction", "Hz", "lease", "space", "cm next"):
            assert text in shown(app), text

    with walked.served(short_folder / "s"):
        drive(short_folder / "s", script)


@pytest.mark.parametrize(("key", "modes"), [("space", {Mode.STOPPING, Mode.HOLD}), ("d", {Mode.IDLE})])
@pytest.mark.parametrize("before", [(), ("c",), ("question_mark",)], ids=["alone", "asked", "help"])
def test_stop_and_disarm_act_at_once(
    walked: ServedRobot,
    short_folder: Path,
    key: str,
    modes: set[Mode],
    before: tuple[str, ...],
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
        await until(app, pilot, lambda: "cut motor power" in shown(app).splitlines()[-1])

    with walked.served(short_folder / "s"):
        drive(short_folder / "s", script)


def test_arming_walking_and_clearing_ask_first(resting: ServedRobot, short_folder: Path) -> None:
    resting.robot.run_until(lambda: resting.mode is Mode.IDLE and not resting.robot.loop.faults.present, 3.0)

    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        await pilot.press("a")
        await until(app, pilot, lambda: "Arm the robot?" in shown(app))
        await pilot.press("n", "y")  # no question is open at the second key
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


def test_help_explains_every_key_and_keeps_the_alarm(walked: ServedRobot, short_folder: Path) -> None:
    async def script(app: WatchApp, pilot: Pilot[int]) -> None:
        await pilot.press("question_mark")
        await until(app, pilot, lambda: "emergency stop" in shown(app))
        assert "WALKING" in shown(app).splitlines()[0]
        await pilot.press("question_mark")
        await until(app, pilot, lambda: "emergency stop" not in shown(app))

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
