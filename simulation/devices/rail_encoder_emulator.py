"""A rail encoder's counter on a pseudo-terminal: it writes the count of a position as an ASCII line."""

from pathlib import Path

from simulation.devices.pseudo_terminal import PseudoTerminal


class EmulatedRailEncoder:
    """Owns the pseudo-terminal that the link `device` points to."""

    def __init__(self, device: Path, metres_per_count: float, label: str = "") -> None:
        self.device = device
        self.metres_per_count, self.label = metres_per_count, label
        self.lost_lines = 0  # that found the computer's buffer full
        self.plug_in()

    def plug_in(self) -> None:
        self._terminal = PseudoTerminal(self.device)

    def send(self, position_m: float) -> None:
        self.write(f"{self.label}{round(position_m / self.metres_per_count)}\r\n".encode())

    def write(self, data: bytes) -> None:
        """Write raw bytes, malformed lines included."""
        self.lost_lines += self._terminal.write(data) == 0

    def unplug(self) -> None:
        self._terminal.close()
