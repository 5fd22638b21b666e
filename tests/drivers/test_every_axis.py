"""What the axes of every type of drive notice, over simulated drives on one bus."""

from math import isnan

import pytest

from drivers.can.frames import Frame
from drivers.mit import codec
from drivers.mit.settings import PMAX
from tests.drivers.bench.simulated_bus import simulated
from tests.simulation.devices.driven_drives import TICK_S, TYPES, DrivenDrives

each_type = pytest.mark.parametrize("name", TYPES)


@each_type
def test_a_pause_of_this_program_is_no_restart_and_no_second_drive(name: str) -> None:
    drives = DrivenDrives(name)
    for _ in range(2):
        drives.tick(count=400)
        drives.wait(2.0)
    drives.tick(count=400)
    assert [(axis.health.restarts, axis.health.duplicate_id) for axis in drives.drives.axes] == [(0, False)] * 4


@each_type
def test_a_moment_without_questions_is_no_restart_though_earlier_ones_were_lost(name: str) -> None:
    """The bench lets watchdogs expire so: it goes on reading."""
    drives = DrivenDrives(name)
    drives.drives.poll()
    drives.far.receive()  # no drive has power yet
    drives.tick(count=400)
    for _ in range(200):
        drives.wait(TICK_S)
        drives.drives.read(drives.now_s)
    drives.tick(count=10)
    assert [axis.health.restarts for axis in drives.drives.axes] == [0] * 4


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


def test_a_register_that_another_program_writes_is_counted_for_its_drive() -> None:
    """It has the largest of all standard ids."""
    drives = DrivenDrives("mit")
    drives.far.send(Frame(codec.REGISTER_ID, codec.encode_register(1, codec.WRITE, PMAX, bytes(4))))
    drives.tick()
    assert [axis.health.foreign_commands for axis in drives.drives.axes] == [1, 0, 0, 0]


@each_type
@pytest.mark.parametrize("other_nm", [-0.4, 0.0])
def test_a_drive_that_follows_other_torques_than_the_commanded_ones_is_noticed_by_what_it_reports(
    name: str, other_nm: float
) -> None:
    drives = DrivenDrives(name, {"current_noise_a": 0.01})
    drives.arm()
    for tick in range(200):
        drives.tick(0.2)
        if tick % 2:  # a command that does not pass over the bus, as on the drive's serial line
            drives.devices[0].receive(drives.devices[0].forge_torque(other_nm), drives.now_s)
            drives.wait(TICK_S)
    assert [axis.health.setpoint_problem != "" for axis in drives.drives.axes] == [True, False, False, False]


SUPPLIED_A = 0.1 * 0.1 / 0.083  # as the simulated drives take for 0.1 N·m
LESS_REPORTED = {"mit": (23.0, None), "mit:AK80-9": (None, None), "mit:RS05": (None, None)}  # voltage and current


@each_type
@pytest.mark.parametrize("slow_period_s", [0.1, 10.0], ids=["reported", "only when asked"])
def test_the_supply_of_every_drive_is_known_also_of_one_that_reports_it_only_when_asked(
    name: str, slow_period_s: float
) -> None:
    drives = DrivenDrives(name, {"bus_voltage_v": 23.0, "slow_period_s": slow_period_s})
    drives.arm()
    drives.tick(0.1, count=200)
    for axis in drives.drives.axes:
        assert axis.state.closed_loop
        seen = (axis.state.bus_voltage_v, axis.state.bus_current_a)
        for value, expected in zip(seen, LESS_REPORTED.get(name, (23.0, SUPPLIED_A)), strict=True):
            assert isnan(value) if expected is None else value == pytest.approx(expected, rel=0.02)
    assert drives.drives.malformed_frames == 0


@each_type
def test_a_question_for_the_supply_leaves_the_torque_as_it_is(name: str) -> None:
    """The gate compares the next torque with the one before the question."""
    drives = DrivenDrives(name)
    drives.arm()
    drives.tick(0.5)
    for axis in drives.drives.axes:
        axis.request_supply()
    drives.drives.send((0.5,) * 4, 0.0)  # type: ignore[arg-type]
    assert drives.drives.refused_commands == 0
    drives.exchange()
    assert drives.torque_nm() > 0.4
