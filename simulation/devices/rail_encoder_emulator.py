"""A rail encoder's counter on a pseudo-terminal: it writes the count of a position as an ASCII line."""

from pathlib import Path

from simulation.devices.pseudo_terminal import PseudoTerminal


class EmulatedRailEncoder:
    """Owns the pseudo-terminal that the link `device` points to, and the zero of the count."""

    def __init__(self, device: Path, metres_per_count: float, label: str = "", line_end: str = "\r\n") -> None:
        self.device = device
        self.metres_per_count, self.label, self.line_end = metres_per_count, label, line_end
        self.lost_lines = 0  # that found the computer's buffer full
        self.plug_in()

    def plug_in(self, position_m: float = 0.0) -> None:
        """The counter starts at zero wherever it is."""
        self._zero_m = position_m
        self._terminal = PseudoTerminal(self.device)

    def send(self, position_m: float) -> None:
        self.write(f"{self.label}{round((position_m - self._zero_m) / self.metres_per_count)}{self.line_end}".encode())

    def write(self, data: bytes) -> None:
        """Write raw bytes, malformed lines included."""
        self.lost_lines += self._terminal.write(data) == 0

    def unplug(self) -> None:
        self._terminal.close()
