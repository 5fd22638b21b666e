"""How fast MuJoCo and PyBullet step a similar robot, next to this project's plant: ratios in one run, on one core.

Two flippers of two joints in steps of 1 ms from Python, with the same PD controller along the same sines. The others
have the model of `mudskipper ros2`, on a fixed base over a rigid ground that the plates meet; the plant has its body
and mud of 48.5 % water. Needs `pip install mujoco pybullet`. Time is that of the processor.
"""

import sys
from collections.abc import Callable
from functools import partial
from math import pi, sin
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any
from xml.etree import ElementTree

from control.records import Joints
from simulation.body.plant import STEP_S, Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from verification.benchmark import Report, measure_in_turns, run_benchmark

MODEL = Path(__file__).parents[2] / "command_line/ros2/mudskipper_msgs/urdf/mudskipper.urdf"
GROUND_M = -0.064  # its surface, from the joints; level plates are 1.4 cm above it
GROUND = '<collision><origin xyz="0 0 -0.114"/><geometry><box size="9 9 0.1"/></geometry></collision>'
INERTIAL = '<inertial><mass value="0.1"/><inertia ixx="4e-4" iyy="4e-4" izz="4e-4" ixy="0" ixz="0" iyz="0"/></inertial>'
AT = [1, 0, 3, 2]  # the robot's joints in the order of the model
Stepped = tuple[Callable[[], Any], Callable[[list[float]], object]]  # the joints' angles and velocities, and a step


def torques_nm(time_s: float, angles_rad: Any, velocities_rad_s: Any) -> list[float]:
    turn = 2.0 * pi * time_s / 1.5
    targets_rad = (0.5 * sin(turn), -0.25 + 0.25 * sin(turn + 1.6)) * 2
    motions = zip(targets_rad, angles_rad, velocities_rad_s, strict=True)
    return [max(-0.8, min(8.0 * (target - angle) - 0.1 * velocity, 0.8)) for target, angle, velocity in motions]


def write_model(path: Path, ground: bool) -> str:
    """Write the model with masses; of its visible boxes the plates collide, and its base may have the ground."""
    model = ElementTree.parse(MODEL)
    base, *links = model.findall("link")
    if ground:
        base.append(ElementTree.fromstring(GROUND))
    for link in links:
        link.append(ElementTree.fromstring(INERTIAL))
        for plate in link.findall("visual")[1:]:
            plate.tag = "collision"
    model.write(path)
    return str(path)


def plant_stepped(_: Path) -> Stepped:
    plant = Plant(PlantParameters(), Track([(100.0, MUDS["48.5"])]))
    return lambda: (plant.angles_rad, plant.velocities_rad_s), lambda nm: plant.step(STEP_S, Joints(*nm))


def mujoco_stepped(path: Path) -> Stepped:
    import mujoco

    model = mujoco.MjModel.from_xml_path(write_model(path, ground=True))
    model.opt.timestep = STEP_S
    data = mujoco.MjData(model)

    def step(nm: list[float]) -> None:
        data.qfrc_applied[AT] = nm
        mujoco.mj_step(model, data)

    return lambda: (data.qpos[AT].tolist(), data.qvel[AT].tolist()), step


def pybullet_stepped(path: Path) -> Stepped:
    import pybullet as bullet

    bullet.connect(bullet.DIRECT)
    bullet.setTimeStep(STEP_S)
    bullet.setGravity(0.0, 0.0, -9.81)
    bullet.createMultiBody(0.0, bullet.createCollisionShape(bullet.GEOM_PLANE), basePosition=[0.0, 0.0, GROUND_M])
    robot = bullet.loadURDF(write_model(path, ground=False), useFixedBase=True)
    bullet.setJointMotorControlArray(robot, AT, bullet.VELOCITY_CONTROL, forces=[0.0] * 4)  # its own motors

    def step(nm: list[float]) -> None:
        bullet.setJointMotorControlArray(robot, AT, bullet.TORQUE_CONTROL, forces=nm)
        bullet.stepSimulation()

    return lambda: list(zip(*bullet.getJointStates(robot, AT), strict=True))[:2], step


def times_real(make: Callable[[], Stepped], seconds: float) -> float:
    """Return simulated time over time of the processor."""
    (motion, step), begin_s = make(), process_time()
    for number in range(round(seconds / STEP_S)):
        step(torques_nm(number * STEP_S, *motion()))
    return seconds / (process_time() - begin_s)


def measure(folder: Path, *, rounds: int = 5, seconds: float = 6.0) -> Report:
    makers = {"plant": plant_stepped, "mujoco": mujoco_stepped, "pybullet": pybullet_stepped}
    turns = {name: partial(times_real, partial(make, folder / "robot.urdf"), seconds) for name, make in makers.items()}
    times = {name: median(each) for name, each in measure_in_turns(turns, rounds).items()}
    return {"times_real": times, "times_plant": {name: each / times["plant"] for name, each in times.items()}}


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
