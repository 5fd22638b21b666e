"""A simulated trial as an estimator meets it: every tick's samples, and the true motion of every stride.

Robot, motors and mud run in step with the daemon's own loop; the samples are those of the loop's estimator. So any
number of methods can be evaluated on the same trial.

The samples may have a latency between current and angle, as a log has whose drives report one later than the other. It
disturbs the samples, not the control. The authors' rows change angles and currents together, so a difference within a
gap between their 50 to 210 distinct states a second cannot be seen in a log. Eight values are read one after another in
such a gap, so those of one joint are at most half of it apart: 2.6 ms at 190 a second.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, repeat
from random import Random
from typing import Any, NamedTuple

from control.controller import WalkOrder
from control.geometry import FlipperGeometry
from control.mud_estimate import MudEstimate
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import GaitPath
from control.rate import PERIOD_S
from control.records import BodyPose, DriveStates, Phase, StrideEstimate
from drivers.drive_types import DEFAULT
from estimation.estimation_parameters import EstimationParameters
from estimation.joint_load import FlipperDrive
from estimation.mud import MudEstimator
from experiments.reports.coefficient_table import compared_rows
from experiments.robot.lockstep_robot import simulated_configuration, start_walk
from experiments.trials.load_cell_truth import FlipperTruths
from experiments.trials.path_reference import PathReference
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.gait_file import PROTOCOLS
from firmware_host.operator.reports import stride_report
from simulation.body.reference_sensor import StrideTruth, StrokeReference
from simulation.harness.direct import Direct
from simulation.mud.disturbances import Disturbances
from simulation.mud.track import Track

BENCH_TORQUE_NM, BENCH_CURRENT_A = 1.65, 20.0  # the authors' drives in their trials with a single flipper
LONGEST_STRIDE_S = 40.0
TORQUE_ERROR = 0.032  # of a motor's constant: the paper's repeatability
LATENCY_S = 0.0026  # the largest
CONSTANTS = ("sweep_constant_nm_a", "adduction_constant_nm_a")


class Sample(NamedTuple):
    """The estimator's input in one tick."""

    now_s: float
    phase: Phase
    states: DriveStates
    body: BodyPose


class TrueLoad(NamedTuple):
    """One flipper, and what its ground does to it in one tick."""

    now_s: float
    phase: Phase
    angles_rad: tuple[float, float]  # sweep and adduction
    body_m: float  # along the track
    sweep_nm: float  # of the ground on the joint
    adduction_nm: float


@dataclass(frozen=True)
class Setup:
    """A gait, a base and a flipper for trials."""

    name: str
    gait: GaitParameters
    fixed_base: bool
    row_period_s: float  # rows between two new samples repeat the last one; 0: every row is new
    depth_m: float = 0.03
    geometry: FlipperGeometry = FlipperGeometry()
    path: GaitPath | None = None  # walked in place of the gait


# The authors' logs hold 50 to 110 distinct states a second of a single flipper, up to 210 of the walking robot.
SINGLE = Setup("single flipper", PROTOCOLS["single_flipper"], fixed_base=True, row_period_s=1.0 / 100.0)
WALKING = Setup("walking", GaitParameters(), fixed_base=False, row_period_s=1.0 / 200.0)
MEASURING_WALK = replace(WALKING, name="measuring walk", gait=PROTOCOLS["measuring"])


@dataclass(frozen=True)
class Trial:
    configuration: Configuration
    drives: tuple[FlipperDrive, ...]  # as the estimator knows them
    samples: Sequence[Sample]
    truths: Sequence[StrideTruth]
    seed: int
    loads: Mapping[str, Sequence[TrueLoad]] = field(default_factory=dict)  # by flipper, in every tick


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
    order = WalkOrder(setup.depth_m, adaptive=False, gait=setup.path)
    robot = start_walk(configuration, track, seed, order, disturbances=disturbances, fixed_base=setup.fixed_base)
    reference = (PathReference if setup.path else StrokeReference)(configuration.rig)
    samples, truths = list[Sample](), list[StrideTruth]()
    loads: dict[str, list[TrueLoad]] = {flipper: [] for flipper in configuration.rig.flippers}
    first, end_s = _sample_of(robot), robot.now_s + strides * LONGEST_STRIDE_S
    while len(truths) < len(configuration.rig.flippers) * strides and robot.now_s < end_s:
        robot.step()
        samples.append(_sample_of(robot))
        truths += reference.step(PERIOD_S, robot.robot.plant, samples[-1].phase)
        for of_flipper, arm in zip(loads.values(), robot.robot.plant.arms, strict=True):
            pose = (arm.sweep_rad, arm.adduction_rad), robot.robot.plant.body_m
            torques_nm = arm.force.sweep_nm, arm.force.adduction_nm
            of_flipper.append(TrueLoad(samples[-1].now_s, samples[-1].phase, *pose, *torques_nm))
    samples = with_latency(samples, Random(f"latency {seed}").uniform(-latency_s, latency_s))
    random, drives = Random(seed), list(configuration.flipper_drives)
    for i, drive in enumerate(drives):
        known = {name: getattr(drive, name) * (1.0 + random.gauss(0.0, torque_error)) for name in CONSTANTS}
        drives[i] = drive._replace(**known)
    rows = rows_of(first, samples, setup.row_period_s)
    return Trial(configuration, tuple(drives), rows, truths, seed, loads)


def _sample_of(robot: Direct) -> Sample:
    loop = robot.loop
    return Sample(robot.now_s, loop.target.phase, loop.states, loop.body)


def with_latency(samples: Sequence[Sample], current_late_s: float) -> list[Sample]:
    """Return the samples with late currents, or with late angles where it is negative, to the nearest tick.

    A late value is stamped with its late arrival.
    """
    ticks = round(abs(current_late_s) / PERIOD_S)
    late, stamp = ["current_a"], "current_stamp_s"
    if current_late_s < 0.0:
        late, stamp = ["angle_rad", "velocity_rad_s"], "angle_stamp_s"
    delayed = []
    for sample, earlier in zip(samples, chain(repeat(samples[0], ticks), samples), strict=False):
        delay_s, states = sample.now_s - earlier.now_s, []
        for state, was in zip(sample.states, earlier.states, strict=True):
            changes = {name: getattr(was, name) for name in late} | {stamp: getattr(was, stamp) + delay_s}
            states.append(state._replace(**changes))
        delayed.append(sample._replace(states=DriveStates(*states)))
    return delayed


def rows_of(first: Sample, samples: Sequence[Sample], row_period_s: float) -> list[Sample]:
    """Return a row for each sample, which repeats the states and the pose of the last row that was new."""
    held, rows = first, list[Sample]()
    for sample in samples:
        if sample.now_s >= held.now_s + row_period_s:
            held = sample
        rows.append(held._replace(now_s=sample.now_s, phase=sample.phase))
    return rows


def replay_trial(
    trial: Trial, parameters: EstimationParameters, with_pose: bool = True
) -> Iterator[tuple[StrideEstimate, MudEstimate]]:
    """Yield each stride of an estimator, and the estimate of the mud after it."""
    estimator = MudEstimator(trial.configuration.geometry, trial.drives, parameters, rig=trial.configuration.rig)
    for sample in trial.samples:
        known = sample if with_pose else sample._replace(body=BodyPose())
        for stride in estimator.update(*known).strides:
            yield stride, estimator.mud_estimate


def compared_trial(
    trial: Trial,
    parameters: EstimationParameters,
    plates: Sequence[FlipperTruths],
    with_pose: bool = True,
    **keys: Any,
) -> list[dict[str, Any]]:
    """Return the rows of an estimator's coefficients that a load cell reads with the leaning plate, the first."""
    rows: list[dict[str, Any]] = []
    for stride, _ in replay_trial(trial, parameters, with_pose):
        number = stride.flipper, stride.index
        readings = [plate.get(number, {}) for plate in plates]
        rows += compared_rows(stride_report(stride), *readings, trial=f"{trial.seed} {stride.flipper}", **keys)
    return [row for row in rows if row["truth"] is not None]
