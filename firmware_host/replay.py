"""The live estimator over recorded rows: a log of ours gives again what the daemon computed, to the last digit; the
authors' logs are its first real input.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import nan
from pathlib import Path

from control.geometry import FlipperGeometry
from control.joint_pd import ArmMass
from control.modes import Mode
from control.records import Phase, StrideEstimate
from estimation.mud import MudEstimator
from firmware_host.configuration import Configuration, ConfigurationError, parse_configuration
from firmware_host.lab_csv import LabLog, read_lab_csv
from firmware_host.log_reader import Log, LogError, read_log

PAPER_CONSTANT_NM_A = 0.083
WEIGHTLESS = ArmMass(
    arm_mass_kg=0.0, center_of_mass_m=0.0, sweep_inertia_kg_m2=0.0, adduction_inertia_kg_m2=0.0
)  # what the authors' method assumes; nothing else is known of their arm
NO_VELOCITY = (nan, nan, nan, nan)
PHASES = tuple(Phase)


@dataclass(frozen=True)
class Replay:
    """Everything that one recorded run says about the mud."""

    strides: list[StrideEstimate]
    flippers: tuple[str, ...]
    complete: bool = True  # False where the writer of the log was cut off


def replay_file(path: Path, configuration: Configuration | None = None) -> Replay:
    """By the file's name: our MCAP log, or the authors' CSV. Raises LogError."""
    if path.name.endswith((".csv", ".csv.gz")):
        return replay_lab(read_lab_csv(path), configuration)
    if path.suffix == ".mcap":
        return replay_log(path, read_log(path), configuration)
    raise LogError(f"{path}: not a log: its name must end with .mcap, .csv or .csv.gz")


def replay_log(path: Path, log: Log, configuration: Configuration | None = None) -> Replay:
    """With the configuration that the log carries, unless another one is given."""
    try:
        configuration = configuration or parse_configuration(log.configuration_text)
    except ConfigurationError as problem:
        raise LogError(f"{path}: its configuration is not one of this version: {problem.problems[0]}") from problem
    estimator = MudEstimator(configuration.geometry, configuration.arm, configuration.torque_constants_nm_a)
    return Replay(list(_strides_of_log(estimator, log)), ("left", "right"), log.complete)


def _strides_of_log(estimator: MudEstimator, log: Log) -> Iterator[StrideEstimate]:
    """Row by row as the loop did it: first the sample, then the change of mode, which begins a walk afresh."""
    ticks = log.ticks
    walking, mode_before = int(Mode.WALKING), -1
    for now_s, mode, phase, angles_rad, velocities_rad_s, currents_a, body_x_m in zip(
        *(
            ticks[name].tolist()
            for name in ("stamp_s", "mode", "phase", "angle_rad", "velocity_rad_s", "current_a", "body_x_m")
        ),
        strict=True,
    ):
        reading = estimator.update(now_s, PHASES[phase], angles_rad, velocities_rad_s, currents_a, body_x_m)
        yield from reading.strides
        if mode == walking and mode_before != walking:
            estimator.reset()
        mode_before = mode


def replay_lab(lab: LabLog, configuration: Configuration | None = None) -> Replay:
    """With the paper's torque constant and a weightless arm, unless a configuration is given."""
    geometry = configuration.geometry if configuration else FlipperGeometry()
    mass = configuration.arm if configuration else WEIGHTLESS
    constant = PAPER_CONSTANT_NM_A
    constants = configuration.torque_constants_nm_a if configuration else (constant, constant, constant, constant)
    estimator = MudEstimator(geometry, mass, constants)
    strides = [stride for stride in _strides_of_lab(estimator, lab) if stride.flipper in lab.flippers]
    return Replay(strides, lab.flippers)


def _strides_of_lab(estimator: MudEstimator, lab: LabLog) -> Iterator[StrideEstimate]:
    for now_s, phase, angles_rad, currents_a, body_x_m in zip(
        *(column.tolist() for column in (lab.stamp_s, lab.phase, lab.angle_rad, lab.current_a, lab.body_x_m)),
        strict=True,
    ):
        reading = estimator.update(now_s, PHASES[phase], angles_rad, NO_VELOCITY, currents_a, body_x_m)
        yield from reading.strides
