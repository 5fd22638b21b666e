"""The robot that the benchmarks run: the one of the example configuration, with drives of any type."""

from pathlib import Path

from drivers.drive_types import DEFAULT
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from simulation.harness.drive_presets import with_drive_type

EXAMPLE = Path(__file__).parent.parent / "systemd" / "mudskipper.toml"


def load_example(drive: str = DEFAULT) -> Configuration:
    return parse_configuration(with_drive_type(EXAMPLE.read_text(encoding="utf-8"), drive), EXAMPLE)
