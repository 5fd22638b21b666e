"""Mud under a simulated robot, prepared as an operator would do it, with a virtual load cell in every stride.

Fresh mud is another position along a track that is long enough: the robot, with torque off, is carried there and its
flippers are laid on the mud. Earlier strokes leave their marks where they were.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import count
from random import Random
from typing import Any

from control.modes import Mode
from control.rate import PERIOD_S
from experiments.robot.bench_robot import disarm
from experiments.robot.lockstep_robot import LockstepRobot
from experiments.study.notebook import Notebook
from experiments.study.prompt import GO_ON, Operator
from experiments.trials.load_cell_truth import true_strides
from experiments.trials.mud_trials import Bench, PlannedTrial, Truths
from experiments.trials.trial import TORQUE_ERROR
from firmware_host.configuration.configuration import Configuration
from simulation.body.reference_sensor import StrideTruth, StrokeReference
from simulation.devices.motion_capture_parameters import OF_THE_PAPER, MotionCaptureParameters
from simulation.harness.direct import Direct
from simulation.harness.file_recorder import FileRecorder
from simulation.harness.lockstep import drives_of
from simulation.mud.disturbances import LAB, drive_changes
from simulation.mud.track import Track

SEED = 1  # of everything random on a simulated bench


class ReferenceRobot(Direct):
    """A robot with a virtual load cell in every stride since the last walk began."""

    def __init__(self, configuration: Configuration, track: Track, seed: int, **rest: Any) -> None:
        super().__init__(configuration, track, seed, **rest)
        self._reference = StrokeReference(configuration.rig)
        self._walked = False
        self._truths: list[StrideTruth] = []

    def step(self) -> None:
        super().step()
        walks = self.loop.mode is Mode.WALKING
        if walks and not self._walked:
            self._reference.reset()
            self._truths = []
        self._walked = walks
        self._truths += self._reference.step(PERIOD_S, self.robot.plant, self.loop.target.phase)

    def readings(self, flipper: str) -> Truths:
        """Return what a load cell with the plate as the flipper carries it reads in each stride."""
        own = [stride for stride in self._truths if stride.flipper == flipper]
        truths = true_strides(own, self.loop.configuration, self.robot.plant.parameters.disturbances.relaxation)
        return {index: truth for (_, index), truth in truths.items()}


def simulated_bench(
    operator: Operator,
    notebook: Notebook,
    configuration: Configuration,
    track: Track,
    position_m: Callable[[PlannedTrial, int], float],
    motion_capture: MotionCaptureParameters = OF_THE_PAPER,
) -> Bench:
    """Make a robot in a laboratory, with its log next to the notebook, and those of earlier benches.

    `position_m` takes a trial and the number of earlier preparations, and returns the trial's place along the track.
    """
    random = Random(f"drives {SEED}")
    drives = drives_of(configuration, **drive_changes(LAB))
    for joint, drive in drives.items():  # the constants differ by the paper's repeatability
        drives[joint] = replace(drive, torque_constant_error=random.gauss(0.0, TORQUE_ERROR))
    logs = (notebook.path.with_name(f"simulated-{number:03d}.mcap") for number in range(1, 1000))
    recorder = FileRecorder(next(path for path in logs if not path.exists()), configuration)
    lockstep = ReferenceRobot(
        configuration,
        track,
        SEED,
        recorder=recorder,
        disturbances=LAB,
        fixed_base=configuration.estimation.fixed_base,
        drives=drives,
        motion_capture=motion_capture,
    )
    robot, prepared = LockstepRobot(lockstep, recorder), count()

    def carry(trial: PlannedTrial) -> str:
        """Carry the robot to the trial's position."""
        disarm(robot)
        lockstep.robot.plant.body.forward_m = position_m(trial, next(prepared))
        lockstep.robot.request_put_back()
        robot.wait(PERIOD_S)
        return GO_ON

    return Bench(robot, operator, notebook, carry, lockstep.readings)
