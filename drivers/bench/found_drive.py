"""One drive that answers on a bus."""

from typing import NamedTuple


class FoundDrive(NamedTuple):
    """One drive that answers on a bus. Empty texts are not known."""

    type: str
    node_id: int
    hardware: str = ""  # or what is known of the motor's model
    firmware: str = ""
    serial_number: str = ""
    problem: str = ""  # why this program cannot use it as it is
    model: str = ""  # of the motor, as the configuration names it: one whose ranges the drive has
