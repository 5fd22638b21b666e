"""Logs of simulated walks over the paper's muds, for tests that read logs."""

from __future__ import annotations

from pathlib import Path

from control.controller import WalkOrder
from control.modes import Mode
from firmware_host.configuration import Configuration
from firmware_host.recorder import Recorder
from simulation.lockstep import Lockstep
from simulation.track import paper_track


def record_walks(path: Path, configuration: Configuration, *strides: int) -> Lockstep:
    """One walk after another of so many strides, with a hold between them. The robot as it is afterwards."""
    recorder = Recorder(path, configuration.text, {"robot": "test"})
    robot = Lockstep(configuration, paper_track(), recorder=recorder)
    robot.arm()
    for count in strides:
        robot.walk(WalkOrder(0.03, True, count))
        robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 20.0)
    assert recorder.dropped == 0
    assert recorder.close(20.0)
    return robot
