"""A configured robot on simulated buses; the commands of the bench run on it in simulated time."""

import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random
from typing import Any

import pytest

from command_line.drives import opened_buses
from firmware_host.configuration.loading import load_configuration
from simulation.devices.drive_types import make_simulated_drive
from simulation.harness.drive_presets import with_drive_type
from simulation.harness.local_setup import write_local_setup
from simulation.harness.lockstep import drives_of
from tests.command_line.command_lines import run
from tests.drivers.bench.simulated_bus import SimulatedBus


class Bench:
    """Owns the configuration file and the simulated buses of a robot with one type of drive."""

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch, drive_type: str = "odrive", **changes: Any) -> None:
        self.config = write_local_setup(folder, folder)
        self.config.write_text(with_drive_type(self.config.read_text(encoding="utf-8"), drive_type), encoding="utf-8")
        configuration = load_configuration(self.config)
        self.drives = {
            joint: make_simulated_drive(each, Random(1))
            for joint, each in drives_of(configuration, serial_number="0badcafe", **changes).items()
        }
        self.buses = {
            name: SimulatedBus(*(self.drives[joint] for joint, each in configuration.drive.items() if each.bus == name))
            for name in configuration.bus
        }
        patch.setattr(opened_buses, "open_ports", self._open_ports)
        patch.setattr(opened_buses, "make_bench_port", lambda port: self._by_port[port].bench_port())

    def _open_ports(self, buses: Mapping[str, object]) -> dict[str, object]:
        self._by_port = {self.buses[name].port: self.buses[name] for name in buses if name in self.buses}
        return {name: self.buses[name].port for name in buses}

    def run(self, command: str, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a command of `mudskipper drives` on this robot."""
        return run("drives", command, "--config", str(self.config), *arguments)

    def change(self, old: str, new: str) -> None:
        """Change the text of the configuration."""
        text = self.config.read_text(encoding="utf-8")
        assert old in text
        self.config.write_text(text.replace(old, new, 1), encoding="utf-8")


MakeBench = Callable[..., Bench]  # of the type of drive, and changes of its parameters
