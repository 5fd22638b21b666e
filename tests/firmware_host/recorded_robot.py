"""A robot on firm mud that stores the events of its log, and in which anything can fail."""

from typing import Any

from firmware_host.configuration.configuration import Configuration
from simulation.mud.clay import MUDS, Clay
from simulation.mud.track import Track
from tests.recorded_events import EventRecorder
from verification.faults.failing_robot import FailingRobot


class RecordedRobot(FailingRobot):
    def __init__(self, configuration: Configuration, clay: Clay = MUDS["48.5"], **options: Any) -> None:
        self.recorder = EventRecorder()
        super().__init__(configuration, Track([(5.0, clay)]), recorder=self.recorder, **options)

    @property
    def fault_names(self) -> set[str]:
        """Return the names of the faults that are present."""
        return {fault.name for fault in self.loop.faults.present}

    @property
    def energised(self) -> list[bool]:
        """Return for each drive whether it may exert torque."""
        return [drive.energised for drive in self.robot.drives]
