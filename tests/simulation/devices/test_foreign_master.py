"""A drive follows a foreign master until the loop's next command, and the master's frames are on the bus."""

import pytest

from drivers.can.frames import Frame
from firmware_host.configuration.configuration import Configuration
from simulation.devices.foreign_master import ForeignMaster
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

TORQUE_NM = 0.02


@pytest.fixture
def robot(configuration: Configuration) -> Lockstep:
    lockstep = Lockstep(configuration, Track([(1.0, MUDS["48.5"])]))
    lockstep.arm()
    return lockstep


def heard_frames(robot: Lockstep, master: ForeignMaster, ticks: int) -> tuple[list[float], list[Frame]]:
    """Return the torque of the master's drive in each tick, and the master's frames on its bus."""
    torques_nm, port = [], robot.buses["left"].open()
    robot.robot.foreign_masters.append(master)
    for _ in range(ticks):
        robot.step()
        torques_nm.append(master.drive.torque_nm(robot.robot.now_s))
    own = master.drive.forge_torque(TORQUE_NM)
    return torques_nm, [frame for frame in port.receive() if frame == own]


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("every", [1, 2, 4])
def test_the_drive_follows_it_after_every_nth_command(robot: Lockstep, joint: int, every: int) -> None:
    robot.loop.drives.close()  # without its ports the loop does not react
    master = ForeignMaster(robot.robot.drives[joint], TORQUE_NM, every)
    loop_port = robot.buses["left"].open()
    robot.robot.advance(robot.robot.now_s + 0.002)  # executes the loop's last commands
    robot.robot.foreign_masters.append(master)
    for number in range(1, 9):
        loop_port.send(master.drive.forge_torque(0.01))
        robot.robot.advance(robot.robot.now_s + 0.002)
        expected_nm = 0.01 if number % every else TORQUE_NM
        assert master.drive.torque_nm(robot.robot.now_s) == pytest.approx(expected_nm)


@pytest.mark.parametrize("heard", [False, True])
def test_its_frames_are_on_the_bus_where_it_uses_the_bus(robot: Lockstep, heard: bool) -> None:
    master = ForeignMaster(robot.robot.drives[1], TORQUE_NM, every=2, heard=heard)
    torques_nm, frames = heard_frames(robot, master, 6)
    assert any(torque_nm == pytest.approx(TORQUE_NM) for torque_nm in torques_nm)
    assert len(frames) == (3 if heard else 0)


def test_of_two_masters_that_are_alike_each_ends_by_itself(robot: Lockstep) -> None:
    masters = [ForeignMaster(robot.robot.drives[0], TORQUE_NM) for _ in range(2)]
    first, second = masters
    masters.remove(second)
    assert masters[0] is first
