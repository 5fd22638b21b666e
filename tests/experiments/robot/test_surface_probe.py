"""A probe finds the mud's surface within the error that it claims, and says where there is none."""

from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np
import pytest

from control.geometry import FlipperGeometry
from control.records import Rig
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import arm
from experiments.robot.lockstep_robot import LockstepRobot, simulated_configuration
from experiments.robot.surface_probe import Descent, Touch, combined, find_touched, probe_surface
from simulation.harness.direct import Direct
from simulation.harness.file_recorder import FileRecorder
from simulation.harness.lockstep import plant_of
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track

GEOMETRY = FlipperGeometry()
RATE_HZ, SPEED_M_S, ABOVE_M = 200.0, 0.003, 0.012
NOISE_N, FRICTION_N, SLOPE_N_M = 0.09, 0.35, 16.0  # of the mud that falls off on the way down
UNEVEN_M = 0.0008
ROWS = np.dtype([("stamp_s", float), ("depth_m", float, (1,)), ("force_z_n", float, (1,))])


def robot_above(lower_m: float, folder: Path) -> LockstepRobot:
    """Return a robot with one flipper on a fixed base, whose mud lies deeper than it is configured."""
    configuration = simulated_configuration("[estimation]\nfixed_base = true\n", rig=Rig(("left",)))
    recorder = FileRecorder(folder / "log.mcap", configuration)
    axis_height_m = configuration.geometry.axis_height_m + lower_m
    plant = plant_of(
        configuration,
        replace(LAB, surface_sd_m=0.0, trial_surface_sd_m=0.0),
        fixed_base=True,
        geometry=replace(configuration.geometry, axis_height_m=axis_height_m),
    )
    lockstep = Direct(configuration, Track([(5.0, Clay("mud", 1500.0))]), recorder=recorder, plant=plant)
    return LockstepRobot(lockstep, recorder)


def test_a_surface_off_its_nominal_height_is_found_and_the_robot_still_holds(tmp_path: Path) -> None:
    robot, lower_m = robot_above(-0.004, tmp_path), -0.004
    arm(robot)
    found = probe_surface(robot, lambda done, total: None)
    assert robot.call("status")["mode"] == "hold"
    robot.close()
    assert abs(found.depth_m - lower_m) < 2.0 * found.std_error_m < 0.0015
    assert len(found.touches) == 5 and found.scatter_m < 0.0005
    assert max(touch.surface.depth_m for touch in found.touches) - lower_m < 0.001  # and no deeper


def test_without_ground_or_torque_it_ends_with_raised_flippers(tmp_path: Path) -> None:
    robot = robot_above(0.05, tmp_path)
    with pytest.raises(BenchError, match="hold"):
        probe_surface(robot, lambda done, total: None)
    arm(robot)
    with pytest.raises(BenchError, match="25 mm"):
        probe_surface(robot, lambda done, total: None)
    assert abs(robot.call("status")["drives"][1]["angle_rad"]) < radians(1.0)
    robot.close()


@pytest.mark.parametrize("bearing_n", [0.5, 3.0])
def test_the_claimed_error_covers_the_truth_over_twenty_seeds(bearing_n: float) -> None:
    deviations = []
    for seed in range(20):
        random = np.random.default_rng(seed)
        surface_m = random.normal(0.0, 0.003)
        found = combined([synthetic_touch(random, surface_m, bearing_n) for _ in range(10)], 0.0004)
        deviations.append(abs(found.depth_m - surface_m) / found.std_error_m)
        assert 0.5 * UNEVEN_M < found.scatter_m < 2.0 * UNEVEN_M
    assert sum(deviation < 2.0 for deviation in deviations) >= 18


def synthetic_touch(random: np.random.Generator, surface_m: float, bearing_n: float) -> Touch:
    """Return a touch of mud whose bearing grows over half a millimetre and a little more with depth."""
    own_m = surface_m + random.normal(0.0, UNEVEN_M)
    depths_m = np.arange(-ABOVE_M, own_m + 0.004, SPEED_M_S / RATE_HZ)
    corner_m = 0.0125 * -np.sin([GEOMETRY.adduction_rad(0.0, depth_m) for depth_m in depths_m])
    below_m = np.maximum(0.0, depths_m + corner_m - own_m)
    forces_n = FRICTION_N + SLOPE_N_M * depths_m + bearing_n * (np.minimum(1.0, below_m / 5e-4) + 40.0 * below_m)
    rows = np.zeros(len(depths_m), ROWS)
    rows["stamp_s"] = np.arange(1, len(depths_m) + 1) / RATE_HZ
    rows["depth_m"][:, 0] = depths_m
    rows["force_z_n"][:, 0] = forces_n + random.normal(0.0, NOISE_N, len(depths_m))
    descent = Descent("left", 0.0, 0.0, float(rows["stamp_s"][-1]), own_m + 0.003)
    return Touch("left", 0.0, find_touched(rows, 0, GEOMETRY, descent))
