"""Each drive of the simulated robot receives and answers only on its own bus."""

from control.records import JOINTS
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockBus, MockPort
from drivers.odrive.codec import ESTOP, GET_VERSION, arbitration_id
from simulation.body.plant_parameters import PlantParameters
from simulation.devices.drive import SimulatedDriveParameters
from simulation.harness.robot import SimulatedRobot
from simulation.mud.clay import MUDS
from simulation.mud.track import Track


def make_robot() -> tuple[SimulatedRobot, dict[str, MockPort]]:
    """Return a robot with node ids 0 and 1 on each of two buses, and the other ends of the buses."""
    buses = {name: MockBus() for name in ("left", "right")}
    far = {name: bus.open() for name, bus in buses.items()}
    robot = SimulatedRobot(
        PlantParameters(),
        Track([(1.0, MUDS["48.5"])]),
        {joint: SimulatedDriveParameters(node_id=int(joint.endswith("adduction"))) for joint in JOINTS},
        {joint: joint.split("_")[0] for joint in JOINTS},
        {name: bus.open() for name, bus in buses.items()},
    )
    return robot, far


def test_a_command_reaches_the_node_on_its_bus_only() -> None:
    robot, far = make_robot()
    far["right"].send(Frame(arbitration_id(0, ESTOP)))
    robot.advance(0.0)
    assert [drive.failed for drive in robot.drives] == [False, False, True, False]


def test_an_answer_goes_to_the_bus_of_the_question() -> None:
    robot, far = make_robot()
    far["left"].send(Frame(arbitration_id(1, GET_VERSION), is_remote=True))
    robot.advance(0.0)
    assert [frame.arbitration_id for frame in far["left"].receive()] == [arbitration_id(1, GET_VERSION)]
    assert far["right"].receive() == []


def test_time_that_has_passed_is_not_lived_again() -> None:
    robot, far = make_robot()
    robot.advance(0.2)
    far["left"].receive()
    robot.advance(0.2)
    assert far["left"].receive() == []
    assert 0.199 <= robot.now_s <= 0.2
