"""The example configuration, which all walks in these tests share."""

import pytest

from firmware_host.configuration import Configuration, load_configuration
from simulation.lockstep import default_configuration_path


@pytest.fixture(scope="session")
def configuration() -> Configuration:
    return load_configuration(default_configuration_path())
