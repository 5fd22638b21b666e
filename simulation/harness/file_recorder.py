"""Writes a log in the loop's own process, for a simulated loop that may wait for the disk."""

import time
from pathlib import Path

from firmware_host.configuration.configuration import Configuration
from firmware_host.log.log_file import LogFile
from firmware_host.log.log_folder import new_run_id
from firmware_host.log.recorder import NullRecorder
from firmware_host.software_version import build_metadata

ROWS_AT_ONCE = 1000


class FileRecorder(NullRecorder):
    """Owns the file and the rows that are not in it yet. Every method may raise OSError."""

    def __init__(self, path: Path, configuration: Configuration, metadata: dict[str, str] | None = None) -> None:
        """`path` must not exist yet."""
        robot = configuration.robot.name
        known = {"robot": robot, "run_id": new_run_id(robot), "segment": "0"} | build_metadata() | (metadata or {})
        opening = {
            "wall_minus_monotonic_ns": time.time_ns(),  # its loop's clock begins at zero
            "configuration_text": configuration.text,
            "metadata": known,
            "flippers": configuration.rig.flippers,
        }
        self.path = path
        self.is_open = True
        self._file = LogFile(path, opening)
        self._rows: list[tuple[int, bytes]] = []

    def put(self, number: int, row: bytes) -> bool:
        self._rows.append((number, row))
        if len(self._rows) >= ROWS_AT_ONCE:
            self._write()
        return True

    def _write(self) -> None:
        self._file.write(self._rows)
        self._rows = []

    def flush(self) -> None:
        """Make every row so far readable."""
        self._write()
        self._file.flush()

    def close(self, timeout_s: float = 0.0) -> bool:
        """Finish the file, however long that takes."""
        if self.is_open:
            self._write()
            self.path = self._file.finish()
            self.is_open = False
        return True
