"""Runs the simulated robot and the daemon's own loop in step, as Lockstep does, but without buses and frames.

Plant, controller, estimator and choice of depth are the same, and so are the samples that they get, but for the wire's
rounding. No failures can be injected.
"""

from typing import Any

from control.records import Joints
from drivers.drives import Drives
from drivers.fault_injection.failures import Failures
from firmware_host.configuration.configuration import Configuration
from simulation.devices.direct import DirectDrives
from simulation.harness.direct_robot import DirectRobot
from simulation.harness.load_monitor import LoadMonitor
from simulation.harness.lockstep import Lockstep


class Direct(Lockstep):
    """Takes the arguments of Lockstep but `failures` and `buses`."""

    _kind_of_robot = DirectRobot

    def __init__(self, configuration: Configuration, *args: Any, **rest: Any) -> None:
        super().__init__(configuration, *args, **rest)
        self.loop.fault_monitor = LoadMonitor(configuration, self.loop.drives, self.period_s)

    def _connect(self, configuration: Configuration, failures: Failures | None) -> Drives:
        assert failures is None, "nothing can fail"
        drives: Joints[Any] = self.robot.drives
        return DirectDrives(drives, configuration.rig.joints, configuration.limits)
