"""The public interface for people's own scripts and notebooks.

`open_log` reads a log into numpy arrays, `replay` estimates the mud from a log again, `Client` operates a robot through
the daemon's socket, and `simulate` starts a simulated one on a `Ground`, which may walk a `Gait`. `mudskipper.gym` is
imported apart, as it needs Gymnasium.
"""

from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.software_version import software_version
from logs.files.log_error import LogError
from mudskipper.client import Client
from mudskipper.ground_and_gait import Gait, Ground
from mudskipper.logs import OpenedLog, open_log, replay
from mudskipper.simulated_robot import simulate
from operator_client.status_client import CallRefusedError, NoDaemonError, NotPermittedError

__version__ = software_version()
__all__ = [
    "CallRefusedError",
    "Client",
    "ConfigurationError",
    "Gait",
    "Ground",
    "LogError",
    "NoDaemonError",
    "NotPermittedError",
    "OpenedLog",
    "__version__",
    "open_log",
    "replay",
    "simulate",
]
