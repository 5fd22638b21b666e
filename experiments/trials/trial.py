"""A simulated trial as an estimator meets it: every tick's samples, and the true motion of every stride.

Robot, drives and mud run in lockstep with the daemon's own loop, frames included; the samples are those of the loop's
estimator. So any number of methods can be evaluated on the same trial.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from random import Random

from control.controller import WalkOrder
from control.gait.gait import MEASURING, SINGLE_FLIPPER
from control.geometry import FlipperGeometry
from control.mud_estimate import MudEstimate
from control.parameters.gait_parameters import GaitParameters
from control.rate import PERIOD_S
from control.records import BodyPose, StrideEstimate
from drivers.drive_types import DEFAULT
from estimation.estimation_parameters import EstimationParameters
from estimation.joint_load import FlipperDrive
from estimation.mud import MudEstimator
from experiments.robot.lockstep_robot import simulated_configuration
from experiments.trials.latency import Sample, drawn_latency_s, with_latency
from firmware_host.configuration.configuration import Configuration
from simulation.body.reference_sensor import StrideTruth, StrokeReference
from simulation.harness.lockstep import Lockstep
from simulation.mud.disturbances import Disturbances
from simulation.mud.track import Track

BENCH_TORQUE_NM, BENCH_CURRENT_A = 1.65, 20.0  # the authors' drives in their trials with a single flipper
LONGEST_STRIDE_S = 40.0
TORQUE_ERROR = 0.032  # of a motor's constant: the paper's repeatability


@dataclass(frozen=True)
class Setup:
    """A gait, a base and a flipper for trials."""

    name: str
    gait: GaitParameters
    fixed_base: bool
    row_period_s: float  # rows between two new samples repeat the last one; 0: every row is new
    depth_m: float = 0.03
    geometry: FlipperGeometry = FlipperGeometry()


# The authors' logs hold 50 to 110 distinct states a second of a single flipper, up to 210 of the walking robot.
SINGLE = Setup("single flipper", SINGLE_FLIPPER, fixed_base=True, row_period_s=1.0 / 100.0)
WALKING = Setup("walking", GaitParameters(), fixed_base=False, row_period_s=1.0 / 200.0)
MEASURING_WALK = replace(WALKING, name="measuring walk", gait=MEASURING)


@dataclass(frozen=True)
class Trial:
    configuration: Configuration
    drives: tuple[FlipperDrive, ...]  # as the estimator knows them
    samples: Sequence[Sample]
    truths: Sequence[StrideTruth]


def configuration_of(setup: Setup, drive_type: str = DEFAULT) -> Configuration:
    """Return the simulated robot's configuration with a setup's flipper, gait and base, and drives of this type."""
    estimation = EstimationParameters(fixed_base=setup.fixed_base)
    configuration = replace(
        simulated_configuration(drive_type=drive_type), geometry=setup.geometry, gait=setup.gait, estimation=estimation
    )
    if not setup.fixed_base:
        return configuration
    drive = {joint: replace(each, current_limit_a=BENCH_CURRENT_A) for joint, each in configuration.drive.items()}
    return replace(configuration, drive=drive, limits=replace(configuration.limits, torque_nm=BENCH_TORQUE_NM))


def run_trial(
    setup: Setup,
    track: Track,
    disturbances: Disturbances,
    strides: int,
    seed: int,
    torque_error: float = 0.0,
    latency_s: float = 0.0,
) -> Trial:
    """Simulate a trial.

    `torque_error` is the relative standard deviation of each motor's constant from the known one, `latency_s` the
    largest latency between current and angle.
    """
    configuration = configuration_of(setup)
    lockstep = Lockstep(configuration, track, seed, disturbances=disturbances, fixed_base=setup.fixed_base)
    lockstep.arm()
    lockstep.walk(WalkOrder(setup.depth_m, adaptive=False))
    reference, samples, truths = StrokeReference(configuration.rig), list[Sample](), list[StrideTruth]()
    first, end_s = _sample_of(lockstep), lockstep.now_s + strides * LONGEST_STRIDE_S
    while len(truths) < len(configuration.rig.flippers) * strides and lockstep.now_s < end_s:
        lockstep.step()
        samples.append(_sample_of(lockstep))
        truths += reference.step(PERIOD_S, lockstep.robot.plant, samples[-1].phase)
    samples = with_latency(samples, drawn_latency_s(latency_s, seed))
    rows = rows_of(first, samples, setup.row_period_s)
    return Trial(configuration, _known_drives(configuration, torque_error, seed), rows, truths)


def rows_of(first: Sample, samples: Sequence[Sample], row_period_s: float) -> list[Sample]:
    """Return a row for each sample, which repeats the states and the pose of the last row that was new."""
    held, rows = first, list[Sample]()
    for sample in samples:
        if sample.now_s >= held.now_s + row_period_s:
            held = sample
        rows.append(held._replace(now_s=sample.now_s, phase=sample.phase))
    return rows


def _known_drives(configuration: Configuration, torque_error: float, seed: int) -> tuple[FlipperDrive, ...]:
    random = Random(seed)
    return tuple(
        drive._replace(
            sweep_constant_nm_a=drive.sweep_constant_nm_a * (1.0 + random.gauss(0.0, torque_error)),
            adduction_constant_nm_a=drive.adduction_constant_nm_a * (1.0 + random.gauss(0.0, torque_error)),
        )
        for drive in configuration.flipper_drives
    )


def _sample_of(lockstep: Lockstep) -> Sample:
    loop = lockstep.loop
    return Sample(lockstep.now_s, loop.target.phase, loop.states, loop.body)


def replay_trial(
    trial: Trial, parameters: EstimationParameters, with_pose: bool = True
) -> Iterator[tuple[StrideEstimate, MudEstimate]]:
    """Yield each stride of an estimator, and the estimate of the mud after it."""
    estimator = MudEstimator(trial.configuration.geometry, trial.drives, parameters, rig=trial.configuration.rig)
    for sample in trial.samples:
        known = sample if with_pose else sample._replace(body=BodyPose())
        for stride in estimator.update(*known).strides:
            yield stride, estimator.mud_estimate
