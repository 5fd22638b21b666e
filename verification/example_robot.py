"""The robots that the benchmarks run: of the example configuration, and its right flipper alone; with any drives."""

from dataclasses import replace
from pathlib import Path

from control.records import Rig
from drivers.drive_types import DEFAULT
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from simulation.harness.drive_presets import DRIVES, calibrated, with_drive_type

EXAMPLE = Path(__file__).parent.parent / "systemd" / "mudskipper.toml"


def require_drive(drive: str) -> None:
    """End the benchmark where no such drive exists."""
    if drive not in DRIVES:
        raise SystemExit(f"--drive {drive}: must be one of {', '.join(DRIVES)}")


def load_example(drive: str = DEFAULT) -> Configuration:
    return parse_configuration(calibrated(with_drive_type(EXAMPLE.read_text(encoding="utf-8"), drive)), EXAMPLE)


def load_one_flipper() -> Configuration:
    """The right flipper of the example: two motors on one bus."""
    example, rig = load_example(), Rig(("right",))
    drives = {joint: example.drive[joint] for joint in rig.joints}
    buses = {drive.bus: example.bus[drive.bus] for drive in drives.values()}
    return replace(example, rig=rig, drive=drives, bus=buses, friction={})
