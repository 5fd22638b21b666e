"""Logs of simulated walks over the paper's muds, for tests that read logs."""

from pathlib import Path

from control.controller import WalkOrder
from control.modes import Mode
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import Recorder
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track


def record_walks(path: Path, configuration: Configuration, *strides: int) -> Lockstep:
    """Record walks of these numbers of strides, with a hold between them; return the robot after the last walk."""
    recorder = Recorder(path, configuration.text, {"robot": "test"}, rig=configuration.rig)
    robot = Lockstep(configuration, paper_track(), recorder=recorder)
    walk_and_hold(robot, *strides)
    assert recorder.dropped == 0
    assert recorder.close(20.0)
    return robot


def walk_and_hold(robot: Lockstep, *strides: int, rest_s: float = 0.0) -> list[tuple[float, float]]:
    """Arm the robot and walk, with a rest before each walk; return begin and end of each walk by the robot's clock."""
    robot.arm()
    spans_s = []
    for count in strides:
        robot.run_for(rest_s)
        begun_s = robot.now_s
        robot.walk(WalkOrder(0.03, True, count))
        robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 20.0)
        spans_s.append((begun_s, robot.now_s))
    return spans_s
