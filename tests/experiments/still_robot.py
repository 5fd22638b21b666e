"""A robot at rest, for tests: time passes for it, and it records nothing."""

from pathlib import Path

from firmware_host.configuration.configuration import Configuration
from logs.files.log_reader import Log
from tests.experiments.synthetic_strides import CONFIGURATION


class StillRobot:
    """A BenchRobot without `call`, which each test defines."""

    configuration: Configuration = CONFIGURATION

    def __init__(self, mode: str) -> None:
        self.mode = mode
        self.now_s = 0.0
        self.closed = False

    def wait(self, duration_s: float) -> None:
        self.now_s += duration_s

    def record(self, from_s: float, to_s: float) -> Log:
        raise AssertionError("nothing was recorded")

    def copy_logs(self, folder: Path) -> list[Path]:
        return []

    def close(self) -> None:
        self.closed = True
