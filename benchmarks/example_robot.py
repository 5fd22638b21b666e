"""The robot that the benchmarks run: the one of the example configuration."""

from pathlib import Path

from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration

EXAMPLE = Path(__file__).parent.parent / "systemd" / "mudskipper.toml"


def load_example() -> Configuration:
    return load_configuration(EXAMPLE)
