"""What the axes of every type of drive notice, over simulated drives on one bus."""

from __future__ import annotations

import pytest

from tests.drivers.bench.simulated_bus import simulated
from tests.simulation.devices.driven_drives import TYPES, DrivenDrives

each_type = pytest.mark.parametrize("name", TYPES)


@each_type
def test_a_pause_of_this_program_is_no_restart_and_no_second_drive(name: str) -> None:
    drives = DrivenDrives(name)
    for _ in range(3):
        drives.tick(count=400)
        drives.wait(2.0)
    drives.tick(count=400)
    assert [(axis.health.restarts, axis.health.duplicate_id) for axis in drives.drives.axes] == [(0, False)] * 4


@each_type
def test_two_drives_with_one_id_are_noticed(name: str) -> None:
    kind, _, model = name.partition(":")
    drives = DrivenDrives(name)
    drives.devices.append(simulated(kind, 1, **{"model": model} if model else {}))
    drives.tick(count=400)
    assert [axis.health.duplicate_id for axis in drives.drives.axes] == [True, False, False, False]


@each_type
def test_a_torque_of_another_program_is_counted_for_its_drive(name: str) -> None:
    drives = DrivenDrives(name)
    drives.tick(count=400)
    drives.far.send(drives.devices[0].forge_torque(0.1))
    drives.tick()
    assert [axis.health.foreign_commands for axis in drives.drives.axes] == [1, 0, 0, 0]
