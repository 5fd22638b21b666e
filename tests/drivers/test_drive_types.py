"""Every type of drive lists the arbitration ids that it uses, so that two types on one bus never share one."""

from dataclasses import replace

import pytest

from drivers.can.mock_bus import MockBus
from drivers.drive import FD, DriveParameters
from drivers.drive_types import DRIVE_TYPES, collisions
from drivers.mit.parameters import MitParameters
from drivers.odrive.parameters import OdriveParameters

DAMIAO, CUBEMARS = MitParameters("a", 3), MitParameters("a", 3, model="AK80-9")
EXAMPLES = [*(each.parameters(bus="a", node_id=3, type=name) for name, each in DRIVE_TYPES.items()), CUBEMARS]


@pytest.mark.parametrize("parameters", EXAMPLES, ids=lambda each: f"{each.type} {getattr(each, 'model', '')}")
def test_everything_that_a_drive_is_heard_or_commanded_by_is_listed(parameters: DriveParameters) -> None:
    drive_type = DRIVE_TYPES[parameters.type]
    table = drive_type.gate_table(parameters)
    sent = {
        table.torque_id,
        *table.always,
        *table.while_open,
        *table.checks,
        *(f.arbitration_id for f in table.requests),
    }
    flag = FD if drive_type.kind.is_fd else 0
    heard = drive_type.make_axis("left_sweep", parameters, MockBus().open(), ()).receivers
    announced = drive_type.announces(parameters.node_id).arbitration_id
    assert {*heard, *(identifier | flag for identifier in {*sent, announced})} <= drive_type.identifiers(parameters)


@pytest.mark.parametrize("other", [DAMIAO, CUBEMARS])
def test_an_odrive_of_node_0_uses_the_ids_of_every_drive_in_mit_mode(other: MitParameters) -> None:
    odrive = OdriveParameters("a", 0)
    assert list(collisions({"left_sweep": odrive, "left_adduction": other})) == [("left_sweep", "left_adduction", 0)]
    assert not list(collisions({"left_sweep": replace(odrive, bus="b"), "left_adduction": other}))
    assert not list(collisions({"left_sweep": replace(odrive, node_id=1), "left_adduction": other}))


def test_drives_of_one_type_share_ids_that_they_distinguish_by_the_payload() -> None:
    drives = {"left_sweep": replace(DAMIAO, node_id=1), "left_adduction": replace(CUBEMARS, node_id=2)}
    assert not list(collisions(drives))


def test_the_registers_of_a_damiao_have_an_id_of_a_last_odrive() -> None:
    """0x7FF is the last message of an ODrive with node id 63, beyond the largest that can be configured."""
    assert not list(collisions({"left_sweep": OdriveParameters("a", 62), "left_adduction": DAMIAO}))
