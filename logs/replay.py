"""Feeds recorded rows to the estimator of the live robot.

A log of this project gives the estimates that the daemon computed, to the last digit. The logs of the paper's authors,
which hold angles and currents of their own robot, are replayed with the assumptions of their method.
"""

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import nan
from pathlib import Path

from control.geometry import FlipperGeometry
from control.modes import Mode
from control.mud_estimate import FlipperEstimate
from control.parameters.arm_mass import ArmMass
from control.records import FLIPPERS, JOINTS, BodyPose, Phase, StrideEstimate
from estimation.estimation_parameters import EstimationParameters, Method
from estimation.joint_load import FlipperDrive
from estimation.mud import PAPER_DRAG_N, MudEstimator, MudReading
from estimation.mud_map import MapRow
from estimation.recorded_states import recorded_states
from estimation.strokes.fit_samples import FitSamples, StrideFits
from firmware_host.configuration.configuration import CaptureAxis, Configuration, PoseParameters
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import parse_configuration
from logs.files.log_error import LogError, Watch, unwatched
from logs.files.log_reader import AnyLog, watched_blocks
from logs.files.log_summary import begin_s, segments_before
from logs.files.scanned_log import scan_logs
from logs.files.tick_array import Ticks
from logs.lab.columns import PAPER_CONSTANT_NM_A
from logs.lab.findings import Finding
from logs.lab.lab_csv import LabLog, is_lab_csv, read_lab_csv

UNEVEN_M = 0.005  # standard error of the mud's height under the authors' walking robot, which sinks and pitches
WEIGHTLESS = ArmMass(
    arm_mass_kg=0.0, center_of_mass_m=0.0, sweep_inertia_kg_m2=0.0, adduction_inertia_kg_m2=0.0
)  # the assumption of the authors' method; the masses of their arm are unknown
LAB_DRIVE = FlipperDrive(WEIGHTLESS, PAPER_CONSTANT_NM_A, PAPER_CONSTANT_NM_A)
NO_VELOCITY = (nan,) * len(JOINTS)
PHASES = tuple(Phase)
TICK_FIELDS = (
    "stamp_s", "mode", "phase",
    "body_x_m", "angle_rad", "velocity_rad_s", "current_a", "angle_age_s", "current_age_s",
)  # fmt: skip


@dataclass(frozen=True)
class Replay:
    """The estimates from one recorded run."""

    strides: list[StrideEstimate]
    flippers: tuple[str, ...]
    map: tuple[MapRow, ...] = ()  # of the mud along the track, where there was a pose
    complete: bool = True  # False where the writer of the log was cut off, or still writes
    segment: int = 0  # of the run with which the log begins; 0 also where it begins with a trial
    begin_s: float = 0.0  # on the log's own clock, which is also that of the strides
    findings: tuple[Finding, ...] = ()  # what the reader noticed in a CSV of the authors
    fits: tuple[StrideFits, ...] = ()  # that the estimates come from, one for each stride
    remembered: tuple[FlipperEstimate, ...] = ()  # what the robot knew before each stride closed
    chosen_depths_m: tuple[float, ...] = ()  # after each stride, by the robot itself; NaN where the log does not say


def replay_files(
    paths: Sequence[Path],
    configuration: Configuration | None = None,
    method: Method | None = None,
    watch: Watch = unwatched,
    vertical: CaptureAxis | None = None,
) -> Replay:
    """Replay a log of this project, several segments of one run, or the authors' CSV. Raises LogError.

    `configuration` and `method` replace those of the log. `vertical` is the axis of a CSV's capture that points up; it
    replaces `pose.vertical` of the configuration.
    """
    path = paths[0]
    if len(paths) == 1 and is_lab_csv(path):
        pose, geometry = PoseParameters(), FlipperGeometry()
        if configuration:
            pose, geometry = configuration.pose, configuration.geometry
        return replay_lab(read_lab_csv(path, vertical or pose.vertical, geometry), configuration, method)
    if vertical:
        raise LogError(f"{path}: only a CSV of motion capture has a vertical axis to choose")
    if len(paths) == 1 and path.suffix != ".mcap":
        raise LogError(f"{path}: not a log: its name must end with .mcap, .csv or .csv.gz")
    return replay_log(path, scan_logs(paths, watch), configuration, method, watch)


def replay_log(
    path: Path,
    log: AnyLog,
    configuration: Configuration | None = None,
    method: Method | None = None,
    watch: Watch = unwatched,
) -> Replay:
    """Replay with the configuration that the log carries, unless another one is given. Raises LogError."""
    running = RunningReplay(path, log, configuration, method)
    for ticks in watched_blocks(log, watch, "ticks replayed"):
        running.add(ticks)
    return running.finish()


class RunningReplay:
    """Owns an estimator and its estimates from the ticks of a log so far."""

    def __init__(
        self, path: Path, log: AnyLog, configuration: Configuration | None = None, method: Method | None = None
    ) -> None:
        """Raises LogError where the log has no usable configuration, or is of another robot than the given one."""
        configuration = configuration or configuration_of(path, log.configuration_text)
        parameters = replace(configuration.estimation, method=method or configuration.estimation.method)
        body, rig = configuration.adaptation, configuration.rig
        if rig != log.rig:
            own, given = list(log.rig.flippers), list(rig.flippers)
            raise LogError(f"{path}: is of a robot with rig.flippers = {own}, not {given} as in the configuration")
        self._log, self._flippers = log, rig.flippers
        known = configuration.geometry, configuration.flipper_drives, parameters
        self._estimator = MudEstimator(*known, body.body_drag_n, rig, body.body_mass_kg)
        self._strides: list[StrideEstimate] = []
        self._fits: list[StrideFits] = []
        self._remembered: list[FlipperEstimate] = []
        self._mode_before = -1

    def add(self, ticks: Ticks) -> None:
        """The order is that of the loop: the sample comes before the change of mode that resets a walk."""
        estimator, walking = self._estimator, int(Mode.WALKING)
        rows = zip(*(ticks[name].tolist() for name in TICK_FIELDS), strict=True)
        for now_s, mode, phase, body_x_m, *signals in rows:
            states, known = recorded_states(now_s, *signals), estimator.mud_estimate
            reading = estimator.update(now_s, PHASES[phase], states, BodyPose(now_s, body_x_m))
            for stride in reading.strides:
                self._strides.append(stride)
                self._fits.append(_packed(estimator.fits_of(stride.flipper)))
                self._remembered.append(known.of(stride.flipper))
            if mode == walking and self._mode_before != walking:
                estimator.reset()
            self._mode_before = mode

    def finish(self) -> Replay:
        log, strides = self._log, self._strides
        chosen_m = {(FLIPPERS[bool(row["flipper"])], row["t_start_s"]): row["chosen_depth_m"] for row in log.strides}
        return Replay(
            strides,
            self._flippers,
            self._estimator.map.rows(),
            log.complete,
            segments_before(log),
            begin_s(log),
            fits=tuple(self._fits),
            remembered=tuple(self._remembered),
            chosen_depths_m=tuple(chosen_m.get((stride.flipper, stride.t_start_s), nan) for stride in strides),
        )


def _packed(fits: StrideFits) -> StrideFits:
    """Compute the fits now: a stride's samples are smaller than the ticks that they are computed from."""
    packed: list[FitSamples | None] = []
    for found in (samples() for samples in fits):
        columns = [array("d", values) for values in found[:-1]] if found else []
        packed.append(FitSamples._make([*columns, found.slope]) if found else None)
    return StrideFits(*(partial(_stored, each) for each in packed))


def _stored(samples: FitSamples | None) -> FitSamples | None:
    return samples  # no lambda, which cannot come from another process


def configuration_of(path: Path, text: str) -> Configuration:
    """Parse the configuration that a log carries. Raises LogError."""
    try:
        return parse_configuration(text)
    except ConfigurationError as problem:
        raise LogError(f"{path}: this version does not accept its configuration: {problem.problems[0]}") from problem


def replay_lab(
    lab: LabLog,
    configuration: Configuration | None = None,
    method: Method | None = None,
    surface_error_m: float | None = None,
) -> Replay:
    """Replay with `lab_estimator`."""
    estimator = lab_estimator(lab, configuration, method, surface_error_m)
    strides, fits, remembered, known = [], [], [], estimator.mud_estimate
    for _, reading in lab_readings(estimator, lab):
        for stride in reading.strides:
            if stride.flipper in lab.flippers:
                strides.append(stride)
                fits.append(estimator.fits_of(stride.flipper))
                remembered.append(known.of(stride.flipper))
        known = estimator.mud_estimate
    return Replay(
        strides,
        lab.flippers,
        estimator.map.rows(),
        begin_s=float(lab.stamp_s[0]),
        findings=lab.findings,
        fits=tuple(fits),
        remembered=tuple(remembered),
    )


def lab_estimator(
    lab: LabLog,
    configuration: Configuration | None = None,
    method: Method | None = None,
    surface_error_m: float | None = None,
) -> MudEstimator:
    """Return an estimator with the paper's torque constant and a weightless arm, unless a configuration is given.

    A single flipper was mounted on a fixed bench, unless its body moved; others carried a body without a rail, whose
    mass is unknown.
    """
    geometry, drives, parameters = FlipperGeometry(), (LAB_DRIVE,) * len(FLIPPERS), EstimationParameters()
    if not lab.fixed_base:
        parameters = replace(parameters, surface_error_m=UNEVEN_M, free_body=True)
    if configuration:
        geometry, parameters = configuration.geometry, configuration.estimation
        own = dict(zip(configuration.rig.flippers, configuration.flipper_drives, strict=True))
        drives = tuple(own.get(flipper, configuration.flipper_drives[0]) for flipper in FLIPPERS)
    limited = [drive._replace(current_limit_a=min(lab.current_limit_a, drive.current_limit_a)) for drive in drives]
    fixed_base = parameters.fixed_base or lab.fixed_base
    parameters = replace(parameters, method=method or parameters.method, fixed_base=fixed_base)
    if surface_error_m is not None:
        parameters = replace(parameters, surface_error_m=surface_error_m)
    body = configuration.adaptation if configuration else None
    drag_n, mass_kg = (body.body_drag_n, body.body_mass_kg) if body else (PAPER_DRAG_N, 0.0)
    return MudEstimator(geometry, limited, parameters, drag_n, body_mass_kg=mass_kg)


def lab_readings(estimator: MudEstimator, lab: LabLog) -> Iterator[tuple[float, MudReading]]:
    """Yield the time of each row and the estimator's reading of it."""
    for now_s, phase, angles_rad, currents_a, body_x_m in zip(
        *(column.tolist() for column in (lab.stamp_s, lab.phase, lab.angle_rad, lab.current_a, lab.body_x_m)),
        strict=True,
    ):
        states = recorded_states(now_s, angles_rad, NO_VELOCITY, currents_a)
        yield now_s, estimator.update(now_s, PHASES[phase], states, BodyPose(now_s, body_x_m))
