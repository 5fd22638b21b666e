"""The diagnostic console of a simulated moteus: text to it and from it, by which its settings are read and changed.

`conf set` changes the memory, which a restart forgets; `conf write` stores it and `conf load` loads what is stored.
"""

from math import isfinite, nan

from drivers.moteus.settings import KV, MAX_CURRENT, RATIO, TIMEOUT_MODE, TORQUE_FACTOR, WATCHDOG
from drivers.moteus.setup import ID
from simulation.devices.drive import SimulatedDriveParameters

UNKNOWN_KEY = "ERR error reading"


class MoteusConsole:
    """Owns the drive's settings and the console's output that was not polled for yet."""

    def __init__(self, parameters: SimulatedDriveParameters) -> None:
        self.settings = {
            MAX_CURRENT: parameters.current_limit_a,
            KV: TORQUE_FACTOR / parameters.torque_constant_nm_a,
            RATIO: 1.0,
            TIMEOUT_MODE: float(parameters.timeout_mode),
            WATCHDOG: parameters.watchdog_s or nan,
            ID: float(parameters.node_id),
        }
        self.stored = dict(self.settings)
        self._input = self._output = b""

    def write(self, text: bytes) -> None:
        """Execute the lines that are complete."""
        *lines, self._input = (self._input + text).split(b"\n")
        for line in lines:
            self._output += f"{self._answer(line.decode(errors='replace').split())}\r\n".encode()

    def _answer(self, words: list[str]) -> str:
        match words:
            case ["conf", "get", key] if key in self.settings:
                value = self.settings[key]
                return f"{value:.0f}" if key in (TIMEOUT_MODE, ID) else f"{value:.6f}" if isfinite(value) else "nan"
            case ["conf", "set", key, value] if key in self.settings:
                self.settings[key] = float(value)
                return "OK"
            case ["conf", "write"]:
                self.stored = dict(self.settings)
                return "OK"
            case ["conf", "load"]:
                self.load()
                return "OK"
        return UNKNOWN_KEY

    def load(self) -> None:
        """Restore what is stored, as a restart does."""
        self.settings.update(self.stored)

    def read(self, most_bytes: int) -> bytes:
        text, self._output = self._output[:most_bytes], self._output[most_bytes:]
        return text
