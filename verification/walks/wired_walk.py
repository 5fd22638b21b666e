"""Puts a lockstep of robot and loop on given wiring, with a log."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from drivers.drive_types import make_drives
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import Recorder, Recording
from firmware_host.loop import Loop
from simulation.devices.motion_capture import SimulatedPose
from simulation.devices.motion_capture_parameters import AT_EVERY_TICK
from simulation.harness.lockstep import Lockstep, drives_of, plant_of
from simulation.harness.robot import SimulatedRobot
from simulation.mud.track import paper_track
from verification.walks.wirings import Wiring, make_wiring

POSE_SEED = 2


@contextmanager
def open_wiring(variant: str, configuration: Configuration, folder: Path) -> Iterator[tuple[Wiring, Recorder]]:
    """Opens wiring, and a recorder whose log is in the folder; closes both at the end."""
    with ExitStack() as stack:
        wiring = make_wiring(variant, configuration.bus, folder)
        for port in (*wiring.robot.values(), *wiring.loop.values()):
            stack.callback(port.close)
        recorder = Recorder(folder / "walk.mcap", configuration.text, {}, rig=configuration.rig)
        stack.callback(recorder.close, timeout_s=10.0)
        yield wiring, recorder


def wire(walk: Lockstep, configuration: Configuration, wiring: Wiring, recorder: Recording) -> None:
    """Replaces robot and loop of a lockstep that has not begun; the robot is on the paper's track."""
    walk.robot = SimulatedRobot(
        plant_of(configuration),
        paper_track(),
        drives_of(configuration),
        {joint: configuration.drive[joint].bus for joint in configuration.rig.joints},
        wiring.robot,
    )
    drives = make_drives(configuration.drive, wiring.loop, configuration.limits, configuration.watchdog_endpoints)
    pose = SimulatedPose(walk.robot.plant, AT_EVERY_TICK, POSE_SEED)

    def now_s() -> float:
        return walk.now_s

    walk.loop = Loop(configuration, drives, pose, recorder, now_s, now_s)
