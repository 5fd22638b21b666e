"""The simulated drives by the type that `[drive.JOINT] type` names."""

from collections.abc import Callable, Mapping, Sequence
from random import Random

from simulation.devices.drive import SimulatedDriveParameters
from simulation.devices.mit.device import SimulatedMit
from simulation.devices.moteus.device import SimulatedMoteus
from simulation.devices.odrive.device import SimulatedOdrive
from simulation.devices.odrive.settings import BUILD
from simulation.devices.odrive05.device import SimulatedOdrive05, join_boards
from simulation.devices.simulated_drive import SimulatedDrive

DriveMaker = Callable[[SimulatedDriveParameters, Random], SimulatedDrive]
SIMULATED_DRIVES: Mapping[str, DriveMaker] = {
    "odrive": SimulatedOdrive,
    "odrive05": SimulatedOdrive05,
    "moteus": SimulatedMoteus,
    "mit": SimulatedMit,
}
PUBLISHED_NUMBERS = BUILD  # of the simulated drives' parameters, where a maker publishes them in a file


def make_simulated_drive(parameters: SimulatedDriveParameters, random: Random) -> SimulatedDrive:
    return SIMULATED_DRIVES[parameters.type](parameters, random)


def connect_drives(drives: Sequence[SimulatedDrive]) -> None:
    """Connect the drives of one bus that are axes of one board."""
    join_boards(drives)
