"""Mud under a simulated robot, prepared as an operator would do it, with a virtual load cell in every stride.

Fresh mud is another position along a track that is long enough: the robot, with torque off, is carried there and its
flippers are laid on the mud. Earlier strokes leave their marks where they were.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import isfinite
from pathlib import Path
from random import Random
from typing import Any

from control.modes import Mode
from control.rate import PERIOD_S
from experiments.robot.bench_robot import disarm
from experiments.robot.lockstep_robot import LockstepRobot
from experiments.study.prompt import GO_ON
from experiments.trials.load_cell_truth import true_coefficients
from experiments.trials.mud_trials import PlannedTrial, Truths
from experiments.trials.trial import TORQUE_ERROR
from firmware_host.configuration.configuration import Configuration
from simulation.body.reference_sensor import StrideTruth, StrokeReference
from simulation.devices.drive import SimulatedDriveParameters
from simulation.devices.motion_capture_parameters import OF_THE_PAPER, MotionCaptureParameters
from simulation.harness.file_recorder import FileRecorder
from simulation.harness.lockstep import Lockstep, drives_of
from simulation.mud.disturbances import LAB, drive_changes
from simulation.mud.track import Track


class ReferenceLockstep(Lockstep):
    """A lockstep robot with the true motion of its flippers since the last walk began."""

    def __init__(self, configuration: Configuration, track: Track, seed: int, **rest: Any) -> None:
        super().__init__(configuration, track, seed, **rest)
        self._reference = StrokeReference(configuration.rig)
        self._walked = False
        self.truths: list[StrideTruth] = []

    def step(self) -> None:
        super().step()
        walks = self.loop.mode is Mode.WALKING
        if walks and not self._walked:
            self._reference.reset()
            self.truths = []
        self._walked = walks
        self.truths += self._reference.step(PERIOD_S, self.robot.plant, self.loop.target.phase)


def simulated_bench(
    folder: Path,
    configuration: Configuration,
    track: Track,
    seed: int,
    position_m: Callable[[PlannedTrial, int], float],
    motion_capture: MotionCaptureParameters = OF_THE_PAPER,
) -> tuple[LockstepRobot, CarriedBed]:
    """Make a robot in a laboratory, with its log in `folder` next to those of earlier ones, and its bed of mud.

    `position_m` takes a trial and the number of earlier preparations, and returns the trial's place along the track.
    """
    recorder = FileRecorder(_new_log(folder), configuration)
    lockstep = ReferenceLockstep(
        configuration,
        track,
        seed,
        recorder=recorder,
        disturbances=LAB,
        fixed_base=configuration.estimation.fixed_base,
        drives=_drives_with_errors(configuration, seed),
        motion_capture=motion_capture,
    )
    robot = LockstepRobot(lockstep, recorder)
    return robot, CarriedBed(robot, lockstep, position_m)


def _new_log(folder: Path) -> Path:
    paths = (folder / f"simulated-{number:03d}.mcap" for number in range(1, 1000))
    return next(path for path in paths if not path.exists())


def _drives_with_errors(configuration: Configuration, seed: int) -> dict[str, SimulatedDriveParameters]:
    """Return motors whose constants differ from the configured ones by the paper's repeatability."""
    random = Random(f"drives {seed}")
    drives = drives_of(configuration, **drive_changes(LAB))
    return {
        joint: replace(drive, torque_constant_error=random.gauss(0.0, TORQUE_ERROR)) for joint, drive in drives.items()
    }


class CarriedBed:
    """A MudBed: the robot is carried to each trial's position along the track."""

    def __init__(
        self, robot: LockstepRobot, lockstep: ReferenceLockstep, position_m: Callable[[PlannedTrial, int], float]
    ) -> None:
        self._robot = robot
        self._lockstep = lockstep
        self._position_m = position_m
        self._prepared = 0

    def prepare(self, trial: PlannedTrial) -> str:
        disarm(self._robot)
        plant = self._lockstep.robot.plant
        plant.body.forward_m = self._position_m(trial, self._prepared)
        self._lockstep.robot.request_put_back()
        self._prepared += 1
        self._robot.wait(PERIOD_S)
        return GO_ON

    def truths(self, flipper: str) -> Truths:
        own = [stride for stride in self._lockstep.truths if stride.flipper == flipper]
        return {stride.index: self._truth(stride) for stride in own}

    def _truth(self, stride: StrideTruth) -> dict[str, float | None]:
        """Return the coefficients of the plate as the flipper carries it."""
        configuration, plant = self._robot.configuration, self._lockstep.robot.plant
        relaxation, pause_s = plant.parameters.disturbances.relaxation, configuration.gait.pause_s
        truth = true_coefficients(stride, configuration.geometry, relaxation, pause_s, upright=False)
        return {name: value if isfinite(value) else None for name, value in truth._asdict().items()}
