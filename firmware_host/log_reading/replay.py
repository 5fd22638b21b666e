"""The live estimator over recorded rows: a log of ours gives again what the daemon computed, to the last digit; the
authors' logs are its first real input.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path

from control.geometry import FlipperGeometry
from control.joint_pd import ArmMass
from control.modes import Mode
from control.records import BodyPose, Phase, StrideEstimate
from estimation.joint_load import FlipperDrive
from estimation.mud import PAPER_DRAG_N, EstimationParameters, Method, MudEstimator
from estimation.mud_map import MapRow
from estimation.recorded_states import recorded_states
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from firmware_host.configuration.toml_records import ConfigurationError
from firmware_host.log_reading.lab_csv import LabLog, read_lab_csv
from firmware_host.log_reading.log_reader import (
    Log,
    LogError,
    Watch,
    begin_s,
    read_log,
    read_logs,
    segment_of,
    unwatched,
)

PAPER_CONSTANT_NM_A = 0.083
WEIGHTLESS = ArmMass(
    arm_mass_kg=0.0, center_of_mass_m=0.0, sweep_inertia_kg_m2=0.0, adduction_inertia_kg_m2=0.0
)  # what the authors' method assumes; nothing else is known of their arm
LAB_DRIVE = FlipperDrive(WEIGHTLESS, PAPER_CONSTANT_NM_A, PAPER_CONSTANT_NM_A)
NO_VELOCITY = (nan, nan, nan, nan)
PHASES = tuple(Phase)
WATCHED_TICKS = 1000  # between two words on how far it is
TICK_FIELDS = (
    "stamp_s", "mode", "phase",
    "body_x_m", "angle_rad", "velocity_rad_s", "current_a", "angle_age_s", "current_age_s",
)  # fmt: skip


@dataclass(frozen=True)
class Replay:
    """Everything that one recorded run says about the mud."""

    strides: list[StrideEstimate]
    flippers: tuple[str, ...]
    map: tuple[MapRow, ...] = ()  # of the mud along the way, where there was a pose
    complete: bool = True  # False where the writer of the log was cut off, or still writes
    segment: int = 0  # of the run, where the log begins with a later one
    begin_s: float = 0.0  # by the log's own clock, which is that of the strides


def replay_files(
    paths: Sequence[Path],
    configuration: Configuration | None = None,
    method: Method | None = None,
    watch: Watch = unwatched,
) -> Replay:
    """One file, or several segments of one run. Raises LogError."""
    if len(paths) == 1:
        return replay_file(paths[0], configuration, method, watch)
    return replay_log(paths[0], read_logs(paths, watch), configuration, method, watch)


def replay_file(
    path: Path, configuration: Configuration | None = None, method: Method | None = None, watch: Watch = unwatched
) -> Replay:
    """Replays our MCAP log or the authors' CSV, by the file's name. Raises LogError.

    `method` instead of the configured one.
    """
    if path.name.endswith((".csv", ".csv.gz")):
        return replay_lab(read_lab_csv(path), configuration, method)
    if path.suffix == ".mcap":
        return replay_log(path, read_log(path, watch), configuration, method, watch)
    raise LogError(f"{path}: not a log: its name must end with .mcap, .csv or .csv.gz")


def replay_log(
    path: Path,
    log: Log,
    configuration: Configuration | None = None,
    method: Method | None = None,
    watch: Watch = unwatched,
) -> Replay:
    """Uses the configuration that the log carries, unless another one is given."""
    configuration = configuration or configuration_of(path, log.configuration_text)
    parameters = _by_method(configuration.estimation, method)
    drag_n = configuration.adaptation.body_drag_n
    estimator = MudEstimator(configuration.geometry, configuration.flipper_drives, parameters, drag_n)
    strides = list(_strides_of_log(estimator, log, watch))
    return Replay(strides, ("left", "right"), estimator.map.rows(), log.complete, segment_of(log), begin_s(log))


def configuration_of(path: Path, text: str) -> Configuration:
    """Parses the configuration that a log carries. Raises LogError."""
    try:
        return parse_configuration(text)
    except ConfigurationError as problem:
        raise LogError(f"{path}: its configuration is not one of this version: {problem.problems[0]}") from problem


def _by_method(parameters: EstimationParameters, method: Method | None) -> EstimationParameters:
    return replace(parameters, method=method) if method else parameters


def _strides_of_log(estimator: MudEstimator, log: Log, watch: Watch) -> Iterator[StrideEstimate]:
    """Row by row as the loop did it: first the sample, then the change of mode, which begins a walk afresh."""
    ticks = log.ticks
    walking, mode_before = int(Mode.WALKING), -1
    rows = zip(*(ticks[name].tolist() for name in TICK_FIELDS), strict=True)
    for number, (now_s, mode, phase, body_x_m, *signals) in enumerate(rows):
        if number % WATCHED_TICKS == 0:
            watch("ticks replayed", number, len(ticks))
        reading = estimator.update(now_s, PHASES[phase], recorded_states(now_s, *signals), BodyPose(now_s, body_x_m))
        yield from reading.strides
        if mode == walking and mode_before != walking:
            estimator.reset()
        mode_before = mode


def replay_lab(lab: LabLog, configuration: Configuration | None = None, method: Method | None = None) -> Replay:
    """Assumes the paper's torque constant and a weightless arm, unless a configuration is given.

    One flipper alone hung from a bench; two carried a body.
    """
    geometry, drives, parameters = FlipperGeometry(), (LAB_DRIVE, LAB_DRIVE), EstimationParameters()
    if configuration:
        geometry, drives, parameters = configuration.geometry, configuration.flipper_drives, configuration.estimation
    left, right = (drive._replace(current_limit_a=min(lab.current_limit_a, drive.current_limit_a)) for drive in drives)
    parameters = _by_method(parameters, method)
    parameters = replace(parameters, fixed_base=parameters.fixed_base or len(lab.flippers) == 1)
    drag_n = configuration.adaptation.body_drag_n if configuration else PAPER_DRAG_N
    estimator = MudEstimator(geometry, (left, right), parameters, drag_n)
    strides = [stride for stride in _strides_of_lab(estimator, lab) if stride.flipper in lab.flippers]
    return Replay(strides, lab.flippers, estimator.map.rows(), begin_s=float(lab.stamp_s[0]))


def _strides_of_lab(estimator: MudEstimator, lab: LabLog) -> Iterator[StrideEstimate]:
    for now_s, phase, angles_rad, currents_a, body_x_m in zip(
        *(column.tolist() for column in (lab.stamp_s, lab.phase, lab.angle_rad, lab.current_a, lab.body_x_m)),
        strict=True,
    ):
        states = recorded_states(now_s, angles_rad, NO_VELOCITY, currents_a)
        reading = estimator.update(now_s, PHASES[phase], states, BodyPose(now_s, body_x_m))
        yield from reading.strides
