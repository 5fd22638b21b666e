"""Draws the pictures of the page on `watch` with the screen of a simulated robot: `make watch-pictures`."""

import asyncio
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from textual.pilot import Pilot

from command_line.watch.feed import Feed
from command_line.watch.screen_app import WatchApp
from control.records import JOINTS
from drivers.fault_injection.failures import Failures
from firmware_host.configuration.loading import parse_configuration
from simulation.harness.drive_presets import calibrated
from tests.command_line.watch.served_robot import ServedRobot, walking_robot
from tests.folders import EXAMPLE_CONFIGURATION

PERIOD_S = 0.1
WALK_S = 30.0  # fills the plots
SILENT_S = 1.2  # of the robot's time, which a busy machine slows down


async def draw(app: WatchApp, robot: ServedRobot, folder: Path) -> None:
    async with app.run_test(size=(80, 24)) as pilot:
        await pilot.pause(WALK_S)
        await save(pilot, folder / "watch.svg")
        await pilot.press("j")
        await save(pilot, folder / "watch_joints.svg")
        await pilot.press("j", "j", "j")
        for joint in JOINTS:
            robot.robot.fail(joint, "off", 60.0)
        silent_s = robot.robot.now_s + SILENT_S
        while robot.robot.now_s < silent_s:
            await pilot.pause(PERIOD_S)
        await save(pilot, folder / "watch_fault.svg")


async def save(pilot: Pilot[int], path: Path) -> None:
    await pilot.pause(2.0 * PERIOD_S)
    path.write_text(pilot.app.export_screenshot(title="mudskipper watch"), encoding="utf-8")


def main(folder: Path) -> None:
    configuration = parse_configuration(calibrated(EXAMPLE_CONFIGURATION.read_text(encoding="utf-8")))
    robot = ServedRobot(walking_robot(configuration, Failures(configuration.bus)))
    with TemporaryDirectory(prefix="mud-") as name, robot.served(socket := Path(name) / "s"):
        app = WatchApp(Feed(socket, PERIOD_S), ["left", "right"], PERIOD_S, lambda method: method)
        asyncio.run(draw(app, robot, folder))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
